# SPDX-License-Identifier: GPL-3.0-or-later
"""How the source of a transfer is deformed now."""

import numpy as np

from . import below, mesh_data, node_group, offset_attribute
from .mesh_data import MeshProblem


# Of the mesh's size: farther from rest no pose goes, and one vertex there would move all of the target.
_FARTHEST = 1e6


def check_extent(source, pose):
    """pose: (n, 3) of the source's own vertices. Raises MeshProblem where one of them is out of all bounds."""
    some = mesh_data.some_of_rest(source.data)
    # The mesh is as large as these at least, and reaches no farther than they do and its size: nearly always enough,
    # and a hundredth of the time for the whole rest, which a frame has not.
    reach = np.abs(pose).max(initial=0) + np.abs(some).max(initial=0)
    if reach <= (_FARTHEST - 1) * np.ptp(some, axis=0).max(initial=0):
        return
    rest = mesh_data.rest(source.data)
    moved = np.abs(pose - rest)
    size = np.ptp(rest, axis=0).max(initial=0)
    if moved.max(initial=0) > _FARTHEST * size > 0:  # what is no number is told by the library
        vertex, axis = np.unravel_index(moved.argmax(), moved.shape)
        times = moved[vertex, axis] / size
        raise MeshProblem(f"Vertex {vertex} of '{source.name}' is {times:.0e} times the mesh's size from where it is "
                          "at rest: correct its position.")


def evaluated_pose(source, depsgraph, wide=None):
    """(n, 3) float32: what the source's modifiers and shape keys make of its own vertices now. wide: its wider.Wider,
    of all of whose vertices then. Raises MeshProblem."""
    evaluated = source.evaluated_get(depsgraph)
    if not evaluated.is_evaluated or evaluated == source:
        raise MeshProblem(f"'{source.name}' is hidden by its monitor icon, or in an excluded collection, so that its "
                          "pose is not known: show it.")
    with below.deformed(source, evaluated, depsgraph) as (mesh, used):
        if mesh is None:
            raise MeshProblem(
                f"The modifiers of '{source.name}' make {len(evaluated.data.vertices):,} vertices of its "
                f"{len(source.data.vertices):,} in a way that can't be followed: hide those that don't only move "
                "vertices.")
        pose = mesh_data.positions(mesh) + _not_yet_shown(source, mesh, used)
    check_extent(source, pose)
    return pose if wide is None else wide.posed(source, pose, used, depsgraph)


def _not_yet_shown(source, mesh, used):
    """What Detail Deform has computed for the source itself since it was evaluated, as when it is bound or follows
    another mesh. Right where its modifier is the last that moves vertices. used: which modifiers made the mesh."""
    modifier = node_group.find_modifier(source)
    if modifier is None or not used[list(source.modifiers).index(modifier)]:
        return np.float32(0)
    change = offset_attribute.read(source.data) - offset_attribute.read(mesh)
    if not change.any():  # reading an influence group takes a while
        return np.float32(0)
    return (change * node_group.amount(source, modifier)).astype(np.float32)
