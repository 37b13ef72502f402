# SPDX-License-Identifier: GPL-3.0-or-later
"""Welds meshes that importers and game tools have split along seams of UVs or normals: where two boundaries coincide
edge by edge, their vertices are treated as one. Otherwise the surface would tear open there when pulled.

In the mesh given to the library, faces on both sides of a seam use the first vertex at each place, the representative.
The other vertices are then in no face and get its displacement. Vertices that a shape key separates, as lips that only
touch, are not welded."""

import numpy as np

from ..library import native
from .. import session
from . import components, display_key, mesh_data

_SEPARATED = 1e-5  # fraction of the mesh's largest extent: a larger distance in a shape key is no rounding error
_FOLDED = -0.99  # cosine of the angle between the normals at a seam: below it the sides are front and back of a card
# Largest deviation of the displacements at one place from their mean, as a fraction of the mean's length: up to _CRACK
# it is a crack, which is closed; from _PARTING on the sides move apart on purpose, and are kept. Between, blended.
_CRACK, _PARTING = 0.1, 0.3
_cache = session.Memo(64)  # of _pairs() and _representatives(), by signatures of their input


def _find_representatives(ob, topology):
    """(n,) intp: the representative of each vertex, the first of those welded with it. None if no vertices are
    welded."""
    mesh = ob.data
    positions = mesh_data.positions(mesh)
    content = mesh_data.signature(positions), topology or mesh_data.topology_signature(mesh)
    pairs = _cache.of(content, lambda: _pairs(mesh, positions))
    if not len(pairs):  # nearly always: avoids reading the keys
        return None
    keys = [mesh_data.key_positions(key) for key in display_key.others(mesh)]
    return _cache.of((*content, 'keys', *map(mesh_data.signature, keys)),
                     lambda: _representatives(pairs, positions, keys))


def _representatives(pairs, positions, keys):
    size = np.ptp(positions, axis=0).max(initial=0)
    for shape in keys:
        apart = np.abs(shape[pairs[:, 0]] - shape[pairs[:, 1]]).max(axis=1, initial=0)
        pairs = pairs[apart <= _SEPARATED * size]
    return components.labels(len(positions), pairs) if len(pairs) else None


def _position_labels(positions):
    """(n,) intp: labels, equal for vertices at exactly the same place; None if all differ or any is not finite."""
    if not len(positions) or not np.isfinite(positions).all():
        return None
    words = (positions + np.float32(0)).view(np.uint32).astype(np.uint64)  # turns -0 into 0
    order = np.argsort(_row_hashes(words), kind='stable')
    same = (positions[order[1:]] == positions[order[:-1]]).all(axis=1)
    if not same.any():
        return None
    result = np.empty(len(positions), np.intp)
    result[order] = np.concatenate([[0], np.cumsum(~same)])
    return result


def _pairs(mesh, positions):
    """(p, 2): pairs of vertices to weld: the ends of two boundary edges that coincide and belong to consistently
    oriented faces."""
    labels = _position_labels(positions)
    if labels is None:
        return np.empty((0, 2), int)
    triangles, shared = mesh_data.triangles(mesh), np.bincount(labels)[labels] > 1
    chosen = np.flatnonzero(shared[triangles].sum(axis=1) >= 2)
    near, at = triangles[chosen], _face_hashes(labels, mesh)[mesh_data.faces_of_triangles(mesh)[chosen]]
    edges = np.concatenate([near[:, [k, (k + 1) % 3]] for k in range(3)])
    owners = np.tile(np.arange(len(near)), 3)
    chosen = shared[edges].all(axis=1) & (labels[edges[:, 0]] != labels[edges[:, 1]])
    edges, owners = edges[chosen].astype(np.int64), owners[chosen]
    edges, owners = _occurring(1, edges, edges, owners)
    seams, owners = _occurring(2, labels[edges], edges, owners)
    # Coinciding edges are adjacent rows. With consistent orientation one runs in the opposite direction.
    one, other = seams[::2], seams[1::2, ::-1]
    sides = owners[::2], owners[1::2]
    normals = [_normals(positions.astype(np.float64), near[side]) for side in sides]
    is_card = (np.einsum('ij,ij->i', *normals) < _FOLDED) | (at[sides[0]] == at[sides[1]])
    is_seam = (labels[one] == labels[other]).all(axis=1) & ~is_card
    return np.concatenate([np.stack([one[is_seam, k], other[is_seam, k]], axis=1) for k in range(2)])


