# SPDX-License-Identifier: GPL-3.0-or-later
"""The Saved Match: a correspondence stored with the target's mesh, and so in the file.

A custom property of the target's mesh tells what it is of. Its arrays, megabytes for large meshes, are custom
properties of another mesh, without geometry, to which the first one points: Blender copies those of the target's own
mesh in each frame in which its offsets change, which took 2.1 to 6.0 ms for 99,458 triangles."""

import array

import bpy
import numpy as np

from ..library.options import NEAREST
from . import carried, correspondence, mesh_data
from .mesh_data import MeshProblem

_PROPERTY = 'detail_deform_match'


def store(matched, source, target):
    """Stores a correspondence, with the signatures of both topologies, which fits() compares."""
    forget(target)
    record = {'source': source.name, 'pairs_of': matched.pairs_of, 'digest': correspondence.digest_of(matched),
              'source_topology': mesh_data.topology_signature(source.data),
              'target_topology': mesh_data.topology_signature(target.data)}
    if matched.pairs_of == NEAREST:  # the nearest points themselves are searched for at preparation
        record.update(stance=matched.relative_transform.ravel().tolist(), **_present_points(source, target))
    else:  # With the triangles: Blender's triangulation of n-gons depends on their shape, which may change.
        record['arrays'] = arrays = bpy.data.meshes.new(f"{target.data.name} Match")
        for name in _LISTS:
            arrays[name] = _as_list(getattr(matched, name))
        for name, values in zip(_POINTS, matched.points or ()):
            arrays[name] = _as_list(values)
    target.data[_PROPERTY] = record


def _present_points(source, target):
    return {'source_points': carried.sample_points(source.data), 'target_points': carried.sample_points(target.data)}


def carry_relative_transform(source, target):
    """Updates the stored relative transform, which maps the source's local space to the target's, where Set Origin or
    Apply has changed either space."""
    record = _record(target)
    if record is None or record['pairs_of'] != NEAREST or source.name != record['source']:
        return
    changes = [carried.space_change(ob.data, record.get(name, "")) for ob, name in (
        (source, 'source_points'), (target, 'target_points'))]
    if all(change is None for change in changes):
        return
    of_source, of_target = (np.eye(4) if change is None else change for change in changes)
    transform = np.array(record['stance'], float).reshape(4, 4)
    carried_along = of_target @ transform @ np.linalg.inv(of_source)
    present = np.array(target.matrix_world.inverted_safe() @ source.matrix_world, np.float64)
    if np.linalg.norm(present - carried_along) < np.linalg.norm(present - transform):
        record['stance'] = carried_along.ravel().tolist()
        matched = correspondence.by_transform(source, target, carried_along)
        record['digest'] = correspondence.digest_of(matched)
    # Otherwise the vertices were moved in Edit Mode: the transform stays, with new sample points for the next
    # comparison.
    for name, text in _present_points(source, target).items():
        record[name] = text


def _as_list(values):
    kind = 'd' if values.dtype.kind == 'f' else 'i'
    return array.array(kind, np.ascontiguousarray(values, np.float64 if kind == 'd' else np.int32).tobytes())


_TEXTS = ('source', 'pairs_of', 'digest', 'source_topology', 'target_topology')
# Of the mesh with the arrays:
_LISTS = {'source_triangles': 3, 'target_triangles': 3, 'pairs': 2, 'confidence': 1}  # columns of each array

_POINTS = ('point_triangles', 'point_weights')  # optional: present where a search has found points


def _record(target):
    """The stored correspondence; None where there is none, or the property is malformed."""
    record = target.data.get(_PROPERTY)
    if not (hasattr(record, 'keys') and all(isinstance(record.get(name), str) for name in _TEXTS) and
            (_is_transform(record.get('stance')) if record['pairs_of'] == NEAREST else
             record['pairs_of'] in {'TRIANGLES', 'VERTICES'} and _are_pairs(record.get('arrays')))):
        return None
    return record


