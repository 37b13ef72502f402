# SPDX-License-Identifier: GPL-3.0-or-later
"""What is selected: objects, vertices in Edit Mode, and vertex groups made of these."""

from contextlib import contextmanager

import bmesh
import bpy
import numpy as np

from . import components
from .mesh_data import MeshProblem


def activate(context, ob):
    """Selects this object alone."""
    for other in context.selected_objects:
        other.select_set(False)
    ob.select_set(True)
    context.view_layer.objects.active = ob


def change_mode(ob, mode):
    """Of the active object. Raises MeshProblem where Blender doesn't."""
    if ob.hide_viewport and ob.mode != 'EDIT':
        raise MeshProblem(f"'{ob.name}' is disabled in viewports, where Blender changes no mode: enable it first, by "
                          "its monitor icon.")
    bpy.ops.object.mode_set(mode=mode)


@contextmanager
def object_mode(ob):
    """Of the active object, meanwhile: the copy of the mesh that another mode works on would not know of a change."""
    mode = ob.mode
    if mode != 'OBJECT':
        change_mode(ob, 'OBJECT')
    try:
        yield
    finally:
        if mode != 'OBJECT':
            change_mode(ob, mode)


def go_to(context, ob, other):
    """Leaves whatever mode the one is in and selects the other alone. Raises MeshProblem."""
    if other.name not in context.view_layer.objects:
        raise MeshProblem(f"'{other.name}' is not in this scene, or is in an excluded collection.")
    if ob.mode != 'OBJECT':
        change_mode(ob, 'OBJECT')
    activate(context, other)


def selected(ob):
    """(n,) bool: what is selected in Edit Mode."""
    ob.update_from_editmode()
    chosen = np.empty(len(ob.data.vertices), bool)
    ob.data.vertices.foreach_get('select', chosen)
    return chosen


def select(ob, members, extend, hidden=False):
    """Selects these vertices in Edit Mode, which is entered if need be. members: (n,) bool. hidden: those that are
    hidden too, which are shown then. Raises MeshProblem."""
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
    """Makes these vertices, with weight 1, all that the group has. members: (n,) bool."""
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
    """Gives each group, with weight 1, an array of vertices."""
    if ob.mode != 'EDIT':
        for group, part in zip(groups, parts):
            group.add(part.tolist(), 1.0, 'REPLACE')
        return
    # Without leaving Edit Mode, where other objects may be too.
    mesh = bmesh.from_edit_mesh(ob.data)
    weights = mesh.verts.layers.deform.verify()
    mesh.verts.ensure_lookup_table()
    for group, part in zip(groups, parts):
        for vertex in part.tolist():
            mesh.verts[vertex][weights][group.index] = 1.0
    bmesh.update_edit_mesh(ob.data, loop_triangles=False, destructive=False)
    ob.update_from_editmode()


def new_groups(ob, name, parts):
    """A new group for each of some arrays of vertices; Blender numbers their names."""
    groups = [ob.vertex_groups.new(name=name) for _ in parts]
    _add(ob, groups, parts)
    return groups


def new_group(ob, name, members):
    """The same of (n,) bool."""
    return new_groups(ob, name, [np.flatnonzero(members)])[0]


def islands(chosen, edges):
    """[vertices] of the parts that edges among the chosen vertices hold together, by their first vertices. chosen: (n,)
    bool."""
    least = components.least(len(chosen), edges[chosen[edges].all(axis=1)])
    vertices = np.flatnonzero(chosen)
    order = np.argsort(least[vertices], kind='stable')
    return np.split(vertices[order], np.flatnonzero(np.diff(least[vertices][order])) + 1)


def fill_own_group(ob, own, may_change, name, members):
    """Fills the group called own, if there is one that may be changed, or else a new one. Returns its name."""
    group = ob.vertex_groups.get(own)
    if group and may_change:
        fill_group(ob, group, members)
        return own
    return new_group(ob, name, members).name
