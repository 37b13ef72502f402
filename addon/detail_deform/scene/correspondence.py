# SPDX-License-Identifier: GPL-3.0-or-later
"""Correspondences between the triangles of a source and a target, and their storage with the target's mesh."""

import array

import numpy as np

from ..library.options import NEAREST
from . import carried, mesh_data
from .mesh_data import MeshProblem

_PROPERTY = 'detail_deform_match'


class Matched:
    """A correspondence between two meshes.

    source_triangles, target_triangles: (m, 3). pairs: (k, 2) indices of triangles, or of vertices, according to
    pairs_of; None where the topology is the same. confidence: (m,) in [0, 1], one a target triangle."""

    pairs_of = 'TRIANGLES'
    points = None  # per target vertex: a source triangle or -1, (n,), and barycentric weights, (n, 3)
    stance = None  # with NEAREST: (4, 4) from the source's local space to the target's
    ambiguous = False  # whether another rotation of the source fits about as well
    mirrored = False  # whether the markers show the target to be the source's mirror image

    def __init__(self, source_triangles, target_triangles, pairs, confidence):
        self.source_triangles, self.target_triangles = source_triangles, target_triangles
        self.pairs, self.confidence = pairs, confidence

    @property
    def is_by_topology(self):
        return self.pairs is None and self.stance is None


def check_source(source, target):
    """Raises MeshProblem where source and target can't be those of a transfer, or one is in Edit Mode."""
    if source is None or source.type != 'MESH':
        raise MeshProblem("There is no source: choose in Source the mesh object whose deformation should be carried "
                          "over.")
    if source == target:
        raise MeshProblem(f"'{target.name}' is both source and target: choose another source.")
    for ob in (source, target):
        mesh_data.check_left_edit_mode(ob)


def by_topology(source, target):
    """The identity correspondence of two meshes of the same topology. Raises MeshProblem where it differs."""
    counts = [(len(ob.data.vertices), len(ob.data.polygons)) for ob in (source, target)]
    is_same = mesh_data.is_same_topology(source.data, target.data)
    if not is_same and counts[0] != counts[1]:
        raise MeshProblem(
            f"'{source.name}' has {counts[0][0]:,} vertices and {counts[0][1]:,} faces, '{target.name}' "
            f"{counts[1][0]:,} and {counts[1][1]:,}: they are not of the same topology. Match them by Shape and "
            "Markers, or by a List.")
    if not is_same:
        raise MeshProblem(f"'{source.name}' has as many vertices and faces as '{target.name}', but its faces join "
                          "other vertices: they are not of the same topology. Match them by Shape and Markers, or by a "
                          "List.")
    triangles = mesh_data.triangles(target.data)
    return Matched(triangles, triangles, None, np.ones(len(triangles), np.float32))


def by_nearest(source, target):
    """A correspondence by nearest points, stored as the present placement of the source relative to the target. Raises
    MeshProblem where an object is scaled to 0, or their boxes are farther apart than the target's diagonal."""
    try:
        matrix = target.matrix_world.inverted() @ source.matrix_world
        matrix.inverted()
    except ValueError as error:
        raise MeshProblem(f"'{source.name}' or '{target.name}' is scaled to 0, so that none lies over the other: scale "
                          "them to a size first.") from error
    stance, places = np.array(matrix, np.float64), [mesh_data.rest(ob.data) for ob in (source, target)]
    if all(map(len, places)):
        (low, high), (least, most) = ((each.min(0), each.max(0)) for each in (
            places[0] @ stance[:3, :3].T + stance[:3, 3], places[1]))
        if np.linalg.norm(np.maximum(0, np.maximum(least - high, low - most))) > np.linalg.norm(most - least):
            raise MeshProblem(f"'{target.name}' stands farther from '{source.name}' than it is large: put it where it "
                              "is worn, as both are without their modifiers and shape keys. What hovers on purpose: "
                              "make it a child of that object or of a bone.")
    return _nearest(source, target, stance)


def _nearest(source, target, stance):
    matched = Matched(mesh_data.triangles(source.data), mesh_data.triangles(target.data), None, None)
    matched.pairs_of, matched.stance = NEAREST, stance
    return matched


# Storage with the target's mesh, in the file

def store(matched, source, target):
    """Stores a correspondence in a custom property of the target's mesh, with the signatures of both topologies, which
    fits() compares."""
    kept = {'source': source.name, 'pairs_of': matched.pairs_of, 'digest': digest_of(matched),
            'source_topology': mesh_data.topology_signature(source.data),
            'target_topology': mesh_data.topology_signature(target.data)}
    if matched.pairs_of == NEAREST:  # the nearest points themselves are searched for at preparation
        kept.update(stance=matched.stance.ravel().tolist(), **_present_points(source, target))
    else:  # With the triangles: Blender's triangulation of n-gons depends on their shape, which may change.
        kept.update({name: _as_list(getattr(matched, name)) for name in _LISTS})
        if matched.points is not None:
            kept.update(zip(_POINTS, map(_as_list, matched.points)))
    target.data[_PROPERTY] = kept


def _present_points(source, target):
    return {'source_points': carried.points(source.data), 'target_points': carried.points(target.data)}


