# SPDX-License-Identifier: GPL-3.0-or-later
"""Results of transfers that are kept on the target: shape keys, and the modifier that plays a cached animation."""

import json

from . import apply_result, cache_modifier, display_key, stack
from .mesh_data import MeshProblem

CACHE_NAME = "Detail Deform Transfer"
_RECORDS = 'detail_deform_transferred_keys'  # custom property of the mesh: JSON {key name: what record() recorded}
_LONGEST_NAME = 63  # bytes of UTF-8: Blender's limit, to which it truncates names


def transferred_keys(target):
    """{name: {what: value}}: records of KeyWriter.record() for the keys made by transfers that still exist."""
    text, keys = target.data.get(_RECORDS), target.data.shape_keys
    if not isinstance(text, str) or not keys:
        return {}
    try:
        known = json.JSONDecoder().decode(text)
    except (ValueError, RecursionError):  # modified by something else
        return {}
    there = set(keys.key_blocks.keys())  # a lookup in key_blocks is linear in their number
    return {name: given for name, given in known.items()
            if name in there and isinstance(given, dict)} if isinstance(known, dict) else {}


class KeyWriter:
    """Writes many shape keys of a target: names, which Blender searches linearly, are looked up once, and the records
    of the keys are written once, by finish()."""

    def __init__(self, target):
        self._target, self._made, self._done, self._last = target, transferred_keys(target), set(), None
        keys = target.data.shape_keys
        self._blocks = {key.name: key for key in display_key.others(target.data) if key != keys.reference_key}
        self._of_origin = {}
        for name, given in self._made.items():
            self._of_origin.setdefault(_hashable(given), []).append(name)

    def put(self, origin, offsets, replace):
        """Writes offsets, (n, 3), to a shape key with the requested name. A key of that name that no transfer made is
        overwritten only if replace is true; otherwise the transferred key of the same origin is overwritten, or a new
        one added. No key is written twice. Returns (key, its previous record or None for a new key). The caller must
        record() its new record, including the origin.

        origin: {'source', 'key', 'name'}: object and key that the shape is from, and the requested name."""
        name = _truncated(origin['name'])
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
        """The existing key to overwrite; None: a new one is needed."""
        for other in [name] * replace + self._of_origin.get(_hashable(origin), []) + [name] * (name in self._made):
            if other in self._blocks and other not in self._done:
                return self._blocks[other]
        return None

    def record(self, key, /, **given):
        """Records that a transfer made this key, and from what."""
        self._made[key.name] = given

    def finish(self):
        """Writes the records to the mesh, and makes the last written key active."""
        if self._last is not None:
            self._target.data[_RECORDS] = json.dumps(self._made, ensure_ascii=False)
            self._target.active_shape_key_index = self._target.data.shape_keys.key_blocks.find(self._last)


def _hashable(given):
    """A hashable key of an origin, also of malformed records in files modified by something else."""
    return tuple(repr(given.get(what)) for what in ('source', 'key', 'name'))


def _truncated(name):
    return name.encode()[:_LONGEST_NAME].decode(errors='ignore')


def find_cache(target):
    """The modifier that plays a transferred animation, or None."""
    cache = target.modifiers.get(CACHE_NAME)
    return cache if cache and cache.type == 'MESH_CACHE' else None


def use_cache(target, path, start):
    """Plays the cache at path from frame start on, by a modifier that is first in the target's stack."""
    cache = find_cache(target)
    if cache is None:
        cache = target.modifiers.new(CACHE_NAME, 'MESH_CACHE')
        stack.move_to(target, cache, 0)
    cache_modifier.set_up(cache, path, start)


def check_not_shown(target):
    """Raises MeshProblem where a transferred cache or key is shown, as following live would apply it twice."""
    if find_cache(target):
        raise MeshProblem(f"'{target.name}' plays a transferred animation: remove its modifier '{CACHE_NAME}' first.")
    made = transferred_keys(target)
    shown = [key.name for key in target.data.shape_keys.key_blocks
             if key.name in made and key.value and not key.mute] if target.data.shape_keys else []
    if shown:
        raise MeshProblem(f"Shape keys that were transferred are shown, as '{shown[0]}', and would be doubled: set "
                          "their values to 0 first.")
