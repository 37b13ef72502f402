# SPDX-License-Identifier: GPL-3.0-or-later
"""How the source of a transfer is deformed now."""

import numpy as np

from . import mesh_data, node_group, offset_attribute
from .mesh_data import MeshProblem

_MAKERS = {'SUBSURF', 'MULTIRES', 'MIRROR', 'ARRAY', 'SOLIDIFY', 'BEVEL', 'DECIMATE', 'REMESH', 'SKIN', 'SCREW',
           'BOOLEAN', 'BUILD', 'EDGE_SPLIT', 'MASK', 'TRIANGULATE', 'WELD', 'WIREFRAME', 'NODES'}


def evaluated_pose(source, depsgraph):
    """(n, 3) float32: what the source's modifiers and shape keys make of it now. Raises MeshProblem."""
    evaluated = source.evaluated_get(depsgraph)
    if not evaluated.is_evaluated or evaluated == source:
        raise MeshProblem(f"'{source.name}' is hidden by its monitor icon, or in an excluded collection, so that its "
                          "pose is not known: show it.")
    mesh = evaluated.data
    if len(mesh.vertices) != len(source.data.vertices):
        makers = [m.name for m in source.modifiers if m.show_viewport and m.type in _MAKERS]
        raise MeshProblem(
            f"The modifiers of '{source.name}' make {len(mesh.vertices):,} vertices of its "
            f"{len(source.data.vertices):,}: hide those that don't only move "
            f"vertices{', as ' + ', '.join(map(repr, makers)) if makers else ''}.")
    return mesh_data.positions(mesh) + _not_yet_shown(source, mesh)


def _not_yet_shown(source, mesh):
    """What Detail Deform has computed for the source itself since it was evaluated, as when it is bound or follows
    another mesh. Right where its modifier is the last that moves vertices."""
    modifier = node_group.find_modifier(source)
    if modifier is None or not modifier.show_viewport:
        return np.float32(0)
    change = offset_attribute.read(source.data) - offset_attribute.read(mesh)
    if not change.any():  # reading an influence group takes a while
        return np.float32(0)
    return (change * node_group.amount(source, modifier)).astype(np.float32)
