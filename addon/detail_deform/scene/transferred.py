# SPDX-License-Identifier: GPL-3.0-or-later
"""What was transferred to a mesh and stays with it: shape keys, and the modifier that plays an animation."""

import json

from . import apply_result, node_group, stack
from .mesh_data import MeshProblem

CACHE_NAME = "Detail Deform Transfer"
_MADE_KEYS = 'detail_deform_transferred_keys'  # of the mesh: {name: what it was given} of those made here, as JSON
_LONGEST_NAME = 63  # bytes that Blender keeps of one


def made_keys(target):
    """{name: {what: value}} of the keys there that were made here, as Keys.note() was told."""
    text, keys = target.data.get(_MADE_KEYS), target.data.shape_keys
    if not isinstance(text, str) or not keys:
        return {}
    try:
        known = json.JSONDecoder().decode(text)
    except (ValueError, RecursionError):  # names alone, as they were kept before
        known = {name: {} for name in text.split('\n')}
    there = set(keys.key_blocks.keys())  # asked one by one, each would go through all names
    return {name: given for name, given in known.items()
            if name in there and isinstance(given, dict)} if isinstance(known, dict) else {}


class Keys:
    """A target's shape keys, for putting many: what Blender finds by going through all of them is looked up once, and
    what is kept of them is written once."""

    def __init__(self, target):
        self._target, self._made, self._done, self._last = target, made_keys(target), set(), None
        keys = target.data.shape_keys
        self._blocks = {key.name: key for key in keys.key_blocks if key != keys.reference_key} if keys else {}
        self._of_origin = {}
        for name, given in self._made.items():
            self._of_origin.setdefault(_told(given), []).append(name)

    def put(self, origin, offsets, replace):
        """Gives the key of the name that is asked for this shape. One that was not made here stays as it is, unless it
        may be replaced: then the one of the same origin that was made beside it gets the shape, or a new one. One that
        has got its shape keeps it. Returns the key, and what it was given before; None for a new one. It is the
        caller's to note() what it is given now, the origin with it.

        origin: where the shape is from, and what name is asked for: 'source', 'key', 'name'."""
        name = _as_kept(origin['name'])
        key = self._present(name, origin, replace)
        given = self._made.get(key.name, {}) if key else None
        if key:
            apply_result.set_key(self._target, key, offsets)
        else:
            key = apply_result.add_key(self._target, name, offsets)
            self._blocks[key.name] = key
        self._done.add(key.name)
        self._last = key.name
        return key, given

    def _present(self, name, origin, replace):
        """The key that gets the shape; None: a new one."""
        for other in [name] * replace + self._of_origin.get(_told(origin), []) + [name] * (name in self._made):
            if other in self._blocks and other not in self._done:
                return self._blocks[other]
        return None

    def note(self, key, /, **given):
        """Keeps in mind that a key was made here, and what it was given."""
        self._made[key.name] = given

    def finish(self):
        """Writes that down, and makes the last one the active key."""
        if self._last is not None:
            self._target.data[_MADE_KEYS] = json.dumps(self._made, ensure_ascii=False)
            self._target.active_shape_key_index = self._target.data.shape_keys.key_blocks.find(self._last)


def _told(given):
    """An origin, to look up by: of files that something else has written to, too."""
    return tuple(repr(given.get(what)) for what in ('source', 'key', 'name'))


def _as_kept(name):
    return name.encode()[:_LONGEST_NAME].decode(errors='ignore')


def find_cache(target):
    """The modifier that plays what was transferred, or None."""
    cache = target.modifiers.get(CACHE_NAME)
    return cache if cache and cache.type == 'MESH_CACHE' else None


def use_cache(target, path, start):
    """Plays a cache as the first of the target's modifiers."""
    cache = find_cache(target)
    if cache is None:
        cache = target.modifiers.new(CACHE_NAME, 'MESH_CACHE')
        stack.move_to(target, cache, 0)
    node_group.set_up_cache(cache, path, start)


def check_not_shown(target):
    """Raises MeshProblem where something that was transferred shows already, and following would double it."""
    if find_cache(target):
        raise MeshProblem(f"'{target.name}' plays a transferred animation: remove its modifier '{CACHE_NAME}' first.")
    made = made_keys(target)
    shown = [key.name for key in target.data.shape_keys.key_blocks
             if key.name in made and key.value and not key.mute] if target.data.shape_keys else []
    if shown:
        raise MeshProblem(f"Shape keys that were transferred are shown, as '{shown[0]}', and would be doubled: set "
                          "their values to 0 first.")
