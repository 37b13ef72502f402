# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that importers and game tools have split along seams of UVs or normals: where two borders lie on one another,
edge by edge, their vertices are taken for one. Without that a surface tears open there when it is pulled.

For the library the faces on both sides of a seam join the first of the vertices at each place; the others have no face
then, and are given what that one moves by. What a shape key takes apart, as lips that only touch, stays apart."""

import numpy as np

from ..library import native
from . import components, mesh_data

_APART = 1e-5  # of the mesh's size: what a shape key moves apart by more than rounding
_FOLDED = -0.99  # cosine between the normals of two sides that lie on one another, as those of a card with two faces
# Of how far vertices at one place have moved, how far they are from their mean: up to the first it is what two sides of
# a seam were told differently, from the second on they go different ways.
_CRACK, _ANOTHER_WAY = 0.1, 0.3
_MOST = 64
_found = {}  # by content: what _pairs() and _first() found, as that takes a while


def _find(ob, topology):
    """(n,) intp: for each vertex the one that stands for it, itself or the first of those at its place that are one.
    None where each stands for itself."""
    mesh = ob.data
    positions = mesh_data.positions(mesh)
    content = mesh_data.signature(positions), topology or mesh_data.topology_signature(mesh)
    pairs = _kept(content, lambda: _pairs(mesh, positions))
    if not len(pairs):  # nearly always, and the keys need not be read
        return None
    keys = [mesh_data.key_positions(key) for key in (mesh.shape_keys.key_blocks if mesh.shape_keys else ())]
    return _kept((*content, 'keys', *map(mesh_data.signature, keys)), lambda: _first(pairs, positions, keys))


def _kept(content, find):
    if content not in _found:
        while len(_found) >= _MOST:
            del _found[next(iter(_found))]
        _found[content] = find()
    return _found[content]


def forget():
    _found.clear()


def _first(pairs, positions, keys):
    size = np.ptp(positions, axis=0).max(initial=0)
    for there in keys:
        apart = np.abs(there[pairs[:, 0]] - there[pairs[:, 1]]).max(axis=1, initial=0)
        pairs = pairs[apart <= _APART * size]
    return components.least(len(positions), pairs) if len(pairs) else None


def _places(positions):
    """(n,) intp: equal numbers for vertices at exactly the same place; None where there are no two."""
    if not len(positions) or not np.isfinite(positions).all():
        return None
    words = (positions + np.float32(0)).view(np.uint32).astype(np.uint64)  # minus zero is zero
    order = np.argsort(_mixed(words), kind='stable')
    same = (positions[order[1:]] == positions[order[:-1]]).all(axis=1)
    if not same.any():
        return None
    result = np.empty(len(positions), np.intp)
    result[order] = np.concatenate([[0], np.cumsum(~same)])
    return result


def _pairs(mesh, positions):
    """(p, 2): vertices at the ends of two edges that are borders and lie on one another, their faces wound alike."""
    places = _places(positions)
    if places is None:
        return np.empty((0, 2), int)
    triangles, shared = mesh_data.triangles(mesh), np.bincount(places)[places] > 1
    chosen = np.flatnonzero(shared[triangles].sum(axis=1) >= 2)
    near, at = triangles[chosen], _places_of_faces(places, mesh)[mesh_data.faces_of_triangles(mesh)[chosen]]
    edges = np.concatenate([near[:, [k, (k + 1) % 3]] for k in range(3)])
    owners = np.tile(np.arange(len(near)), 3)
    chosen = shared[edges].all(axis=1) & (places[edges[:, 0]] != places[edges[:, 1]])
    edges, owners = edges[chosen].astype(np.int64), owners[chosen]
    edges, owners = _that_come(1, edges, edges, owners)
    seams, owners = _that_come(2, places[edges], edges, owners)
    # Next to one another, of which one runs the other way.
    one, other = seams[::2], seams[1::2, ::-1]
    sides = owners[::2], owners[1::2]
    normals = [_normals(positions.astype(np.float64), near[side]) for side in sides]
    is_card = (np.einsum('ij,ij->i', *normals) < _FOLDED) | (at[sides[0]] == at[sides[1]])
    is_seam = (places[one] == places[other]).all(axis=1) & ~is_card
    return np.concatenate([np.stack([one[is_seam, k], other[is_seam, k]], axis=1) for k in range(2)])


def _that_come(times, ends, edges, owners):
    """Those of the edges whose ends, in either order, come so many times, with equal ones next to each other."""
    low, high = ends.min(axis=1), ends.max(axis=1)
    keys = low * (int(ends.max(initial=0)) + 1) + high
    order = np.argsort(keys, kind='stable')
    _, counts = np.unique(keys, return_counts=True)
    chosen = order[np.repeat(counts == times, counts)]
    return edges[chosen], owners[chosen]


def _places_of_faces(places, mesh):
    """(faces,) uint64: equal where faces have their corners at the same places, in any order."""
    corners, begins = mesh_data.faces(mesh)
    return np.add.reduceat(_mixed(places[corners].astype(np.uint64)[:, None]), begins) if len(begins) else begins


def _mixed(words):
    """(k,) uint64 of (k, w) uint64: what falls together and isn't the same is rare."""
    factors = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)[:words.shape[1]]
    mixed = words @ factors
    return (mixed ^ (mixed >> np.uint64(29))) * factors[0]