def carry_stance(source, target):
    """Updates the stored stance, which maps the source's local space to the target's, where Set Origin or Apply has
    changed either space."""
    kept = _kept(target)
    if kept is None or kept['pairs_of'] != NEAREST or source.name != kept['source']:
        return
    motions = [carried.motion_since(ob.data, kept.get(name, "")) for ob, name in (
        (source, 'source_points'), (target, 'target_points'))]
    if all(motion is None for motion in motions):
        return
    of_source, of_target = (np.eye(4) if motion is None else motion for motion in motions)
    stance = np.array(kept['stance'], float).reshape(4, 4)
    along = of_target @ stance @ np.linalg.inv(of_source)
    now = np.array(target.matrix_world.inverted_safe() @ source.matrix_world, np.float64)
    if np.linalg.norm(now - along) < np.linalg.norm(now - stance):
        kept['stance'] = along.ravel().tolist()
        matched = _nearest(source, target, along)
        kept['digest'] = digest_of(matched)
    # Otherwise the vertices were moved in Edit Mode: the stance stays, with new sample points for the next comparison.
    for name, text in _present_points(source, target).items():
        kept[name] = text


def _as_list(values):
    kind = 'd' if values.dtype.kind == 'f' else 'i'
    return array.array(kind, np.ascontiguousarray(values, np.float64 if kind == 'd' else np.int32).tobytes())


_TEXTS = ('source', 'pairs_of', 'digest', 'source_topology', 'target_topology')
_LISTS = {'source_triangles': 3, 'target_triangles': 3, 'pairs': 2, 'confidence': 1}  # columns of each array

_POINTS = ('point_triangles', 'point_weights')  # optional: present where a search has found points


def _kept(target):
    """The stored correspondence; None where there is none, or the property is malformed."""
    kept = target.data.get(_PROPERTY)
    if not (hasattr(kept, 'keys') and all(isinstance(kept.get(name), str) for name in _TEXTS) and
            (_is_stance(kept.get('stance')) if kept['pairs_of'] == NEAREST else _are_pairs(kept))):
        return None
    return kept


def _are_pairs(kept):
    return (kept['pairs_of'] in {'TRIANGLES', 'VERTICES'} and
            all(hasattr(kept.get(name), 'typecode') and len(kept[name]) % each == 0
                for name, each in _LISTS.items()) and
            3 * len(kept['confidence']) == len(kept['target_triangles']))


def _points_of(kept, vertex_count):
    """The stored points of a correspondence; None where there are none of this vertex count."""
    values = [kept.get(name) for name in _POINTS]
    if not all(hasattr(each, 'typecode') for each in values) or [vertex_count, 3 * vertex_count] != [*map(len, values)]:
        return None
    return np.array(values[0], np.int32), np.array(values[1], np.float32).reshape(-1, 3)


def _is_stance(values):
    if not (hasattr(values, 'typecode') and len(values) == 16):
        return False
    stance = np.array(values, float).reshape(4, 4)
    return bool(np.isfinite(stance).all()) and abs(np.linalg.det(stance[:3, :3])) > 0


def digest_of(matched):
    """A hash of a correspondence as short text."""
    by = matched.pairs if matched.stance is None else matched.stance
    points = ''.join(map(mesh_data.signature, matched.points or ()))
    return f"{matched.pairs_of}-{mesh_data.signature(by)}{points}"


def digest(target):
    """digest_of() the stored correspondence, or ''."""
    return _kept(target)['digest'] if is_stored(target) else ""


def is_by_nearest(target):
    """Whether the stored correspondence is one by nearest points, that is, a stance."""
    kept = _kept(target)
    return kept is not None and kept['pairs_of'] == NEAREST


def is_stored(target):
    return _kept(target) is not None


def stored_for(target):
    """Name of the source of the stored correspondence; '' where none is stored."""
    kept = _kept(target)
    return kept['source'] if kept else ""


def fits(source, target):
    """Whether a correspondence is stored that is valid for the present topologies of source and target; by nearest
    points, whether it is for the source of this name."""
    kept = _kept(target)
    if kept is not None and kept['pairs_of'] == NEAREST:
        return kept['source'] == source.name
    return kept is not None and all(mesh_data.topology_signature(ob.data) == kept[topology] for ob, topology in (
        (source, 'source_topology'), (target, 'target_topology')))


def stored(source, target):
    """The stored Matched. Raises MeshProblem where there is none, or a topology has changed since."""
    kept = _kept(target)
    if kept is None:
        raise MeshProblem(f"'{target.name}' has no Saved Match yet: press Find Match, or give a List.")
    if kept['pairs_of'] == NEAREST:
        return _nearest(source, target, np.array(kept['stance'], float).reshape(4, 4))
    for ob, topology in ((source, kept['source_topology']), (target, kept['target_topology'])):
        if mesh_data.topology_signature(ob.data) != topology:
            raise MeshProblem(f"The Saved Match of '{target.name}' was made for '{kept['source']}', and the vertices "
                              f"or faces of '{ob.name}' are others: press Find Match to make it anew.")
    matched = Matched(*(np.array(kept[name], np.int32).reshape(-1, _LISTS[name]) for name in (
        'source_triangles', 'target_triangles', 'pairs')), np.array(kept['confidence'], np.float32))
    matched.pairs_of = kept['pairs_of']
    matched.points = _points_of(kept, len(target.data.vertices))
    return matched


def forget(target):
    if is_stored(target):
        del target.data[_PROPERTY]


def vertex_confidence(target):
    """(n,) float32: mean confidence of the triangles at each vertex, in [0, 1]; None where nothing is stored that fits
    the target's topology."""
    kept = _kept(target)
    if (kept is None or kept['pairs_of'] == NEAREST or
            kept['target_topology'] != mesh_data.topology_signature(target.data)):
        return None
    triangles = np.array(kept['target_triangles'], np.int32)
    weights = np.repeat(np.array(kept['confidence'], np.float32), 3)
    count = len(target.data.vertices)
    if not 0 <= triangles.min(initial=0) <= triangles.max(initial=0) < count:
        return None
    sums, counts = np.bincount(triangles, weights, count), np.bincount(triangles, minlength=count)
    return (sums / np.maximum(counts, 1)).astype(np.float32)