def _occurring(times, ends, edges, owners):
    """(edges, owners) of the edges whose ends, in either order, occur exactly times times; equal ones are adjacent."""
    low, high = ends.min(axis=1), ends.max(axis=1)
    keys = low * (int(ends.max(initial=0)) + 1) + high
    order = np.argsort(keys, kind='stable')
    _, counts = np.unique(keys, return_counts=True)
    chosen = order[np.repeat(counts == times, counts)]
    return edges[chosen], owners[chosen]


def _face_hashes(labels, mesh):
    """(faces,) uint64: hash of each face's corner labels, independent of their order."""
    corners, begins = mesh_data.faces(mesh)
    return np.add.reduceat(_row_hashes(labels[corners].astype(np.uint64)[:, None]), begins) if len(begins) else begins


def _row_hashes(words):
    """(k,) uint64: a hash of each row of words, (k, w) uint64 with w up to 3."""
    factors = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)[:words.shape[1]]
    mixed = words @ factors
    return (mixed ^ (mixed >> np.uint64(29))) * factors[0]


def _normals(positions, triangles):
    a, b, c = np.moveaxis(positions[triangles], 1, 0)
    crosses = np.cross(b - a, c - a)
    return crosses / np.maximum(np.linalg.norm(crosses, axis=1), 1e-300)[:, None]


class WeldedMesh:
    """An object's mesh with split vertices welded. All methods leave their input unchanged if none are, or if the
    object's setting join_split is off."""

    def __init__(self, ob, topology=None):
        """topology: mesh_data.topology_signature() of the mesh, if known."""
        self._first = _find_representatives(ob, topology) if ob.detail_deform.join_split else None
        if self._first is not None:
            self._split = np.flatnonzero(np.bincount(self._first, minlength=len(self._first))[self._first] > 1)
            _, self._numbers = np.unique(self._first[self._split], return_inverse=True)  # labels of welded places

    def representatives(self, vertices):
        """int32: vertex indices, as of triangles or edges, replaced by their representatives."""
        return vertices if self._first is None else self._first.astype(np.int32)[vertices]

    def distances(self, positions, triangles, chosen):
        """(n,) float32: native.distances() over the welded surface. triangles: of the mesh. chosen: (n,) bool."""
        if self._first is None:
            return native.distances(positions, triangles, chosen)
        start = np.zeros(len(chosen), bool)
        start[self._first[chosen]] = True
        return native.distances(positions, self.representatives(triangles), start)[self._first]

    def roles(self, of_vertices):
        """(n,) roles for the welded mesh. A representative is in a handle if a vertex welded with it is, else fixed if
        one is, else free. All other welded vertices are fixed, as they are in no face."""
        if self._first is None:
            return of_vertices
        result, first = of_vertices.copy(), self._first
        result[first[of_vertices == native.ROLE_FIXED]] = native.ROLE_FIXED
        held = np.flatnonzero(of_vertices >= 0)[::-1]  # reversed, so that the first of several is written last
        result[first[held]] = of_vertices[held]
        result[first != np.arange(len(first))] = native.ROLE_FIXED
        return result

    def largest(self, values):
        """(n,) values for the welded mesh: a representative has the largest of the vertices welded with it."""
        if self._first is None:
            return values
        result = values.copy()
        np.maximum.at(result, self._first, values)
        return result

    def spread(self, offsets):
        """(3 n,) offsets: each vertex gets that of its representative."""
        return offsets if self._first is None else offsets.reshape(-1, 3)[self._first].ravel()

    def closed(self, offsets):
        """(3 n,) float32: offsets that were computed per vertex, with cracks at welded places closed by their mean.
        Places whose vertices move apart, as lips do, are unchanged. See _CRACK."""
        if self._first is None:
            return offsets
        result = offsets.reshape(-1, 3).copy()
        ours, numbers = result[self._split].astype(np.float64), self._numbers
        counts = np.bincount(numbers)
        sums = np.stack([np.bincount(numbers, ours[:, k]) for k in range(3)], axis=1)
        means = (sums / counts[:, None])[numbers]
        apart, far = np.linalg.norm(ours - means, axis=1), np.linalg.norm(means, axis=1)
        worst = np.zeros(len(counts))
        np.maximum.at(worst, numbers, apart / np.maximum(far, 1e-300))
        share = np.clip((_PARTING - worst) / (_PARTING - _CRACK), 0, 1)[numbers, None]
        result[self._split] = ours + share * (means - ours)
        return result.ravel()
