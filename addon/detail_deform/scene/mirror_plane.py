# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices on the plane of a Mirror modifier stay on it, as both halves of the seam.

What the deformation would move them across it is taken from the vertices around, too, less and less towards handles and
fixed vertices."""

import numpy as np
from mathutils import kdtree

from ..library import native
from . import mesh_data, node_group, split, start

_NEAREST = 4  # vertices of the seam that a vertex goes by


def _mirrors(ob):
    """The Mirror modifiers behind the deformation's."""
    return [m for m in node_group.behind(ob) if m.type == 'MIRROR' and m.show_viewport]


def is_mirrored(ob, axis):
    """Whether a Mirror modifier makes the other half, so that the mesh has none of its own."""
    return any(m.use_axis[axis] for m in _mirrors(ob))


def _planes(ob):
    """(point, unit normal, distance within which vertices are merged) of each, in the object's own space."""
    for modifier in _mirrors(ob):
        if not (modifier.use_mirror_merge or modifier.use_clip):
            continue
        to_local = np.eye(4)
        if modifier.mirror_object:
            worlds = np.array([ob.matrix_world, modifier.mirror_object.matrix_world], np.float64)
            to_local = np.linalg.inv(worlds[0]) @ worlds[1]
        for axis in range(3):
            if modifier.use_axis[axis]:
                normal = np.linalg.inv(to_local[:3, :3])[axis]  # normals go by the inverse transpose
                # Blender merges what is twice as near, once on either side.
                yield to_local[:3, 3], normal / np.linalg.norm(normal), 0.5 * modifier.merge_threshold


def key(ob):
    """Equal keys, equal planes, but for rounding: where the mesh and the mirror's object are carried along."""
    return tuple((*np.round(point, 5).tolist(), *np.round(normal, 5).tolist(), distance)
                 for point, normal, distance in _planes(ob))


class Seam:
    """Of one plane: the vertices on it, and how much each vertex goes by which of them."""

    def __init__(self, ob, roles, plane):
        """roles: (n,) of the binding."""
        point, self._normal, distance = plane
        shape = start.shape_at_rest(ob).astype(np.float64)
        on_plane = np.abs((shape - point) @ self._normal) <= distance
        self._on_plane = np.flatnonzero(on_plane)
        if not len(self._on_plane):
            return
        # A handle on the plane is held by it, all others and what is fixed hold against it.
        across = np.unique(roles[on_plane & (roles >= 0)])
        held = ~on_plane & (roles != native.ROLE_FREE) & ~np.isin(roles, across)
        places, triangles, joined = shape.astype(np.float32), mesh_data.triangles(ob.data), split.Joined(ob)
        to_plane = joined.distances(places, triangles, on_plane).astype(np.float64)
        share = np.ones(len(shape))
        if held.any():
            to_held = joined.distances(places, triangles, held).astype(np.float64)
            with np.errstate(invalid='ignore', divide='ignore'):
                share = np.where(np.isfinite(to_held), to_held / (to_held + to_plane), 1.0)
        share[~np.isfinite(to_plane)] = 0
        share[held] = 0
        share[on_plane] = 1
        self._moved = np.flatnonzero(share)
        self._share = (share**2 * (3 - 2 * share))[self._moved]
        self._sources, self._weights = self._nearest(shape)

    def _nearest(self, shape):
        # In a box of unit size: the tree takes squares in single precision, which 1e20 leaves.
        shape = (shape - shape.min(axis=0)) / np.ptp(shape, axis=0).max()
        tree = kdtree.KDTree(len(self._on_plane))
        for number, vertex in enumerate(self._on_plane.tolist()):
            tree.insert(shape[vertex], number)
        tree.balance()
        count = min(_NEAREST, len(self._on_plane))
        sources, distances = np.empty((len(self._moved), count), int), np.empty((len(self._moved), count))
        for row, vertex in enumerate(self._moved.tolist()):
            for column, (_, number, distance) in enumerate(tree.find_n(shape[vertex], count)):
                sources[row, column], distances[row, column] = number, distance
        weights = 1 / np.maximum(distances, 1e-12 + 1e-6 * distances.max())**2
        return sources, weights / weights.sum(axis=1, keepdims=True)

    def close(self, offsets):
        """Takes out of (n, 3) offsets what leaves the plane."""
        if not len(self._on_plane):
            return
        left = offsets[self._on_plane] @ self._normal
        offsets[self._moved] -= np.outer(self._share * (left[self._sources] * self._weights).sum(1), self._normal)
        offsets[self._on_plane] -= np.outer(offsets[self._on_plane] @ self._normal, self._normal)


class Seams:
    """Of all planes of an object. roles: (n,) of the binding; None where nothing is held, as of a follower."""

    def __init__(self, ob, roles=None):
        self.key = key(ob)
        if roles is None:
            roles = np.full(len(ob.data.vertices), native.ROLE_FREE, np.int32)
        self._seams = [Seam(ob, roles, plane) for plane in _planes(ob)]

    def closed(self, offsets):
        """(3 n,) float32 offsets, with the seams closed."""
        result = offsets.reshape(-1, 3).astype(np.float64)
        for seam in self._seams:
            seam.close(result)
        return result.astype(np.float32).ravel()
