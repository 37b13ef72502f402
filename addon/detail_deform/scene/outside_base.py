# SPDX-License-Identifier: GPL-3.0-or-later
"""A base surface from outside: another object of the same topology, deformed by whatever it has."""

import bpy
import numpy as np

from . import handle_matrices, mesh_data, offset_attribute
from .mesh_data import MeshProblem


def _base_object(ob):
    base = ob.detail_deform.base_object
    if base is None:
        raise MeshProblem("There is no base object: choose the mesh object whose deformation the details "
                          "should follow, or let the base be computed.")
    if base == ob or base.type != 'MESH':
        raise MeshProblem(f"'{base.name}' can't be the base: choose another mesh object.")
    counts = [(len(m.vertices), len(m.polygons)) for m in (ob.data, base.data)]
    if counts[0] != counts[1]:
        raise MeshProblem(
            f"The base object '{base.name}' has {counts[1][0]:,} vertices and {counts[1][1]:,} faces, "
            f"'{ob.name}' has {counts[0][0]:,} and {counts[0][1]:,}: the base must be a copy with the "
            "same vertices and faces.")
    if mesh_data.topology_signature(ob.data) != mesh_data.topology_signature(base.data):
        raise MeshProblem(
            f"The base object '{base.name}' has as many vertices and faces as '{ob.name}', but its faces "
            "join other vertices: the base must be a copy with the same vertices and faces.")
    return base


def _moved(positions, matrix):
    return (positions @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)


def rest_positions(ob):
    """(n, 3) float32: the base object's own mesh, in the object's space as of the bind."""
    base = _base_object(ob)
    matrix = np.array(ob.detail_deform.base_rest_matrix, np.float64).reshape(4, 4)
    return _moved(mesh_data.positions(base.data), matrix)


def _place(ob, base, depsgraph):
    """(4, 4): from the base object's space to the object's, now."""
    world = handle_matrices.evaluated_world(base, depsgraph, "Base object")
    return handle_matrices.world_to_local(ob, depsgraph) @ world


def deformed_positions(ob, depsgraph):
    """(n, 3) float32: what the base object's modifiers make of it, in the object's space, now."""
    base = _base_object(ob)
    mesh = base.evaluated_get(depsgraph).data
    if len(mesh.vertices) != len(ob.data.vertices):
        raise MeshProblem(
            f"The modifiers of the base object '{base.name}' make {len(mesh.vertices):,} vertices of its "
            f"{len(base.data.vertices):,}: use only such that move vertices.")
    return _moved(mesh_data.positions(mesh), _place(ob, base, depsgraph))


def store_rest(ob, depsgraph, only_new):
    """Takes the base object's present place as rest; only_new: when there is none yet."""
    if only_new and any(ob.detail_deform.base_rest_matrix):
        return
    place = _place(ob, _base_object(ob), depsgraph)
    # As single precision, which is what is stored, on both sides.
    ob.detail_deform.base_rest_matrix = place.astype(np.float32).ravel().tolist()


def make(ob, positions):
    """A new object beside the given one with its mesh and vertex groups at other positions."""
    mesh = ob.data.copy()
    mesh.name = f"{ob.name} Base"
    offset_attribute.remove(mesh)
    base = bpy.data.objects.new(f"{ob.name} Base", mesh)
    if mesh.shape_keys:
        base.shape_key_clear()
    mesh.vertices.foreach_set('co', np.asarray(positions, np.float32).ravel())
    mesh.update()
    for collection in ob.users_collection or (bpy.context.scene.collection,):
        collection.objects.link(base)
    base.parent = ob.parent
    base.matrix_parent_inverse = ob.matrix_parent_inverse
    base.matrix_basis = ob.matrix_basis
    base.display_type = 'WIRE'
    base.hide_render = True
    return base
