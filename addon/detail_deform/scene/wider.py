# SPDX-License-Identifier: GPL-3.0-or-later
"""A source whose modifiers show more surface than its own mesh has, as a body that is modelled as a half: what lies
over the mirrored half goes with that. Mirror is followed whole; what others make is not, and said where it matters."""

import numpy as np
from mathutils.bvhtree import BVHTree

from . import below, mesh_data, node_group

_COPIERS = {'ARRAY', 'SCREW', 'NODES'}  # of which it isn't known what they make of which vertex
_SAMPLES = 500  # of a target's vertices
_MANY = 0.02  # of these, to be worth a word
_NEARER = 0.5  # of how far the source's own surface is


def reflections(source):
    """[((4, 4), distance within which it merges vertices)] of its Mirror modifiers, axis by axis as Blender goes; of
    one that cuts the mesh at the plane nothing, as the mesh may have both halves."""
    found = []
    for modifier in source.modifiers:
        if modifier.type != 'MIRROR' or not modifier.show_viewport or any(modifier.use_bisect_axis):
            continue
        space = np.eye(4)
        if modifier.mirror_object:
            worlds = np.array([source.matrix_world, modifier.mirror_object.matrix_world], np.float64)
            if not np.linalg.det(worlds[0]) or not np.linalg.det(worlds[1]):
                continue
            space = np.linalg.inv(worlds[0]) @ worlds[1]
        for axis in np.flatnonzero(modifier.use_axis):
            flip = np.eye(4)
            flip[axis, axis] = -1
            found.append((space @ flip @ np.linalg.inv(space),
                          modifier.merge_threshold if modifier.use_mirror_merge else -1.0))
    return found


def key(source):
    """A short text: equal texts, equal reflections, but for rounding."""
    found = reflections(source)
    return mesh_data.signature(np.round([[*flip.ravel(), near] for flip, near in found], 5)) if found else ""


class Wider:
    """A source's own vertices, and behind them the mirrored ones, in the order that Blender gives them."""

    def __init__(self, source):
        rest, triangles = mesh_data.rest(source.data).astype(np.float64), mesh_data.triangles(source.data)
        own, copies, of_copy = np.arange(len(rest)), [np.eye(4)], np.zeros(len(rest), int)
        for flip, near in reflections(source):
            there = rest @ flip[:3, :3].T + flip[:3, 3]
            kept = np.linalg.norm(there - rest, axis=1) >= near
            numbers = np.where(kept, len(rest) + np.cumsum(kept) - 1, np.arange(len(rest)))
            mirrored = numbers[triangles[kept[triangles].any(axis=1)]][:, ::-1]
            triangles = np.concatenate([triangles, mirrored])
            rest = np.concatenate([rest, there[kept]])
            own, of_copy = np.concatenate([own, own[kept]]), np.concatenate([of_copy, of_copy[kept] + len(copies)])
            copies += [flip @ copy for copy in copies]
        self.triangles, self.count = np.ascontiguousarray(triangles, np.int32), len(rest)
        self._copies, self._own_count = copies[1:], len(source.data.vertices)
        self._own = [own[of_copy == number] for number in range(1, len(copies))]
        self._rows = [np.flatnonzero(of_copy == number) for number in range(1, len(copies))]

    def of(self, points):
        """(m, 3) float32 of (n, 3) of the source's own vertices; such as have more rows have been made wider."""
        if len(points) == self.count:
            return points
        result = np.empty((self.count, 3), np.float32)
        result[:self._own_count] = points
        for copy, own, rows in zip(self._copies, self._own, self._rows):
            result[rows] = points[own] @ copy[:3, :3].T + copy[:3, 3]
        return result

    def posed(self, source, pose, used, depsgraph):
        """The same of a pose: where an armature comes behind Mirror, each half has one of its own. used: (k,) bool, the
        modifiers that made the pose."""
        mirrors = [m.type == 'MIRROR' and m.show_viewport for m in source.modifiers]
        if True not in mirrors or not any(used[mirrors.index(True):]):
            return self.of(pose)  # also where Mirror is hidden now, which is compared a little later
        found = below.by(source, depsgraph, np.array(used) | np.array(mirrors), self.count)
        if found is None:  # other vertices are merged in the pose
            return self.of(pose)
        found[:self._own_count] = pose
        return found


def find(source):
    """Its Wider, or None where its own mesh is all that is mirrored."""
    return Wider(source) if reflections(source) else None


def unfollowed(source, followed, points, depsgraph):
    """What the source's modifiers show beside what is followed, where a target lies over that: a sentence, or ''.
    followed: (positions, triangles) at rest. points: (n, 3) of the target at rest, in the source's space."""
    own = node_group.find_modifier(source)
    copiers = [m.show_viewport and m.type in _COPIERS and m != own for m in source.modifiers]
    if not any(copiers) or not len(points):
        return ""
    shown = [use or (m.type == 'MIRROR' and m.show_viewport) for use, m in zip(copiers, source.modifiers)]
    some = points[np.linspace(0, len(points) - 1, min(_SAMPLES, len(points))).astype(int)].tolist()
    away, nearer = (_distances(some, *surface) for surface in (followed, below.surface(source, depsgraph, shown)))
    if (nearer < _NEARER * away).mean() < _MANY:
        return ""
    names = ', '.join(repr(m.name) for m, use in zip(source.modifiers, copiers) if use)
    return (f"What {names} of '{source.name}' adds to its own mesh is not followed, and this mesh lies over some of "
            "it: apply it first, or the nearest of the rest counts.")


def _distances(points, positions, triangles):
    tree = BVHTree.FromPolygons(positions.tolist(), triangles.tolist())
    found = (tree.find_nearest(point)[3] for point in points)
    return np.array([np.inf if distance is None else distance for distance in found])