def _normals(positions, triangles):
    a, b, c = np.moveaxis(positions[triangles], 1, 0)
    crosses = np.cross(b - a, c - a)
    return crosses / np.maximum(np.linalg.norm(crosses, axis=1), 1e-300)[:, None]


class Joined:
    """An object's mesh with split vertices taken for one: all of it as it is where none is split, or where the object's
    setting says that they are not."""

    def __init__(self, ob, topology=None):
        """topology: mesh_data.topology_signature, if it is known."""
        self._first = _find(ob, topology) if ob.detail_deform.join_split else None
        if self._first is not None:
            self._split = np.flatnonzero(np.bincount(self._first, minlength=len(self._first))[self._first] > 1)
            _, self._numbers = np.unique(self._first[self._split], return_inverse=True)  # of their places

    def between(self, vertices):
        """int32: these numbers of vertices, as of triangles or edges, by those that stand for them."""
        return vertices if self._first is None else self._first.astype(np.int32)[vertices]

    def distances(self, places, triangles, chosen):
        """(n,) float32: native.distances over the joined surface. triangles: of the mesh. chosen: (n,) bool."""
        if self._first is None:
            return native.distances(places, triangles, chosen)
        start = np.zeros(len(chosen), bool)
        start[self._first[chosen]] = True
        return native.distances(places, self.between(triangles), start)[self._first]

    def roles(self, of_vertices):
        """(n,) roles of a binding in which only the vertices that stand for others have one: a handle's where any of
        those that are one has it, fixed where one is, and otherwise free. The others are fixed, as they are in no face.
        """
        if self._first is None:
            return of_vertices
        result, first = of_vertices.copy(), self._first
        result[first[of_vertices == native.ROLE_FIXED]] = native.ROLE_FIXED
        held = np.flatnonzero(of_vertices >= 0)[::-1]  # of several the first counts, as the last that is written
        result[first[held]] = of_vertices[held]
        result[first != np.arange(len(first))] = native.ROLE_FIXED
        return result

    def copied(self, offsets):
        """(3 n,) offsets: those of the first go for all."""
        return offsets if self._first is None else offsets.reshape(-1, 3)[self._first].ravel()

    def closed(self, offsets):
        """(3 n,) float32 offsets that were found for each vertex: cracks are closed. Vertices of one place that go ways
        of their own, as lips do, are left alone."""
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
        share = np.clip((_ANOTHER_WAY - worst) / (_ANOTHER_WAY - _CRACK), 0, 1)[numbers, None]
        result[self._split] = ours + share * (means - ours)
        return result.ravel()
