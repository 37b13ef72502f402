# SPDX-License-Identifier: GPL-3.0-or-later
"""What was transferred to a mesh and stays with it: shape keys, and the modifier that plays an animation."""

import json

from . import apply_result, node_group, stack
from .mesh_data import MeshProblem

CACHE_NAME = "Detail Deform Transfer"
_MADE_KEYS = 'detail_deform_transferred_keys'  # of the mesh: {name: what it was given} of those made here, as JSON
_LONGEST_NAME = 63  # bytes that Blender keeps of one


def made_keys(target):
    """{name: {what: value}} of the keys there that were made here, as note() was told."""
    text, keys = target.data.get(_MADE_KEYS), target.data.shape_keys
    if not isinstance(text, str) or not keys:
        return {}
    try:
        known = json.JSONDecoder().decode(text)
    except (ValueError, RecursionError):  # names alone, as they were kept before
        known = {name: {} for name in text.split('\n')}
    return {name: given for name, given in known.items()
            if name in keys.key_blocks and isinstance(given, dict)} if isinstance(known, dict) else {}


def note(target, key, /, **given):
    """Keeps in mind that a key was made here, and what it was given."""
    target.data[_MADE_KEYS] = json.dumps({**made_keys(target), key.name: given}, ensure_ascii=False)


def put_key(target, origin, offsets, replace, done=()):
    """Gives the key of the name that is asked for this shape. One that was not made here stays as it is, unless it may
    be replaced: then the one of the same origin that was made beside it gets the shape, or a new one. Returns the key,
    and what it was given before; None for a new one. It is the caller's to note() what it is given now, the origin
    with it.

    origin: where the shape is from, and what name is asked for: 'source', 'key', 'name'. done: names of the keys that
    have got theirs and keep it."""
    made = made_keys(target)
    key = _present(target, origin, replace, made, done)
    given = made.get(key.name, {}) if key else None
    if key:
        apply_result.set_key(target, key, offsets)
    else:
        key = apply_result.add_key(target, _as_kept(origin['name']), offsets)
    target.active_shape_key_index = target.data.shape_keys.key_blocks.find(key.name)
    return key, given


def _as_kept(name):
    return name.encode()[:_LONGEST_NAME].decode(errors='ignore')


def _present(target, origin, replace, made, done):
    """The key that gets the shape; None: a new one."""
    keys, name = target.data.shape_keys, _as_kept(origin['name'])
    if not keys:
        return None
    same = [other for other, given in made.items() if origin.items() <= given.items()]
    for other in [name] * replace + same + [name] * (name in made):
        if other in keys.key_blocks and other not in done and keys.key_blocks[other] != keys.reference_key:
            return keys.key_blocks[other]
    return None


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
