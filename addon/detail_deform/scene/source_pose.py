# SPDX-License-Identifier: GPL-3.0-or-later
"""The present pose of the source of a transfer."""

import numpy as np

from . import deform_modifier, display_key, mesh_data, offset_attribute, partial_evaluation
from .mesh_data import MeshProblem


# Multiple of the mesh's largest extent: a vertex displaced farther is refused. Safety: a single such vertex would
# displace the whole target.
_FARTHEST = 1e6


def check_extent(source, pose):
    """Raises MeshProblem where a vertex of pose, (n, 3) of the source's own vertices, is farther than _FARTHEST from
    rest."""
    some = mesh_data.sample_rest_positions(source.data)
    # A sufficient bound from a few points, as the mesh's size is at least theirs, and each rest point is within the
    # mesh's size of them. It nearly always decides, in a hundredth of the time of reading the whole rest in each frame.
    reach = np.abs(pose).max(initial=0) + np.abs(some).max(initial=0)
    if reach <= (_FARTHEST - 1) * np.ptp(some, axis=0).max(initial=0):
        return
    rest = mesh_data.rest_positions(source.data)
    moved = np.abs(pose - rest)
    size = np.ptp(rest, axis=0).max(initial=0)
    if moved.max(initial=0) > _FARTHEST * size > 0:  # NaN passes here: the library reports it
        vertex, axis = np.unravel_index(moved.argmax(), moved.shape)
        times = moved[vertex, axis] / size
        raise MeshProblem(f"Vertex {vertex} of '{source.name}' is {times:.0e} times the mesh's size from where it is "
                          "at rest: correct its position.")


def evaluated_pose(source, depsgraph, wide=None):
    """(n, 3) float32: present positions of the source's own vertices by its modifiers and shape keys. wide: the
    source's mirrored_source.MirroredSource, if any: then of the mirrored vertices too. Raises MeshProblem."""
    evaluated = source.evaluated_get(depsgraph)
    if not evaluated.is_evaluated or evaluated == source:
        raise MeshProblem(f"'{source.name}' is hidden by its monitor icon, or in an excluded collection, so that its "
                          "pose is not known: show it.")
    with partial_evaluation.deformed(source, evaluated, depsgraph) as (mesh, used):
        if mesh is None:
            raise MeshProblem(
                f"The modifiers of '{source.name}' make {len(evaluated.data.vertices):,} vertices of its "
                f"{len(source.data.vertices):,} in a way that can't be followed: hide those that don't only move "
                "vertices.")
        pose = mesh_data.positions(mesh) + _not_yet_shown(source, mesh, used)
    check_extent(source, pose)
    return pose if wide is None else wide.posed_with_reflections(source, pose, used, depsgraph)


def _not_yet_shown(source, mesh, used):
    """(n, 3) float32, or 0: change of the source's own displayed offsets since it was evaluated, if it is itself bound
    or a follower. Exact if the deformation's modifier is the last that moves vertices. used: (k,) bool, the modifiers
    that produced mesh."""
    modifier = deform_modifier.find(source)
    by_key = display_key.find(source.data) is not None
    if modifier is None or not (by_key or used[list(source.modifiers).index(modifier)]):
        return np.float32(0)
    change = offset_attribute.read(source.data) - offset_attribute.read(mesh)
    if not change.any():  # before amount(), which is slow with an influence group
        return np.float32(0)
    return (change * deform_modifier.display_weights(source, modifier)).astype(np.float32)
