# SPDX-License-Identifier: GPL-3.0-or-later
"""What was transferred to a mesh and stays with it: shape keys, and the modifier that plays an animation."""

from . import apply_result, node_group, stack
from .mesh_data import MeshProblem

CACHE_NAME = "Detail Deform Transfer"
_MADE_KEYS = 'detail_deform_transferred_keys'  # of the mesh: names of those that were made here
_LONGEST_NAME = 63  # bytes that Blender keeps of one


def put_key(target, name, offsets, replace):
    """The key of that name with this shape. One that was not made here stays as it is, unless it may be replaced,
    and gets another one beside it."""
    name = name.encode()[:_LONGEST_NAME].decode(errors='ignore')
    keys = target.data.shape_keys
    present = keys and keys.key_blocks.get(name)
    made = target.data.get(_MADE_KEYS, "").split('\n')
    if present and present != keys.reference_key and (replace or name in made):
        apply_result.set_key(target, present, offsets)
    else:
        present = apply_result.add_key(target, name, offsets)
    target.data[_MADE_KEYS] = '\n'.join(dict.fromkeys([*filter(None, made), present.name]))
    target.active_shape_key_index = target.data.shape_keys.key_blocks.find(present.name)
    return present


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
    made = target.data.get(_MADE_KEYS, "").split('\n')
    shown = [key.name for key in target.data.shape_keys.key_blocks
             if key.name in made and key.value and not key.mute] if target.data.shape_keys else []
    if shown:
        raise MeshProblem(f"Shape keys that were transferred are shown, as '{shown[0]}', and would be doubled: set "
                          "their values to 0 first.")
