# SPDX-License-Identifier: GPL-3.0-or-later
"""An outside base surface: another object, deformed by its modifiers, edits or any other means. A base with the mesh's
own topology corresponds vertex by vertex, a proxy of another topology by nearest points."""

import bmesh
import bpy
import numpy as np

from . import display_key, mesh_data, offset_attribute, partial_evaluation, start, world_transforms
from .mesh_data import MeshProblem


_MAX_EDITED = 50_000  # vertices of a cage that is followed in Edit Mode: reading them one by one takes 20 ms a frame


def _base_object(ob):
    base = ob.detail_deform.base_object
    if base is None:
        raise MeshProblem("There is no base object: choose in Base Object the mesh object whose deformation the "
                          "details should follow, or set Base to Computed.")
    if base == ob or base.type != 'MESH':
        raise MeshProblem(f"'{base.name}' can't be the base: choose another mesh object.")
    if not base.data.polygons:
        raise MeshProblem(f"The base object '{base.name}' has no faces: choose a mesh whose faces lie near "
                          f"'{ob.name}'.")
    return base


def _transformed(positions, matrix):
    return (positions @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)


def rest(ob):
    """{'base', 'base_triangles'}: arguments of native.Bind for the base at rest, in the object's local space at Bind:
    the stored rest mesh, or the base's own where that was deleted. base_triangles only if the base is no copy of the
    mesh, vertex for vertex and face for face."""
    base, rest_mesh = _base_object(ob), ob.detail_deform.base_rest_mesh
    if rest_mesh:
        found = {'base': mesh_data.positions(rest_mesh)}
        mesh = rest_mesh
    else:
        matrix = np.array(ob.detail_deform.base_rest_matrix, np.float64).reshape(4, 4)
        found = {'base': _transformed(mesh_data.positions(base.data), matrix)}
        mesh = base.data
    if ob.detail_deform.base_rest_made or not mesh_data.is_copy(ob.data, mesh):
        found['base_triangles'] = mesh_data.triangles(mesh)
    return found


def transform(ob, depsgraph):
    """(4, 4): from the base object's present local space to the object's."""
    world = world_transforms.evaluated_world(_base_object(ob), depsgraph, "Base object")
    return world_transforms.world_to_local(ob, depsgraph) @ world


def deformed_positions(ob, depsgraph):
    """(n, 3) float32: the base's present deformed positions in the object's local space. With all of its modifiers if
    their result was stored as rest at Bind, otherwise without those that change the vertex count. Raises
    MeshProblem."""
    base, rest_mesh = _base_object(ob), ob.detail_deform.base_rest_mesh
    evaluated = base.evaluated_get(depsgraph)
    if rest_mesh and ob.detail_deform.base_rest_made:
        if base.mode == 'EDIT' and not len(evaluated.data.vertices):
            raise MeshProblem(f"The base object '{base.name}' is in Edit Mode: leave it (Tab) to go on.")
        _check_count(base, len(evaluated.data.vertices), len(rest_mesh.vertices))
        return _transformed(mesh_data.positions(evaluated.data), transform(ob, depsgraph))
    edited = _edited_positions(base)
    if edited is None:
        with partial_evaluation.deformed(base, evaluated, depsgraph) as (mesh, _):
            if mesh is None:
                _check_count(base, len(evaluated.data.vertices), len(base.data.vertices))
            edited = mesh_data.positions(mesh)
    if rest_mesh and len(edited) != len(rest_mesh.vertices):
        raise MeshProblem(f"The base object '{base.name}' has {len(edited):,} vertices, and had "
                          f"{len(rest_mesh.vertices):,} when it was bound: press Re-bind to take it as it is.")
    return _transformed(edited, transform(ob, depsgraph))


def _edited_positions(base):
    """(n, 3) float32: positions of a base in Edit Mode that no modifier moves; None for others, and for more than
    _MAX_EDITED vertices, which are read one by one."""
    if base.mode != 'EDIT' or len(base.data.vertices) > _MAX_EDITED or any(
            m.show_viewport and m.type in partial_evaluation.MOVERS for m in base.modifiers):
        return None
    mesh = bmesh.from_edit_mesh(base.data)
    return np.array([vertex.co for vertex in mesh.verts], np.float32).reshape(-1, 3)


