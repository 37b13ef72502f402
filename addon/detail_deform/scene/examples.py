# SPDX-License-Identifier: GPL-3.0-or-later
"""Example poses of MeshIK: shape keys of the mesh, or other objects of the same topology."""

import numpy as np

from . import actions, mesh_data
from .mesh_data import MeshProblem


def enabled(settings):
    return [example for example in settings.examples if example.enabled]


def title(example):
    return example.object.name if example.object else example.name


def positions(ob):
    """(count, n, 3) float32: positions of the enabled examples; None if there are none. Raises MeshProblem."""
    chosen = enabled(ob.detail_deform)
    masks = mesh_data.key_masks(ob, _keys(ob))
    return np.stack([positions_of(ob, example, masks) for example in chosen]) if chosen else None


def positions_of(ob, example, masks=None):
    """(n, 3) float32: positions of one example. masks: as for mesh_data.key_shape(). Raises MeshProblem."""
    if example.object is not None:
        return _positions_of_object(ob, example.object)
    if example.is_object:
        raise MeshProblem(f"The object of example '{example.name}' was deleted: choose another one in Object, or "
                          "take it off the list (Examples).")
    keys = ob.data.shape_keys
    key = keys and keys.key_blocks.get(example.name)
    if not key:
        raise MeshProblem(f"Example '{example.name}': '{ob.name}' has no shape key of that name. Choose another one "
                          "in Shape Key, or take the example off the list (Examples).")
    return mesh_data.key_shape(ob, key, masks)


def _positions_of_object(ob, other):
    if other.type != 'MESH' or len(other.data.vertices) != len(ob.data.vertices):
        count = f"{len(other.data.vertices):,} vertices" if other.type == 'MESH' else "no mesh"
        raise MeshProblem(f"Example '{other.name}' has {count}, and '{ob.name}' {len(ob.data.vertices):,}: an example "
                          "is another pose of the same vertices.")
    if not mesh_data.is_same_topology(ob.data, other.data):
        raise MeshProblem(f"The faces of example '{other.name}' join other vertices than those of '{ob.name}': an "
                          "example is another pose of the same mesh.")
    return mesh_data.positions(other.data)


def weights(settings):
    """The slider weights of the enabled examples."""
    return tuple(example.weight for example in enabled(settings))


def limits(settings):
    """((least, largest), …): bounds on the weight that the handles may give each example; None if none has bounds."""
    chosen = enabled(settings)
    if not any(example.limited for example in chosen):
        return None
    return tuple((example.least_weight, example.largest_weight) if example.limited else (-np.inf, np.inf)
                 for example in chosen)


def add_keys(ob):
    """Adds all shape keys of the mesh that aren't examples yet. Returns their number. Raises MeshProblem."""
    keys = mesh_data.relative_keys(ob)
    if not keys:
        raise MeshProblem(f"'{ob.name}' has no shape keys: make one for each example pose, or select posed copies "
                          "of the object and press Add Selected Objects.")
    examples = ob.detail_deform.examples
    present = {example.name for example in examples if example.object is None}
    new = [key.name for key in keys if key.name not in present]
    for name in new:
        examples.add().name = name
    return len(new)


def add_objects(ob, others):
    """Adds posed copies of the object as examples. Raises MeshProblem, and then adds none."""
    others = [other for other in others if other != ob and other.type == 'MESH']
    if not others:
        raise MeshProblem(f"Select posed copies of '{ob.name}' first, and '{ob.name}' last: the copies become "
                          "examples.")
    rest = mesh_data.rest_positions(ob.data)
    for other in others:
        if np.abs(_positions_of_object(ob, other) - rest).max() == 0:
            raise MeshProblem(f"The mesh of '{other.name}' is that of '{ob.name}' at rest: its modifiers and shape "
                              "keys don't count, apply them first.")
    present = {example.object for example in ob.detail_deform.examples}
    for other in others:
        if other not in present:
            example = ob.detail_deform.examples.add()
            example.is_object, example.name, example.object = True, other.name, other


def _keys(ob):
    """[ShapeKey] of the enabled examples that are shape keys."""
    keys = ob.data.shape_keys
    blocks = keys.key_blocks if keys else {}
    return [blocks[e.name] for e in enabled(ob.detail_deform) if e.object is None and e.name in blocks]


def are_animated(ob):
    """Whether the value of an example's shape key is animated, as after a bake."""
    return any(actions.is_animated(key, 'value') for key in _keys(ob))


def shown_keys(ob):
    """Names of the example shape keys with a non-zero value, which adds to the weights that the method finds."""
    return [key.name for key in _keys(ob) if key.value and not key.mute]
