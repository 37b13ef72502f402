# SPDX-License-Identifier: GPL-3.0-or-later
"""A transfer's source whose modifiers add surface to its own mesh, as a body that is modelled as a half. The mirrored
half is part of the source, so what lies over it follows it. Surface added by other modifiers is not followed, and users
are told where a target lies over it."""

import numpy as np
from mathutils.bvhtree import BVHTree

from . import deform_modifier, mesh_data, partial_evaluation

_COPIERS = {'ARRAY', 'SCREW', 'NODES'}  # add surface whose correspondence to the source's vertices is unknown
_SAMPLES = 500  # vertices of the target that are tested; bounds the time
_NOTABLE_FRACTION = 0.02  # fraction of the samples that must lie over unfollowed surface for a message
# Ratio of distances: a sample lies over unfollowed surface if that is less than half as far as the followed one.
_MUCH_NEARER = 0.5


def reflections(source):
    """[((4, 4), merge distance or -1)]: the reflections of the shown Mirror modifiers in Blender's order of axes.
    Modifiers that bisect the mesh are left out, as it may have both halves."""
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


def signature(source):
    """A hash of the rounded reflections as short text; '' without any."""
    found = reflections(source)
    return mesh_data.signature(np.round([[*flip.ravel(), near] for flip, near in found], 5)) if found else ""


class MirroredSource:
    """A source's own vertices followed by the mirrored ones, in Blender's order."""

    def __init__(self, source):
        rest, triangles = mesh_data.rest_positions(source.data).astype(np.float64), mesh_data.triangles(source.data)
        own, copies, of_copy = np.arange(len(rest)), [np.eye(4)], np.zeros(len(rest), int)
        for flip, merge_distance in reflections(source):
            reflected = rest @ flip[:3, :3].T + flip[:3, 3]
            is_separate = np.linalg.norm(reflected - rest, axis=1) >= merge_distance
            new_indices = np.where(is_separate, len(rest) + np.cumsum(is_separate) - 1, np.arange(len(rest)))
            mirrored = new_indices[triangles[mesh_data.touching(triangles, is_separate)]][:, ::-1]
            triangles = np.concatenate([triangles, mirrored])
            rest = np.concatenate([rest, reflected[is_separate]])
            own, of_copy = np.concatenate([own, own[is_separate]]), np.concatenate(
                [of_copy, of_copy[is_separate] + len(copies)])
            copies += [flip @ copy for copy in copies]
        self.triangles, self.count = np.ascontiguousarray(triangles, np.int32), len(rest)
        self._copies, self._own_count = copies[1:], len(source.data.vertices)
        self._own = [own[of_copy == number] for number in range(1, len(copies))]
        self._rows = [np.flatnonzero(of_copy == number) for number in range(1, len(copies))]

    def with_reflections(self, points):
        """(m, 3) float32: points of the source's own vertices, (n, 3), with their reflections; (m, 3) is returned as it
        is."""
        if len(points) == self.count:
            return points
        result = np.empty((self.count, 3), np.float32)
        result[:self._own_count] = points
        for copy, own, rows in zip(self._copies, self._own, self._rows):
            result[rows] = points[own] @ copy[:3, :3].T + copy[:3, 3]
        return result

    def posed_with_reflections(self, source, pose, used, depsgraph):
        """(m, 3) float32: with_reflections() a pose, (n, 3). If modifiers after Mirror, such as an armature, pose each
        half differently, they are evaluated on both halves. used: (k,) bool, the modifiers that produced the pose."""
        mirrors = [m.type == 'MIRROR' and m.show_viewport for m in source.modifiers]
        if True not in mirrors or not any(used[mirrors.index(True):]):
            return self.with_reflections(pose)  # also if Mirror has been hidden since: signature() notices that later
        found = partial_evaluation.positions_with(source, depsgraph, np.array(used) | np.array(mirrors), self.count)
        if found is None:  # in this pose Mirror merges other vertices than at rest
            return self.with_reflections(pose)
        found[:self._own_count] = pose
        return found


def find(source):
    """The MirroredSource; None if no Mirror modifier adds surface."""
    return MirroredSource(source) if reflections(source) else None


def unfollowed(source, followed, points, depsgraph):
    """A sentence where the target lies over surface of the source that is not followed, or ''. followed: (positions,
    triangles) at rest. points: (n, 3) of the target at rest, in the source's local space."""
    own = deform_modifier.find(source)
    copiers = [m.show_viewport and m.type in _COPIERS and m != own for m in source.modifiers]
    if not any(copiers) or not len(points):
        return ""
    shown = [use or (m.type == 'MIRROR' and m.show_viewport) for use, m in zip(copiers, source.modifiers)]
    some = points[np.linspace(0, len(points) - 1, min(_SAMPLES, len(points))).astype(int)].tolist()
    followed_distances, all_distances = (_distances(some, *surface) for surface in (
        followed, partial_evaluation.surface_with(source, depsgraph, shown)))
    if (all_distances < _MUCH_NEARER * followed_distances).mean() < _NOTABLE_FRACTION:
        return ""
    names = ', '.join(repr(m.name) for m, use in zip(source.modifiers, copiers) if use)
    return (f"What {names} of '{source.name}' adds to its own mesh is not followed, and this mesh lies over some of "
            "it: apply it first, or the nearest of the rest counts.")


def _distances(points, positions, triangles):
    tree = BVHTree.FromPolygons(positions.tolist(), triangles.tolist())
    found = (tree.find_nearest(point)[3] for point in points)
    return np.array([np.inf if distance is None else distance for distance in found])
