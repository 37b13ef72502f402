# SPDX-License-Identifier: GPL-3.0-or-later
"""Creates handles from a selection or a vertex group, changes them, and removes them."""


import bpy
import numpy as np
from mathutils import Matrix

from ..follow import lifecycle
from ..scene import displayed, handle_rests, handle_transforms, mesh_data, selection, skin, start, users
from ..scene.mesh_data import MeshProblem
from . import empties, handle_paths, region_setup

_GROUP_NAME = "Handle"
_MAX_AT_ONCE = 1000  # handles; safety: each gets an empty, and more empties are too many to work with
SELECT_FOR_HANDLE = "select those that the handle should move"


def empty_of(ob, index):
    """The empty of the handle with this number. Raises MeshProblem if either doesn't exist."""
    handles = ob.detail_deform.handles
    if index >= len(handles):
        raise MeshProblem(f"There is no handle {index}.")
    if handles[index].target is None:
        raise MeshProblem(f"Handle '{handles[index].name}' has no empty to select: choose one in Empty, or select that "
                          "of the handle it mirrors.")
    return handles[index].target


def _chosen_group(ob, name):
    if name and name not in ob.vertex_groups:
        raise MeshProblem(f"'{ob.name}' has no vertex group '{name}': choose another one.")
    if not name and not ob.vertex_groups.active:
        raise MeshProblem(f"'{ob.name}' has no vertex group: select vertices in Edit Mode, or make a group.")
    return name or ob.vertex_groups.active.name


def add_handles(context, ob, group_name="", each='SELECTION', parented=True, align=True, curve_points=0, chosen=None):
    """Adds one or more handles with their empties; the arguments are the properties of the operator handle_add.
    curve_points: makes a curve with so many control points along the selected vertices in place of an empty. chosen:
    (n,) bool, the vertices of a single handle, in place of those that are selected in Edit Mode. Returns the first
    handle. Raises MeshProblem."""
    if ob.library or ob.data.library:
        mesh_data.check_object(ob)
    from_selection = ob.mode == 'EDIT' or chosen is not None
    if from_selection:
        parts = _selected_parts(ob, each) if chosen is None else [np.flatnonzero(chosen)]
        path = handle_paths.along(ob, parts[0]) if curve_points else None
        # Before the groups are made: afterwards Blender would evaluate the whole mesh anew.
        similarities = displayed.similarities(ob, parts, context.evaluated_depsgraph_get())
        names = [group.name for group in selection.new_groups(ob, _GROUP_NAME, parts)]
    elif each != 'SELECTION':
        raise MeshProblem(f"'{ob.name}' is not in Edit Mode: select there the vertices that get a handle each.")
    else:
        names = [_chosen_group(ob, group_name)]
        parts = [np.flatnonzero(mesh_data.members(ob, names[0]))]
        if not len(parts[0]):
            raise MeshProblem(f"The group '{names[0]}' has no vertex with a weight over "
                              f"{mesh_data.MEMBER_WEIGHT}: assign the vertices that the handle should move.")
        similarities = displayed.similarities(ob, parts, context.evaluated_depsgraph_get())
    # Least display size of an empty: 5% of the object's largest dimension, and less for ten or more, which are close.
    least = max(0.05 * max(ob.dimensions) / max(1.0, len(parts) ** 0.5 / 3), 1e-3)
    rigs, made, depsgraph = skin.Rigs(ob), [], context.view_layer.depsgraph
    for name, part, similarity, (world, extent) in zip(
            names, parts, similarities, empties.placements(ob, parts, align and not curve_points)):
        curve = path.curve(name, ob.matrix_world, world, curve_points) if curve_points else None
        made.append(empties.make_on_skin(context, ob, name, world, max(extent, least), rigs.of(part), similarity,
                                         depsgraph, parented, curve))
    first = len(ob.detail_deform.handles)
    for name, (empty, _) in zip(names, made):
        append(ob, name, empty).own_group = name if from_selection else ""
    empties.put_in_place(context, ob, made)
    handles, depsgraph = ob.detail_deform.handles[first:], context.evaluated_depsgraph_get()
    for handle, similarity in zip(handles, similarities):
        empties.store_pose_matrix(ob, handle, similarity, depsgraph)
    store_homes(context, ob, handles, parts)
    return ob.detail_deform.handles[first]


def _selected_parts(ob, each):
    chosen = selection.selected(ob)
    if not chosen.any():
        raise MeshProblem(f"No vertex is selected: {SELECT_FOR_HANDLE}.")
    if each == 'SELECTION':
        return [np.flatnonzero(chosen)]
    parts = selection.islands(chosen, mesh_data.edges(ob.data) if each == 'ISLAND' else np.empty((0, 2), int))
    if len(parts) > _MAX_AT_ONCE:
        raise MeshProblem(f"{len(parts):,} handles at once, each with an empty of its own, are too many to work with: "
                          f"select fewer, {_MAX_AT_ONCE:,} at most.")
    return parts