def _check_count(base, made, bound):
    if made != bound:
        raise MeshProblem(
            f"The modifiers of the base object '{base.name}' make {made:,} vertices, but {bound:,} were there when it "
            "was bound: press Re-bind, or use only modifiers that make the same vertices in each frame.")


def store_rest(ob, depsgraph, only_new):
    """Stores the base's present place and mesh as rest; only_new: unless a rest that still fits is stored. The stored
    mesh is the base's own, so that edits of it deform. If its modifiers change the vertex count, alike in renders, it
    is their present result, as the own mesh is not comparable with later ones."""
    settings, base = ob.detail_deform, _base_object(ob)
    mesh = base.evaluated_get(depsgraph).data
    # Where renders have other vertices, the base is followed without the modifiers that change the count.
    makes_vertices = (len(mesh.vertices) != len(base.data.vertices)
                      and not partial_evaluation.differs_in_renders(base, depsgraph.scene))
    if only_new and any(settings.base_rest_matrix):
        rest_mesh, count = settings.base_rest_mesh, len(mesh.vertices if makes_vertices else base.data.vertices)
        if rest_mesh and settings.base_rest_made == makes_vertices and len(rest_mesh.vertices) == count:
            return
        if not rest_mesh and not makes_vertices:
            _store_rest_mesh(settings, base, base.data,
                             np.array(settings.base_rest_matrix, np.float64).reshape(4, 4), False)
            return
    if makes_vertices and not mesh.polygons:
        raise MeshProblem(f"The modifiers of the base object '{base.name}' leave no faces to follow.")
    present = transform(ob, depsgraph)
    # Rounded to the single precision in which it is stored, so that both are the same.
    settings.base_rest_matrix = present = present.astype(np.float32).ravel().tolist()
    forget_rest_mesh(settings)
    _store_rest_mesh(settings, base, mesh if makes_vertices else base.data, np.array(present).reshape(4, 4),
                     makes_vertices)


def _store_rest_mesh(settings, base, mesh, matrix, is_made):
    """Stores a copy of mesh as the base's rest. matrix: from the base's local space to the object's. is_made: whether
    mesh is the result of modifiers."""
    settings.base_rest_mesh = _mesh_like(f"{base.name} Rest", mesh, _transformed(mesh_data.positions(mesh), matrix))
    settings.base_rest_made = is_made


def _mesh_like(name, mesh, positions):
    """A new mesh with the faces of mesh and its vertices at positions, (n, 3), without any other data."""
    corners, begins = mesh_data.faces(mesh)
    made = bpy.data.meshes.new(name)
    made.vertices.add(len(positions))
    made.loops.add(len(corners))
    made.polygons.add(len(begins))
    made.vertices.foreach_set('co', np.asarray(positions, np.float32).ravel())
    made.loops.foreach_set('vertex_index', corners)
    made.polygons.foreach_set('loop_start', begins)
    if bpy.app.version < (4, 0):  # from 4.0 on it is derived
        made.polygons.foreach_set('loop_total', np.diff(begins, append=len(corners)))
    made.update(calc_edges=True)
    return made


def forget_rest(settings):
    """Removes the stored rest of the base; the next Bind stores a new one."""
    settings.property_unset('base_rest_matrix')
    forget_rest_mesh(settings)


def forget_rest_mesh(settings):
    """Removes the stored rest mesh, unless a copy of the object uses it."""
    rest_mesh = settings.base_rest_mesh
    settings.base_rest_mesh = None
    settings.property_unset('base_rest_made')
    if rest_mesh and not rest_mesh.users:
        bpy.data.meshes.remove(rest_mesh)


def make(ob, positions):
    """A new base object with a copy of the object's mesh at positions, (n, 3), in the same collections and place."""
    mesh = ob.data.copy()
    mesh.name = f"{ob.name} Base"
    offset_attribute.remove(mesh)
    display_key.forget(mesh)
    start.forget(mesh)
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
