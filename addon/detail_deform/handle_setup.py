# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles made from a selection or a group, and taken away again."""

import bpy
import numpy as np
from mathutils import Matrix, Vector

from . import mesh_data
from .mesh_data import MeshProblem

_GROUP_NAME = "Handle"


def _group_from_selection(ob):
    """A new vertex group with the vertices selected in Edit Mode."""
    ob.update_from_editmode()
    selected = np.empty(len(ob.data.vertices), bool)
    ob.data.vertices.foreach_get('select', selected)
    if not selected.any():
        raise MeshProblem("No vertex is selected: select those that the handle should move.")
    group = ob.vertex_groups.new(name=_GROUP_NAME)
    # Weights can't be assigned to a mesh in Edit Mode from here.
    bpy.ops.object.mode_set(mode='OBJECT')
    group.add(np.flatnonzero(selected).tolist(), 1.0, 'REPLACE')
    bpy.ops.object.mode_set(mode='EDIT')
    return group.name


def _chosen_group(ob, name):
    if name and name not in ob.vertex_groups:
        raise MeshProblem(f"'{ob.name}' has no vertex group '{name}'.")
    if not name and not ob.vertex_groups.active:
        raise MeshProblem(f"'{ob.name}' has no vertex group: select vertices in Edit Mode, or make a group.")
    return name or ob.vertex_groups.active.name


def _make_empty(context, ob, name, members):
    """An empty at the members' middle, sized to them. It is a child of the object, so that moving
    the object takes it along."""
    points = mesh_data.positions(ob.data)[members]
    world = np.array([ob.matrix_world @ Vector(p) for p in (points.min(0), points.max(0), points.mean(0))])
    empty = bpy.data.objects.new(f"{ob.name} {name}", None)
    empty.empty_display_type = 'ARROWS'
    empty.empty_display_size = max(0.5 * float(np.linalg.norm(world[1] - world[0])),
                                   0.05 * max(ob.dimensions), 1e-3)
    empty.show_in_front = True
    (ob.users_collection or (context.scene.collection,))[0].objects.link(empty)
    empty.parent = ob
    empty.matrix_parent_inverse = ob.matrix_world.inverted_safe()
    empty.matrix_basis = Matrix.Translation(Vector(world[2]))
    return empty


def add_handle(context, ob, group_name):
    """Adds a handle of the object's settings; see the operator."""
    if ob.library or ob.data.library:
        mesh_data.check_object(ob)
    made_group = ob.mode == 'EDIT'
    group_name = _group_from_selection(ob) if made_group else _chosen_group(ob, group_name)
    members = mesh_data.group_weights(ob, [group_name])[0] > mesh_data.MEMBER_WEIGHT
    if not members.any():
        raise MeshProblem(f"The group '{group_name}' has no vertex with a weight over "
                          f"{mesh_data.MEMBER_WEIGHT}: assign the vertices that the handle should move.")
    settings = ob.detail_deform
    handle = settings.handles.add()
    settings.handle_index = len(settings.handles) - 1
    handle.name = group_name
    handle.target = _make_empty(context, ob, group_name, members)
    handle.made_group, handle.made_target = made_group, True
    handle.vertex_group = group_name
    return handle


def remove_handle(ob, index):
    """Removes a handle with the group and the empty that were made for it."""
    settings = ob.detail_deform
    handle = settings.handles[index]
    others = [h for number, h in enumerate(settings.handles) if number != index]
    group = ob.vertex_groups.get(handle.vertex_group)
    target = handle.target
    drop_group = (handle.made_group and group and group.name != settings.region
                  and all(h.vertex_group != group.name for h in others))
    drop_target = handle.made_target and target and all(h.target != target for h in others)
    settings.handles.remove(index)
    if drop_group:
        ob.vertex_groups.remove(group)
    if drop_target:
        bpy.data.objects.remove(target)