def store_homes(context, ob, handles, parts):
    """Stores the homes of new handles: the transforms on the undeformed surface of their empties, which stand on the
    deformed one. parts: the vertices of each handle."""
    if not ob.detail_deform.signature:
        return
    context.view_layer.update()  # evaluates the matrices of the new empties
    transforms = handle_transforms.transforms_of(ob, handles, context.evaluated_depsgraph_get())
    for handle, transform, motion in zip(handles, transforms, start.rigid_motions(ob, parts)):
        home = Matrix((np.linalg.inv(motion) @ transform).tolist())
        home = ob.matrix_world.inverted_safe() @ empties.without_shear(ob.matrix_world @ home)
        handle_rests.set_home(handle, np.array(home))


def append(ob, group_name, empty):
    """Adds a handle to the settings and returns it. empty: None if it mirrors another handle."""
    settings = ob.detail_deform
    handle = settings.handles.add()
    settings.handle_index = len(settings.handles) - 1
    handle.name = group_name
    handle.target = handle.own_target = empty
    handle.vertex_group = group_name
    return handle


def remove_handles(ob, indices):
    """Removes handles, and the groups and empties that were made for them unless something else uses these."""
    handles = [ob.detail_deform.handles[index] for index in indices]
    groups = users.needed_groups(ob, [name for handle in handles for name in (handle.own_group, handle.own_reach)])
    needed = users.needed_empties(ob, filter(None, (handle.own_target for handle in handles)))
    handle_transforms.convert_for_copies(ob, needed)
    for index in sorted(indices, reverse=True):
        _remove_handle(ob, index, groups, needed)


def remove_made(ob):
    """Removes all handles, and the region if it was made for them."""
    settings = ob.detail_deform
    remove_handles(ob, range(len(settings.handles)))
    if settings.region and settings.region == settings.own_region:
        region_setup.remove_own(ob)
        settings.region = settings.own_region = ""
    settings.pulled_region = False


def _remove_handle(ob, index, needed_groups, needed_empties):
    settings = ob.detail_deform
    handle = settings.handles[index]
    own, reach, target = handle.own_group, handle.own_reach, handle.own_target
    unshared = [own] if not shares_group(ob, handle, own) else []
    settings.handles.remove(index)
    if not any(reach in {h.reach, h.own_reach, h.vertex_group} for h in settings.handles):
        unshared += {reach} - {own, *_of_object(settings)}
    for group in filter(None, map(ob.vertex_groups.get, unshared)):
        if group.name not in needed_groups:
            ob.vertex_groups.remove(group)
    if target and target not in needed_empties and not any(h.target == target for h in settings.handles):
        for child in target.children:
            place = child.matrix_world.copy()
            child.parent = None
            empties.place(child, place, child.rotation_euler[:])
        data = target.data
        bpy.data.objects.remove(target)
        if isinstance(data, bpy.types.Curve) and not data.users:
            bpy.data.curves.remove(data)
    collection = settings.handle_collection
    if collection and not collection.objects and not collection.children:
        bpy.data.collections.remove(collection)


def shares_group(ob, handle, name):
    """Whether the object's own settings, a reach or another handle use the vertex group of that name too."""
    settings = ob.detail_deform
    return name in _of_object(settings) or any(
        name == h.reach or h != handle and h.vertex_group == name for h in settings.handles)


def _of_object(settings):
    """The names of the vertex groups that the object's own settings use; '' among them where one uses none."""
    return {settings.region, settings.influence, settings.stiff_parts}


def assign(ob, handle):
    """Makes the selected vertices those of the handle. A group that wasn't made for it, or that something else uses
    too, is left unchanged, and the handle gets a new one."""
    chosen = selection.selected(ob)
    if not chosen.any():
        raise MeshProblem(f"No vertex is selected: select those that '{handle.name}' should move.")
    handle.own_group = selection.fill_own_group(
        ob, handle.own_group, not shares_group(ob, handle, handle.own_group), handle.name, chosen)
    lifecycle.compare(ob)
    if handle.vertex_group != handle.own_group:
        handle.vertex_group = handle.own_group


def select(ob, handle, extend):
    if handle.vertex_group not in ob.vertex_groups:
        raise MeshProblem(f"Handle '{handle.name}' has no vertex group: choose that of its vertices in Vertices.")
    if ob.mode == 'EDIT':
        ob.update_from_editmode()
    selection.select(ob, mesh_data.members(ob, handle.vertex_group), extend)
