# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles of a source correspond to those of a target: found, read, written, kept with the target."""

import array

import numpy as np

from ..library import native
from ..scene import mesh_data
from . import markers
from ..scene.mesh_data import MeshProblem

_PROPERTY = 'detail_deform_match'
_SAYS = {'TRIANGLES': "pairs of triangles", 'VERTICES': "pairs of vertices"}  # files that were written here


class Matched:
    """Two meshes with their corresponding triangles.

    source_triangles, target_triangles: (m, 3); pairs: (k, 2) of their numbers, or of those of vertices as
    pairs_of says, None where the topology is the same; confidence: (m,) of the target's triangles, 0 to 1."""

    pairs_of = 'TRIANGLES'

    def __init__(self, source_triangles, target_triangles, pairs, confidence):
        self.source_triangles, self.target_triangles = source_triangles, target_triangles
        self.pairs, self.confidence = pairs, confidence


def check_source(source, target):
    """Raises MeshProblem when nothing can be transferred from this object to that."""
    if source is None or source.type != 'MESH':
        raise MeshProblem("There is no source: choose the mesh object whose deformation should be transferred.")
    if source == target:
        raise MeshProblem(f"'{target.name}' is both source and target: choose another source.")
    if source.mode == 'EDIT' or target.mode == 'EDIT':
        raise MeshProblem(f"'{(source if source.mode == 'EDIT' else target).name}' is in Edit Mode: leave it (Tab) "
                          "first.")


def by_topology(source, target):
    """Each triangle is its own source."""
    counts = [(len(ob.data.vertices), len(ob.data.polygons)) for ob in (source, target)]
    if counts[0] != counts[1]:
        raise MeshProblem(
            f"'{source.name}' has {counts[0][0]:,} vertices and {counts[0][1]:,} faces, '{target.name}' "
            f"{counts[1][0]:,} and {counts[1][1]:,}: they are not of the same topology. Mark places that correspond "
            "(Markers), or give a list.")
    if mesh_data.topology_signature(source.data) != mesh_data.topology_signature(target.data):
        raise MeshProblem(f"'{source.name}' has as many vertices and faces as '{target.name}', but its faces join "
                          "other vertices: they are not of the same topology. Mark places that correspond (Markers), "
                          "or give a list.")
    triangles = mesh_data.triangles(target.data)
    return Matched(triangles, triangles, None, np.ones(len(triangles), np.float32))


def read_pairs(path, pairs_of):
    """(k, 2) int32 from a file with a pair of numbers a line, source then target, from 0.

    Numbers may be parted by spaces, commas, colons or semicolons; what follows them, comments after # and a
    first line with nothing but a count are passed over."""
    pairs = []
    try:
        with open(path, encoding='utf-8-sig') as file:
            for number, line in enumerate(file, 1):
                said = next((kind for kind in _SAYS if _SAYS[kind] in line), pairs_of)
                if said != pairs_of:
                    raise MeshProblem(f"'{path}' says that it holds pairs of {said.lower()}: choose that (Pairs of).")
                words = line.split('#')[0].replace(',', ' ').replace(';', ' ').replace(':', ' ').split()
                if not words or (len(words) == 1 and not pairs and words[0].isdigit()):
                    continue
                try:
                    pairs.append([int(words[0]), int(words[1])])
                except (ValueError, IndexError) as error:
                    raise MeshProblem(
                        f"'{path}', line {number}: '{line.strip()[:40]}' is not a pair of numbers.") from error
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, 'strerror', None) or "it is no text"
        raise MeshProblem(f"'{path}' can't be read: {reason}.") from error
    if not pairs:
        raise MeshProblem(f"'{path}' has no pairs of numbers: write one pair a line, source then target.")
    limit = np.iinfo(np.int32).max
    if max(max(map(abs, pair)) for pair in pairs) > limit:
        raise MeshProblem(f"'{path}' has a number over {limit:,}.")
    return np.array(pairs, np.int32)


def write_pairs(path, matched):
    """As read_pairs() reads them."""
    try:
        np.savetxt(path, matched.pairs, fmt='%d', header=f"{_SAYS[matched.pairs_of]}, source and target, from 0")
    except OSError as error:
        raise MeshProblem(f"'{path}' can't be written: {error.strerror}.") from error


