# SPDX-License-Identifier: GPL-3.0-or-later
"""Correspondences between the triangles of a source and a target."""

import numpy as np

from ..library.options import NEAREST
from . import mesh_data
from .mesh_data import MeshProblem


class Correspondence:
    """A correspondence between two meshes.

    source_triangles, target_triangles: (m, 3). pairs: (k, 2) indices of triangles, or of vertices, according to
    pairs_of; None where the topology is the same. confidence: (m,) in [0, 1], one a target triangle."""

    pairs_of = 'TRIANGLES'
    points = None  # per target vertex: a source triangle or -1, (n,), and barycentric weights, (n, 3)
    relative_transform = None  # with NEAREST: (4, 4) from the source's local space to the target's
    ambiguous = False  # whether another rotation of the source fits about as well
    mirrored = False  # whether the markers show the target to be the source's mirror image

    def __init__(self, source_triangles, target_triangles, pairs, confidence):
        self.source_triangles, self.target_triangles = source_triangles, target_triangles
        self.pairs, self.confidence = pairs, confidence

    @property
    def is_by_topology(self):
        return self.pairs is None and self.relative_transform is None


def check_source(source, target):
    """Raises MeshProblem where source and target can't be those of a transfer, or one is in Edit Mode."""
    if source is None or source.type != 'MESH':
        raise MeshProblem("There is no source: choose in Source the mesh object whose deformation should be carried "
                          "over.")
    if source == target:
        raise MeshProblem(f"'{target.name}' is both source and target: choose another source.")
    for ob in (source, target):
        mesh_data.check_left_edit_mode(ob)


def by_topology(source, target):
    """The identity correspondence of two meshes of the same topology. Raises MeshProblem where it differs."""
    counts = [(len(ob.data.vertices), len(ob.data.polygons)) for ob in (source, target)]
    is_same = mesh_data.is_same_topology(source.data, target.data)
    if not is_same and counts[0] != counts[1]:
        raise MeshProblem(
            f"'{source.name}' has {counts[0][0]:,} vertices and {counts[0][1]:,} faces, '{target.name}' "
            f"{counts[1][0]:,} and {counts[1][1]:,}: they are not of the same topology. Match them by Shape and "
            "Markers, or by a List.")
    if not is_same:
        raise MeshProblem(f"'{source.name}' has as many vertices and faces as '{target.name}', but its faces join "
                          "other vertices: they are not of the same topology. Match them by Shape and Markers, or by a "
                          "List.")
    triangles = mesh_data.triangles(target.data)
    return Correspondence(triangles, triangles, None, np.ones(len(triangles), np.float32))


def by_nearest(source, target):
    """A correspondence by nearest points, stored as the present placement of the source relative to the target. Raises
    MeshProblem where an object is scaled to 0, or their boxes are farther apart than the target's diagonal."""
    try:
        matrix = target.matrix_world.inverted() @ source.matrix_world
        matrix.inverted()
    except ValueError as error:
        raise MeshProblem(f"'{source.name}' or '{target.name}' is scaled to 0, so that none lies over the other: scale "
                          "them to a size first.") from error
    transform, positions = np.array(matrix, np.float64), [mesh_data.rest_positions(ob.data) for ob in (source, target)]
    if all(map(len, positions)):
        (low, high), (least, most) = ((each.min(0), each.max(0)) for each in (
            positions[0] @ transform[:3, :3].T + transform[:3, 3], positions[1]))
        if np.linalg.norm(np.maximum(0, np.maximum(least - high, low - most))) > np.linalg.norm(most - least):
            raise MeshProblem(f"'{target.name}' stands farther from '{source.name}' than it is large: put it where it "
                              "is worn, as both are without their modifiers and shape keys. What hovers on purpose: "
                              "make it a child of that object or of a bone.")
    return by_transform(source, target, transform)


def by_transform(source, target, transform):
    matched = Correspondence(mesh_data.triangles(source.data), mesh_data.triangles(target.data), None, None)
    matched.pairs_of, matched.relative_transform = NEAREST, transform
    return matched


def digest_of(matched):
    """A hash of a correspondence as short text."""
    by = matched.pairs if matched.relative_transform is None else matched.relative_transform
    points = ''.join(map(mesh_data.signature, matched.points or ()))
    return f"{matched.pairs_of}-{mesh_data.signature(by)}{points}"
