# SPDX-License-Identifier: GPL-3.0-or-later
"""Selection of objects and of vertices in Edit Mode, and vertex groups made of selections."""

from contextlib import contextmanager

import bmesh
import bpy
import numpy as np

from . import components
from .mesh_data import MeshProblem


def activate(context, ob):
    """Selects this object alone and makes it active."""
    for other in context.selected_objects:
        other.select_set(False)
    ob.select_set(True)
    context.view_layer.objects.active = ob


def change_mode(ob, mode):
    """Changes the mode of the active object. Raises MeshProblem where Blender can't."""
    if ob.hide_viewport and ob.mode != 'EDIT':
        raise MeshProblem(f"'{ob.name}' is disabled in viewports, where Blender changes no mode: enable it first, by "
                          "its monitor icon.")
    bpy.ops.object.mode_set(mode=mode)


@contextmanager
def object_mode(ob):
    """Context manager that leaves the active object's mode for Object Mode: other modes work on a copy of the mesh, and
    would overwrite changes."""
    mode = ob.mode
    if mode != 'OBJECT':
        change_mode(ob, 'OBJECT')
    try:
        yield
    finally:
        if mode != 'OBJECT':
            change_mode(ob, mode)


def go_to(context, ob, other):
    """Puts ob into Object Mode, then selects other alone. Raises MeshProblem."""
    if other.name not in context.view_layer.objects:
        raise MeshProblem(f"'{other.name}' is not in this scene, or is in an excluded collection.")
    if ob.mode != 'OBJECT':
        change_mode(ob, 'OBJECT')
    activate(context, other)


def selected(ob):
    """(n,) bool: the vertices selected in Edit Mode."""
    ob.update_from_editmode()
    chosen = np.empty(len(ob.data.vertices), bool)
    ob.data.vertices.foreach_get('select', chosen)
    return chosen


def select(ob, members, extend, hidden=False):
    """Selects vertices in Edit Mode, which is entered if necessary. members: (n,) bool. extend: keeps the present
    selection. hidden: reveals and selects hidden ones too; otherwise they are skipped. Raises MeshProblem."""
    if ob.mode != 'EDIT':
        change_mode(ob, 'EDIT')
    mesh = bmesh.from_edit_mesh(ob.data)
    if not extend:
        for element in (*mesh.faces, *mesh.edges, *mesh.verts):
            element.select = False
    mesh.verts.ensure_lookup_table()
    for vertex in np.flatnonzero(members).tolist():
        if hidden:
            mesh.verts[vertex].hide_set(False)
        if not mesh.verts[vertex].hide:
            mesh.verts[vertex].select = True
    mesh.select_mode |= {'VERT'}
    # Not context.tool_settings: until 4.3, reading it makes this scene the owner of `bpy.context` itself. Once
    # the scene is gone, a script that sets something in bpy.context.window writes into freed memory.
    bpy.context.scene.tool_settings.mesh_select_mode[0] = True
    mesh.select_flush_mode()
    bmesh.update_edit_mesh(ob.data, loop_triangles=False, destructive=False)


def fill_group(ob, group, members):
    """Makes exactly these vertices members of the group, with weight 1. members: (n,) bool."""
    if ob.mode != 'EDIT':
        group.remove(range(len(members)))
    else:
        mesh = bmesh.from_edit_mesh(ob.data)
        weights, index = mesh.verts.layers.deform.verify(), group.index
        for vertex in mesh.verts:
            if index in vertex[weights]:
                del vertex[weights][index]
    _add(ob, [group], [np.flatnonzero(members)])


def _add(ob, groups, parts):
    """Adds to each group the array of vertices in parts, with weight 1."""
    if ob.mode != 'EDIT':
        for group, part in zip(groups, parts):
            group.add(part.tolist(), 1.0, 'REPLACE')
        return
    # Through the BMesh, as leaving Edit Mode would take other objects out of it too.
    mesh = bmesh.from_edit_mesh(ob.data)
    weights = mesh.verts.layers.deform.verify()
    mesh.verts.ensure_lookup_table()
    for group, part in zip(groups, parts):
        for vertex in part.tolist():
            mesh.verts[vertex][weights][group.index] = 1.0
    bmesh.update_edit_mesh(ob.data, loop_triangles=False, destructive=False)
    ob.update_from_editmode()


def new_groups(ob, name, parts):
    """[VertexGroup]: a new group with each array of vertices in parts. Blender makes their names unique."""
    groups = [ob.vertex_groups.new(name=name) for _ in parts]
    _add(ob, groups, parts)
    return groups


def new_group(ob, name, members):
    """A new group with the vertices of members, (n,) bool."""
    return new_groups(ob, name, [np.flatnonzero(members)])[0]


def islands(chosen, edges):
    """[vertices]: connected components of the chosen vertices through edges among them, ordered by their smallest
    vertex. chosen: (n,) bool."""
    least = components.labels(len(chosen), edges[chosen[edges].all(axis=1)])
    vertices = np.flatnonzero(chosen)
    order = np.argsort(least[vertices], kind='stable')
    return np.split(vertices[order], np.flatnonzero(np.diff(least[vertices][order])) + 1)


def fill_own_group(ob, own, may_change, name, members):
    """Refills the group named own if it exists and may_change, otherwise fills a new one. Returns its name."""
    group = ob.vertex_groups.get(own)
    if group and may_change:
        fill_group(ob, group, members)
        return own
    return new_group(ob, name, members).name
