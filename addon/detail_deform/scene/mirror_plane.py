# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps vertices on the plane of a Mirror modifier on it, so that the seam between the halves stays closed.

Their displacement normal to the plane is subtracted, from the surrounding vertices too, with a weight that falls to 0
towards handles and fixed vertices."""

import numpy as np
from mathutils import kdtree

from ..library import native
from . import deform_modifier, mesh_data, split, start

# Seam vertices whose displacements, weighted by inverse squared distance, are averaged for another vertex. More are
# smoother along the seam, and slower to find.
_NEIGHBOURS = 4


def _mirrors(ob):
    """[modifier]: the shown Mirror modifiers after the deformation's."""
    return [m for m in deform_modifier.after(ob) if m.type == 'MIRROR' and m.show_viewport]


def is_mirrored(ob, axis):
    """Whether a Mirror modifier mirrors across this axis (0 to 2), so that the mesh itself is one half."""
    return any(m.use_axis[axis] for m in _mirrors(ob))


def _planes(ob):
    """Generator of (point, unit normal, distance up to which vertices count as on the plane) for each plane of the
    Mirror modifiers that merge or clip, in the object's local space."""
    for modifier in _mirrors(ob):
        if not (modifier.use_mirror_merge or modifier.use_clip):
            continue
        to_local = np.eye(4)
        if modifier.mirror_object:
            worlds = np.array([ob.matrix_world, modifier.mirror_object.matrix_world], np.float64)
            to_local = np.linalg.inv(worlds[0]) @ worlds[1]
        for axis in range(3):
            if modifier.use_axis[axis]:
                normal = np.linalg.inv(to_local[:3, :3])[axis]  # normals transform by the inverse transpose
                # Blender merges a vertex with its image, twice as far away as the plane.
                yield to_local[:3, 3], normal / np.linalg.norm(normal), 0.5 * modifier.merge_threshold


def signature(ob):
    """A hashable signature that is equal for equal planes up to rounding, as when mesh and mirror object move
    together."""
    return tuple((*np.round(point, 5).tolist(), *np.round(normal, 5).tolist(), distance)
                 for point, normal, distance in _planes(ob))


class Seam:
    """One plane: the vertices on it, and the weights by which other vertices take part in their correction."""

    def __init__(self, ob, roles, plane):
        """roles: (n,) of the binding. plane: of _planes()."""
        point, self._normal, distance = plane
        shape = start.undeformed_shape(ob).astype(np.float64)
        on_plane = np.abs((shape - point) @ self._normal) <= distance
        self._on_plane = np.flatnonzero(on_plane)
        if not len(self._on_plane):
            return
        # Handles with a vertex on the plane take part in the correction; all other handles and fixed vertices don't.
        across = np.unique(roles[on_plane & (roles >= 0)])
        held = ~on_plane & (roles != native.ROLE_FREE) & ~np.isin(roles, across)
        positions, triangles, welded = shape.astype(np.float32), mesh_data.triangles(ob.data), split.WeldedMesh(ob)
        to_plane = welded.distances(positions, triangles, on_plane).astype(np.float64)
        weights = np.ones(len(shape))
        if held.any():
            to_held = welded.distances(positions, triangles, held).astype(np.float64)
            with np.errstate(invalid='ignore', divide='ignore'):
                weights = np.where(np.isfinite(to_held), to_held / (to_held + to_plane), 1.0)
        weights[~np.isfinite(to_plane)] = 0
        weights[held] = 0
        weights[on_plane] = 1
        self._moved = np.flatnonzero(weights)
        self._fade = (weights**2 * (3 - 2 * weights))[self._moved]
        self._sources, self._weights = self._nearest(shape)

    def _nearest(self, shape):
        # Normalized to a unit box: the tree squares distances in single precision, which overflows from some 1e19 on.
        shape = (shape - shape.min(axis=0)) / np.ptp(shape, axis=0).max()
        tree = kdtree.KDTree(len(self._on_plane))
        for number, vertex in enumerate(self._on_plane.tolist()):
            tree.insert(shape[vertex], number)
        tree.balance()
        count = min(_NEIGHBOURS, len(self._on_plane))
        sources, distances = np.empty((len(self._moved), count), int), np.empty((len(self._moved), count))
        for row, vertex in enumerate(self._moved.tolist()):
            for column, (_, number, distance) in enumerate(tree.find_n(shape[vertex], count)):
                sources[row, column], distances[row, column] = number, distance
        weights = 1 / np.maximum(distances, 1e-12 + 1e-6 * distances.max())**2
        return sources, weights / weights.sum(axis=1, keepdims=True)

    def close(self, offsets):
        """Subtracts from offsets, (n, 3), in place, the displacement of the seam normal to the plane."""
        if not len(self._on_plane):
            return
        gap = offsets[self._on_plane] @ self._normal
        offsets[self._moved] -= np.outer(self._fade * (gap[self._sources] * self._weights).sum(1), self._normal)
        offsets[self._on_plane] -= np.outer(offsets[self._on_plane] @ self._normal, self._normal)


class Seams:
    """The seams at all planes of an object. roles: (n,) of the binding; None: all vertices are free, as on a mesh that
    follows a source."""

    def __init__(self, ob, roles=None):
        self.signature = signature(ob)
        if roles is None:
            roles = np.full(len(ob.data.vertices), native.ROLE_FREE, np.int32)
        self._seams = [Seam(ob, roles, plane) for plane in _planes(ob)]

    def closed(self, offsets):
        """(3 n,) float32: offsets with all seams closed."""
        result = offsets.reshape(-1, 3).astype(np.float64)
        for seam in self._seams:
            seam.close(result)
        return result.astype(np.float32).ravel()