def _are_pairs(arrays):
    return (isinstance(arrays, bpy.types.Mesh) and
            all(hasattr(arrays.get(name), 'typecode') and len(arrays[name]) % each == 0
                for name, each in _LISTS.items()) and
            3 * len(arrays['confidence']) == len(arrays['target_triangles']))


def _points_of(arrays, vertex_count):
    """The stored points of a correspondence; None where there are none of this vertex count."""
    values = [arrays.get(name) for name in _POINTS]
    if not all(hasattr(each, 'typecode') for each in values) or [vertex_count, 3 * vertex_count] != [*map(len, values)]:
        return None
    return np.array(values[0], np.int32), np.array(values[1], np.float32).reshape(-1, 3)


def _is_transform(values):
    if not (hasattr(values, 'typecode') and len(values) == 16):
        return False
    transform = np.array(values, float).reshape(4, 4)
    return bool(np.isfinite(transform).all()) and abs(np.linalg.det(transform[:3, :3])) > 0


def digest(target):
    """correspondence.digest_of() the stored correspondence, or ''."""
    return _record(target)['digest'] if is_stored(target) else ""


def is_by_nearest(target):
    """Whether the stored correspondence is one by nearest points, that is, a relative transform."""
    record = _record(target)
    return record is not None and record['pairs_of'] == NEAREST


def is_stored(target):
    return _record(target) is not None


def stored_for(target):
    """Name of the source of the stored correspondence; '' where none is stored."""
    record = _record(target)
    return record['source'] if record else ""


def fits(source, target):
    """Whether a correspondence is stored that is valid for the present topologies of source and target; by nearest
    points, whether it is for the source of this name."""
    record = _record(target)
    if record is not None and record['pairs_of'] == NEAREST:
        return record['source'] == source.name
    return record is not None and all(mesh_data.topology_signature(ob.data) == record[topology] for ob, topology in (
        (source, 'source_topology'), (target, 'target_topology')))


def stored(source, target):
    """The stored Correspondence. Raises MeshProblem where there is none, or a topology has changed since."""
    record = _record(target)
    if record is None:
        raise MeshProblem(f"'{target.name}' has no Saved Match yet: press Find Match, or give a List.")
    if record['pairs_of'] == NEAREST:
        return correspondence.by_transform(source, target, np.array(record['stance'], float).reshape(4, 4))
    for ob, topology in ((source, record['source_topology']), (target, record['target_topology'])):
        if mesh_data.topology_signature(ob.data) != topology:
            raise MeshProblem(f"The Saved Match of '{target.name}' was made for '{record['source']}', and the vertices "
                              f"or faces of '{ob.name}' are others: press Find Match to make it anew.")
    arrays = record['arrays']
    matched = correspondence.Correspondence(*(np.array(arrays[name], np.int32).reshape(-1, _LISTS[name]) for name in (
        'source_triangles', 'target_triangles', 'pairs')), np.array(arrays['confidence'], np.float32))
    matched.pairs_of = record['pairs_of']
    matched.points = _points_of(arrays, len(target.data.vertices))
    return matched


def forget(target):
    record = target.data.get(_PROPERTY)
    if record is None:
        return
    arrays = record.get('arrays') if hasattr(record, 'keys') else None
    del target.data[_PROPERTY]
    if isinstance(arrays, bpy.types.Mesh) and not arrays.users:  # copies of the target share it
        bpy.data.meshes.remove(arrays)


def vertex_confidence(target):
    """(n,) float32: mean confidence of the triangles at each vertex, in [0, 1]; None where nothing is stored that fits
    the target's topology."""
    record = _record(target)
    if (record is None or record['pairs_of'] == NEAREST or
            record['target_topology'] != mesh_data.topology_signature(target.data)):
        return None
    triangles = np.array(record['arrays']['target_triangles'], np.int32)
    weights = np.repeat(np.array(record['arrays']['confidence'], np.float32), 3)
    count = len(target.data.vertices)
    if not 0 <= triangles.min(initial=0) <= triangles.max(initial=0) < count:
        return None
    sums, counts = np.bincount(triangles, weights, count), np.bincount(triangles, minlength=count)
    return (sums / np.maximum(counts, 1)).astype(np.float32)
