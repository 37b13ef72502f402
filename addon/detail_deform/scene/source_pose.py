# SPDX-License-Identifier: GPL-3.0-or-later
"""How the source of a transfer is deformed now."""

import numpy as np

from . import below, mesh_data, node_group, offset_attribute
from .mesh_data import MeshProblem


def evaluated_pose(source, depsgraph):
    """(n, 3) float32: what the source's modifiers and shape keys make of its own vertices now. Raises MeshProblem."""
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
        return mesh_data.positions(mesh) + _not_yet_shown(source, mesh, used)


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