def by_list(source, target, path, pairs_of):
    """From a file of pairs of triangles, or of vertices."""
    matched = Matched(mesh_data.triangles(source.data), mesh_data.triangles(target.data),
                      read_pairs(path, pairs_of), None)
    counts = {'TRIANGLES': (len(matched.source_triangles), len(matched.target_triangles)),
              'VERTICES': (len(source.data.vertices), len(target.data.vertices))}[pairs_of]
    outside = np.argwhere((matched.pairs < 0) | (matched.pairs >= counts))
    if len(outside):
        row, side = outside[0]
        raise MeshProblem(f"'{path}': pair {row + 1} names number {matched.pairs[row, side]} of "
                          f"'{(source, target)[side].name}', which has {counts[side]:,} {pairs_of.lower()}, "
                          "counted from 0.")
    matched.pairs_of = pairs_of
    paired = np.zeros(counts[1], np.float32)
    paired[matched.pairs[:, 1]] = 1
    matched.confidence = paired if pairs_of == 'TRIANGLES' else paired[matched.target_triangles].mean(1)
    return matched


_last = ((), None)  # what was found last, and of what: a transfer may be repeated with other settings


def _searched_for(source, target):
    return (*(mesh_data.signature(mesh_data.rest(ob.data)) + mesh_data.topology_signature(ob.data)
              for ob in (source, target)),
            markers.pairs(source, target).tobytes())


def found_before(source, target):
    """The correspondence when it was the last one found, or None. Raises MeshProblem."""
    made_of, matched = _last
    return matched if made_of == _searched_for(source, target) else None


def search(source, target):
    """Starts to look for what corresponds, from the markers of both objects: a native Match, which works in the
    background, and what finished() takes. Raises MeshProblem or native.NativeError."""
    pairs = markers.pairs(source, target)
    matched = Matched(mesh_data.triangles(source.data), mesh_data.triangles(target.data), None, None)
    match = native.Match((mesh_data.rest(source.data), matched.source_triangles),
                         (mesh_data.rest(target.data), matched.target_triangles), pairs)
    return match, matched


def finished(match, matched, source, target):
    """Waits for a search. Raises native.NativeError."""
    global _last
    matched.pairs, matched.confidence, _ = match.finish()
    _last = (_searched_for(source, target), matched)
    return matched


# Kept with the target's mesh, in the file

def store(matched, source, target):
    """Keeps a correspondence with the target, by which its mesh and the source's are known again."""
    target.data[_PROPERTY] = {
        'source': source.name, 'pairs_of': matched.pairs_of, 'digest': digest_of(matched),
        'source_topology': mesh_data.topology_signature(source.data),
        'target_topology': mesh_data.topology_signature(target.data),
        # Of faces with more corners Blender makes triangles by their shape, which may change.
        **{name: _as_list(getattr(matched, name))
           for name in ('source_triangles', 'target_triangles', 'pairs', 'confidence')}}


def _as_list(values):
    kind = 'd' if values.dtype.kind == 'f' else 'i'
    return array.array(kind, np.ascontiguousarray(values, np.float64 if kind == 'd' else np.int32).tobytes())


def _kept(target):
    return target.data.get(_PROPERTY)


def digest_of(matched):
    """A short text: equal texts, equal correspondences."""
    return f"{matched.pairs_of}-{mesh_data.signature(matched.pairs)}"


def digest(target):
    """A short text: equal texts, equal correspondences kept."""
    return _kept(target)['digest'] if is_stored(target) else ""


def is_stored(target):
    return _kept(target) is not None


def stored(source, target):
    """The correspondence kept with the target. Raises MeshProblem where it doesn't fit these objects any more."""
    kept = _kept(target)
    if kept is None:
        raise MeshProblem(f"'{target.name}' holds no correspondences yet: find them by markers, or read a list.")
    for ob, topology in ((source, kept['source_topology']), (target, kept['target_topology'])):
        if mesh_data.topology_signature(ob.data) != topology:
            raise MeshProblem(f"The correspondences kept with '{target.name}' were made for '{kept['source']}', and "
                              f"the vertices or faces of '{ob.name}' are others: find them anew.")
    matched = Matched(*(np.array(kept[name], np.int32).reshape(-1, columns) for name, columns in (
        ('source_triangles', 3), ('target_triangles', 3), ('pairs', 2))), np.array(kept['confidence'], np.float32))
    matched.pairs_of = kept['pairs_of']
    return matched


def forget(target):
    if is_stored(target):
        del target.data[_PROPERTY]


def vertex_confidence(target):
    """(n,) float32: how well the surface about each vertex is matched, 0 to 1; None where nothing is kept that
    fits the mesh."""
    kept = _kept(target)
    if kept is None or kept['target_topology'] != mesh_data.topology_signature(target.data):
        return None
    triangles = np.array(kept['target_triangles'], np.int32)
    weights = np.repeat(np.array(kept['confidence'], np.float32), 3)
    count = len(target.data.vertices)
    sums, counts = np.bincount(triangles, weights, count), np.bincount(triangles, minlength=count)
    return (sums / np.maximum(counts, 1)).astype(np.float32)
