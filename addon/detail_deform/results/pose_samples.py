# SPDX-License-Identifier: GPL-3.0-or-later
"""Distances between poses, from so few sample points that a thousand poses of a heavy mesh fit into memory."""

import numpy as np

from ..scene import mesh_data

_MAX_POINTS = 2000  # of a pose
_MAX_POINTS_OF_ALL = 4_000_000  # of all poses together: 48 MB; a pose has 50 at least


class Samples:
    """Sample points, spread evenly over the surface, in up to count poses."""

    def __init__(self, ob, count):
        self._vertices = _spread(ob.data, min(_MAX_POINTS, max(50, _MAX_POINTS_OF_ALL // max(count, 1))))
        self._poses = np.empty((count, len(self._vertices), 3), np.float32)
        self.count = 0

    def add(self, positions):
        """Adds a pose. positions: (n, 3), of all vertices."""
        points = positions[self._vertices]
        self._poses[self.count] = points - points.mean(axis=0)
        self.count += 1

    def distances(self, number):
        """(count,) float64: root mean square distance of each pose from this one, after the best rigid alignment
        (Kabsch). With H = Σ p qᵀ about the centres, min over rotations of Σ |R p − q|² is Σ |p|² + |q|² − 2 tr(Σ'). Σ'
        are the singular values of H, the last one negated if det H < 0."""
        other = self._poses[number].astype(np.float64)
        result = np.empty(self.count)
        for begin in range(0, self.count, 64):
            part = self._poses[begin:min(begin + 64, self.count)].astype(np.float64)
            across = part.transpose(0, 2, 1) @ other
            values = np.linalg.svd(across, compute_uv=False)
            values[:, 2] *= np.sign(np.linalg.det(across))
            squares = (part ** 2).sum(axis=(1, 2)) + (other ** 2).sum() - 2 * values.sum(axis=1)
            result[begin:begin + len(part)] = np.sqrt(np.maximum(squares, 0) / len(other))
        return result

    def farthest(self, count, least):
        """Farthest point sampling: indices of count poses, each the farthest from those before and from pose 0, which
        is not among them. Fewer if all others are nearer than least."""
        found, nearest = [], self.distances(0)
        while len(found) < count and nearest.max(initial=0) > least:
            found.append(int(nearest.argmax()))
            nearest = np.minimum(nearest, self.distances(found[-1]))
        return found


def _spread(mesh, count):
    """Indices of vertices, spread evenly by area, whatever the sizes of faces; at most count."""
    areas = np.empty(len(mesh.polygons), np.float32)
    mesh.polygons.foreach_get('area', areas)
    if len(mesh.vertices) <= count or not areas.sum() > 0:
        return np.arange(len(mesh.vertices))[::max(1, -(-len(mesh.vertices) // count))]
    corners, starts = mesh_data.faces(mesh)
    below = np.cumsum(areas, dtype=np.float64)
    chosen = np.searchsorted(below, (np.arange(count) + 0.5) / count * below[-1])
    return np.unique(corners[starts[chosen]])


def size(ob):
    """The diagonal of the mesh's bounding box at rest."""
    return float(np.linalg.norm(np.ptp(mesh_data.rest_positions(ob.data), axis=0))) if len(ob.data.vertices) else 0.0
