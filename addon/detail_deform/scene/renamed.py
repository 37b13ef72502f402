# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups that were renamed: what names them here goes along. Blender tells nobody, but a group keeps its place
in the list, so the names as they were last are kept with the object."""

_APART = '\n'  # no name of Blender's has one


def note(ob):
    """The names as they are now. Cheap where nothing has changed."""
    names = _APART.join(group.name for group in ob.vertex_groups)
    if ob.detail_deform.known_groups != names:
        ob.detail_deform.known_groups = names


def follow(ob):
    """Has region, influence and handles name groups as they are called now. Whether any was called otherwise."""
    settings = ob.detail_deform
    if not settings.known_groups:
        return False
    known, now = settings.known_groups.split(_APART), [group.name for group in ob.vertex_groups]
    if known == now or len(known) != len(now):  # some have come or gone
        return False
    there = set(now)
    # One that took the place of another, by being moved in the list, has been there before.
    renamed = {old: new for old, new in zip(known, now) if old != new and old not in there and new not in known}
    if not renamed:
        return False
    settings.known_groups = _APART.join(now)
    was_pulled = settings.pulled_region
    namers = [(owner, name, renamed[getattr(owner, name)]) for owner, name in _namers(settings)
              if getattr(owner, name) in renamed]
    for owner, name, new in namers:
        setattr(owner, name, new)
    settings.pulled_region = was_pulled  # it is no choice of the user's
    return bool(namers)


def _namers(settings):
    """(owner, property) of all that name a group."""
    yield from ((settings, name) for name in ('region', 'own_region', 'influence'))
    yield settings.transfer, 'anchor_group'
    yield from ((handle, name) for handle in settings.handles
                for name in ('vertex_group', 'own_group', 'reach', 'own_reach'))
