# SPDX-License-Identifier: GPL-3.0-or-later
"""The vertices selected in Edit Mode, and vertex groups made of them."""

import bmesh
import bpy
import numpy as np


def selected(ob):
    """(n,) bool: what is selected in Edit Mode."""
    ob.update_from_editmode()
    chosen = np.empty(len(ob.data.vertices), bool)
    ob.data.vertices.foreach_get('select', chosen)
    return chosen


def select(ob, members, extend):
    """Selects these vertices in Edit Mode, which is entered if need be. members: (n,) bool."""
    if ob.mode != 'EDIT':
        bpy.ops.object.mode_set(mode='EDIT')
    mesh = bmesh.from_edit_mesh(ob.data)
    if not extend:
        for element in (*mesh.faces, *mesh.edges, *mesh.verts):
            element.select = False
    mesh.verts.ensure_lookup_table()
    for vertex in np.flatnonzero(members).tolist():
        if not mesh.verts[vertex].hide:
            mesh.verts[vertex].select = True
    mesh.select_mode |= {'VERT'}
    bpy.context.tool_settings.mesh_select_mode[0] = True
    mesh.select_flush_mode()
    bmesh.update_edit_mesh(ob.data, loop_triangles=False, destructive=False)


def fill_group(ob, group, members):
    """Makes these vertices, with weight 1, all that the group has. members: (n,) bool."""
    mode = ob.mode
    if mode == 'EDIT':  # weights can't be assigned there from here
        bpy.ops.object.mode_set(mode='OBJECT')
    group.remove(range(len(members)))
    group.add(np.flatnonzero(members).tolist(), 1.0, 'REPLACE')
    if mode == 'EDIT':
        bpy.ops.object.mode_set(mode='EDIT')


def new_group(ob, name, members):
    group = ob.vertex_groups.new(name=name)
    fill_group(ob, group, members)
    return ob.vertex_groups[-1]  # of this name: a change of mode has replaced it
