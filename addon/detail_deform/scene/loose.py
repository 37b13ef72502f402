# SPDX-License-Identifier: GPL-3.0-or-later
"""Loose vertices, which are in no face, such as whiskers and laces: deformation gradients don't reach them, so each is
carried by frames of faces. A component of loose edges is carried by the faces at its roots, the surface vertices that
it is attached to, with inverse-square distance weights if there are several; without roots, by the nearest face."""

import numpy as np
from mathutils.bvhtree import BVHTree

from . import components, mesh_data

# Roots of one component of loose edges; with more it is taken to lie along the surface, and each of its vertices is
# carried by the nearest face. It also bounds the time: each root takes a shortest-path search over the component.
_MAX_ROOTS = 16


class LooseVertices:
    """The loose vertices of a mesh at rest, and for each the faces that carry it."""

    def __init__(self, rest, triangles, edges, source_rest=None, chosen=None):
        """rest: (n, 3); triangles: (m, 3); edges: (e, 2). source_rest: (n, 3) of a transfer's source with the same
        topology, whose loose vertices' own motion is added. chosen: (n,) bool, restricts the loose vertices."""
        in_face = _in_faces(len(rest), triangles)
        self._vertices = np.flatnonzero(~in_face if chosen is None else ~in_face & chosen)
        if not len(triangles):
            self._vertices = self._vertices[:0]
        if not self:
            return
        rest = rest.astype(np.float64)
        rows, faces, weights = _anchors(rest, triangles, edges, in_face, self._vertices)
        self._rows, self._corners, self._weights = rows, triangles[faces], weights[:, None]
        self._has_area = _areas(rest, self._corners) > 0  # a face without area only translates
        self._own = _in_frames(self._frames(rest), rest[self._vertices[rows]])
        self._source = None
        if source_rest is not None:
            source_rest = source_rest.astype(np.float64)
            frames = self._frames(source_rest)
            sizes = [np.linalg.norm(np.ptp(shape[in_face], axis=0)) for shape in (rest, source_rest)]
            self._source = _in_frames(frames, source_rest[self._vertices[rows]]), sizes[0] / (sizes[1] or 1.0)

    def __bool__(self):
        return len(self._vertices) > 0

    def _frames(self, positions):
        """(centroids (k, 3), (k, 3, 3) orthonormal axes as columns: along the first edge, across, normal)."""
        a, b, c = np.moveaxis(positions.astype(np.float64)[self._corners], 1, 0)
        along = _unit(b - a)
        normal = _unit(np.cross(b - a, c - a))
        axes = np.stack([along, np.cross(normal, along), normal], axis=2)
        axes[~self._has_area] = np.eye(3)
        return (a + b + c) / 3, axes

    def place(self, positions, pose=None):
        """(n, 3) float32: positions, with the loose vertices placed by the frames of their faces. pose: (n, 3), the
        source's positions, if source_rest was given."""
        if not self:
            return positions
        frames = self._frames(positions)
        local = self._own
        if self._source is not None:
            source_own, size = self._source
            now = _in_frames(self._frames(pose), pose[self._vertices[self._rows]])
            local = local + size * (now - source_own)
        moved = frames[0] + np.einsum('kij,kj->ki', frames[1], local)
        sums = np.zeros((len(self._vertices), 3))
        np.add.at(sums, self._rows, self._weights * moved)
        positions = positions.copy()
        positions[self._vertices] = sums
        return positions


def roots(count, triangles, edges):
    """(count,) intp: for a loose vertex one of the roots of its component, -1 if that has none; for a vertex of a face
    itself."""
    in_face, result = _in_faces(count, triangles), np.arange(count)
    if in_face.all():
        return result
    result[~in_face] = -1
    at_root = in_face[edges].sum(axis=1) == 1
    parts = components.labels(count, edges[~mesh_data.touching(edges, in_face)])
    ones, ends = _sides(edges[at_root], in_face)
    of_part = np.full(count, -1)
    of_part[parts[ends]] = ones
    result[~in_face] = of_part[parts[~in_face]]
    return result


def _in_faces(count, triangles):
    result = np.zeros(count, bool)
    result[triangles] = True
    return result


def _areas(positions, corners):
    """(k,): twice the triangles' areas."""
    a, b, c = np.moveaxis(positions[corners], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1)


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None]


