# SPDX-License-Identifier: GPL-3.0-or-later
"""Detects renamed vertex groups and updates the settings that refer to them by name. Blender sends no notification, but
a renamed group keeps its index, so the last known names are stored with the object."""

_SEPARATOR = '\n'  # separator: no name in Blender contains it


def store_names(ob):
    """Stores the present names of the vertex groups, if they have changed."""
    names = _SEPARATOR.join(group.name for group in ob.vertex_groups)
    if ob.detail_deform.known_groups != names:
        ob.detail_deform.known_groups = names


def update_names(ob):
    """Replaces the names of renamed groups wherever the settings name one. Returns whether any was replaced."""
    settings = ob.detail_deform
    if not settings.known_groups:
        return False
    known, now = settings.known_groups.split(_SEPARATOR), [group.name for group in ob.vertex_groups]
    if known == now or len(known) != len(now):  # groups were added or removed
        return False
    there = set(now)
    # A group that was moved within the list has a name that was known before: not renamed.
    renamed = {old: new for old, new in zip(known, now) if old != new and old not in there and new not in known}
    if not renamed:
        return False
    settings.known_groups = _SEPARATOR.join(now)
    was_pulled = settings.pulled_region
    namers = [(owner, name, renamed[getattr(owner, name)]) for owner, name in _name_properties(settings)
              if getattr(owner, name) in renamed]
    for owner, name, new in namers:
        setattr(owner, name, new)
    settings.pulled_region = was_pulled  # undo the update callback: the user has not chosen another region
    return bool(namers)


def _name_properties(settings):
    """Generator of (owner, property name) for all settings that name a vertex group."""
    yield from ((settings, name) for name in ('region', 'own_region', 'influence', 'stiff_parts'))
    yield settings.transfer, 'anchor_group'
    yield from ((handle, name) for handle in settings.handles
                for name in ('vertex_group', 'own_group', 'reach', 'own_reach'))
