# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts empties back: moved ones to the places where their handles are at rest, deleted ones into the scene."""

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..follow import binding, lifecycle
from ..scene import displayed, handle_curves, handle_rests, handle_transforms, mesh_data, skin, world_transforms
from ..scene.subject import with_empties
from . import empties


def bring_back(context, ob):
    """Restores the deleted empties of an object's handles: links those that still exist in the file, and makes new ones
    for the others."""
    presence = world_transforms.ObjectPresence(context.evaluated_depsgraph_get())
    lost = [handle for handle in with_empties(ob.detail_deform)
            if presence.is_deleted(handle.target)]
    for empty in {handle.target for handle in lost if handle.target}:
        empties.collection_of(context, ob).objects.link(empty)
    _make_empties(context, ob, [handle for handle in lost if handle.target is None])
    empties.put_in_place(context, ob, [(handle.target, None) for handle in lost])
    binding.targets_changed(ob)
    lifecycle.refresh(ob, context.evaluated_depsgraph_get(), force=True)


def _make_empties(context, ob, handles):
    """Gives handles new empties at their rest transforms, where their motions are the identity."""
    parts = _parts_of(ob, handles)
    placed = empties.placements(ob, list(filter(len, parts)), align=False)
    for handle, part in zip(handles, parts):
        world = ob.matrix_world @ Matrix(
            (handle_transforms.pose_matrix_of(handle) @ handle_rests.rest_transform(handle)).tolist())
        extent = next(placed)[1] if len(part) else 0.05 * max(ob.dimensions)
        size = max(extent, 1e-3)
        rest = handle_curves.unpacked(handle.rest_curve)
        curve = handle_curves.made_of(rest.samples, handle.name) if rest and rest.samples.frames is None else None
        if not curve:  # a curve keeps the scale in which its points were
            world = empties.without_shear(world, Vector((1, 1, 1)))
        empty, _ = empties.make(context, ob, handle.name, world, size, ob, curve=curve)
        handle.target = handle.own_target = empty
        if curve:  # of the samples, so what is put back are these
            handle.rest_curve = handle_curves.packed(rest._replace(controls=handle_curves.controls(handle)))
    context.view_layer.update()
    depsgraph = context.evaluated_depsgraph_get()
    for handle in handles:
        handle_transforms.start_from_new_empty(ob, handle, depsgraph)


def _parts_of(ob, handles):
    """[vertices] of each handle; none if its group is missing."""
    groups = [handle.vertex_group for handle in handles]
    found = dict(zip(there := sorted({*groups} & {*ob.vertex_groups.keys()}), mesh_data.members_of_each(ob, there)))
    return [found.get(group, np.empty(0, int)) for group in groups]


def to_rest(context, ob, handles):
    """Moves the handles' empties to their homes, where the surface is undeformed. Does nothing to handles without a
    home or an empty."""
    movable = [h for h in handles if h.target and handle_rests.has_home(h)]
    _store_pose_matrices(context, ob, [h for h in movable if not h.target.animation_data])
    by_depth = {}
    for handle in movable:
        by_depth.setdefault(_depth(handle.target), []).append(handle)
    for handle in movable:
        home = handle_curves.unpacked(handle_rests.home_curve(handle))
        if home and handle_curves.has_curve(handle):
            handle_curves.put_back(handle, home.controls)
    for depth in sorted(by_depth):  # parents first: they move their children
        depsgraph = context.evaluated_depsgraph_get()
        for handle in by_depth[depth]:
            _put_home(ob, handle, depsgraph)
        context.view_layer.update()


def _put_home(ob, handle, depsgraph):
    posing = skin.bone_motion_of(ob, handle.target, depsgraph) @ handle_transforms.pose_matrix_of(handle)
    world = ob.matrix_world @ Matrix((posing @ handle_rests.home_transform(handle)).tolist())
    empties.place(handle.target, empties.without_shear(world) if any(handle.pose_matrix) else world,
                  handle_rests.home_euler(handle, handle.target.rotation_mode))


def _store_pose_matrices(context, ob, handles):
    """Measures and stores anew how other modifiers move the handles' vertices, as the empties are about to be placed
    there."""
    if not displayed.needs_measuring(ob):
        return
    depsgraph = context.evaluated_depsgraph_get()
    parts = _parts_of(ob, handles)
    handles = [handle for handle, part in zip(handles, parts) if len(part)]
    for handle, similarity in zip(handles, displayed.similarities(ob, list(filter(len, parts)), depsgraph)):
        empties.store_pose_matrix(ob, handle, similarity, depsgraph)


def all_to_rest(context, ob):
    """Moves all empties home, so that the mesh shows no deformation, and binds again if the binding starts from a
    deformed shape."""
    to_rest(context, ob, list(ob.detail_deform.handles))
    binding.go_home(ob, context.evaluated_depsgraph_get(), wait=bpy.app.background)


def _depth(ob):
    return 1 + _depth(ob.parent) if ob.parent else 0