def _in_frames(frames, points):
    return np.einsum('kij,ki->kj', frames[1], points - frames[0])


def _anchors(rest, triangles, edges, in_face, vertices):
    """(rows, faces, weights): index into vertices, carrying face and weight. A vertex may have several rows; their
    weights add up to 1."""
    index_of = np.full(len(rest), -1)
    index_of[vertices] = np.arange(len(vertices))
    edges = edges[(in_face[edges] | (index_of[edges] >= 0)).all(axis=1)]
    parts = components.labels(len(vertices), index_of[edges[~mesh_data.touching(edges, in_face)]])
    at_root = in_face[edges].sum(axis=1) == 1
    roots, ends = _sides(edges[at_root], in_face)
    face_of = np.full(len(rest), -1)
    by_area = np.argsort(_areas(rest, triangles), kind='stable')  # the last assignment, the largest face, counts
    face_of[triangles[by_area]] = by_area[:, None]
    root_parts = parts[index_of[ends]]
    counts = np.bincount(np.unique(np.stack([root_parts, roots]), axis=1)[0].astype(int), minlength=len(vertices))
    follows_nearest_face = (counts[parts] == 0) | (counts[parts] > _MAX_ROOTS)
    rows, faces, weights = [np.flatnonzero(follows_nearest_face)], [
        _nearest_faces(rest, triangles, vertices[follows_nearest_face])], [np.ones(follows_nearest_face.sum())]
    dangling = np.flatnonzero((counts > 0) & (counts <= _MAX_ROOTS))
    dangles_from_one = counts[parts] == 1
    if dangles_from_one.any():
        only = np.full(len(vertices), -1)
        only[root_parts] = roots
        rows.append(np.flatnonzero(dangles_from_one))
        faces.append(face_of[only[parts[dangles_from_one]]])
        weights.append(np.ones(dangles_from_one.sum()))
    for part in dangling[counts[dangling] > 1]:
        of_part = np.flatnonzero(parts == part)
        each = np.unique(roots[root_parts == part])
        lengths = np.array([_path_lengths(rest, edges, np.append(vertices[of_part], root), root)[:-1] for root in each])
        fractions = 1 / np.maximum(lengths, 1e-12 * lengths.max(initial=1e-300))**2
        fractions /= fractions.sum(axis=0)
        rows.append(np.tile(of_part, len(each)))
        faces.append(np.repeat(face_of[each], len(of_part)))
        weights.append(fractions.ravel())
    return np.concatenate(rows), np.concatenate(faces), np.concatenate(weights)


def _sides(edges, in_face):
    """(vertices in faces, loose vertices): the two ends of edges between surface and loose vertices."""
    swapped = ~in_face[edges[:, 0]]
    return np.where(swapped, edges[:, 1], edges[:, 0]), np.where(swapped, edges[:, 0], edges[:, 1])


def _path_lengths(rest, edges, chosen, root):
    """(k,): shortest path length along edges from root to each chosen vertex (Bellman-Ford); 1e300 if unreachable."""
    index_of = np.full(len(rest), -1)
    index_of[chosen] = np.arange(len(chosen))
    ends = index_of[edges[(index_of[edges] >= 0).all(axis=1)]]
    points = rest[chosen]
    lengths = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    path_lengths = np.full(len(chosen), np.inf)
    path_lengths[index_of[root]] = 0
    while True:
        before = path_lengths.copy()
        np.minimum.at(path_lengths, ends[:, 1], before[ends[:, 0]] + lengths)
        np.minimum.at(path_lengths, ends[:, 0], before[ends[:, 1]] + lengths)
        if (path_lengths == before).all():
            return np.where(np.isfinite(path_lengths), path_lengths, 1e300)


def _nearest_faces(rest, triangles, vertices):
    if not len(vertices):
        return np.empty(0, int)
    # Normalized to a unit box, as the tree works in single precision.
    shift, size = rest.min(axis=0), np.ptp(rest, axis=0).max() or 1.0
    points = (rest - shift) / size
    tree = BVHTree.FromPolygons(points.tolist(), triangles.tolist())
    found = (tree.find_nearest(point)[2] for point in points[vertices].tolist())
    return np.array([0 if face is None else face for face in found])
