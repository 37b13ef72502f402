# SPDX-License-Identifier: GPL-3.0-or-later
"""Mirror images of handles across planes of the object."""

import bpy
import numpy as np
from mathutils import Matrix, kdtree

from ..scene import (displayed, handle_curves, handle_motions, handle_rests, handle_transforms, mesh_data, selection,
                     skin, start)
from ..scene.mesh_data import MeshProblem
from . import empties, handle_setup, region_setup

# The largest distance between a vertex and the mirror image of its counterpart, as a fraction of the mean edge length.
# From 0.5 on, the nearest vertex may be a neighbour of the counterpart: half of that, for safety.
_MIRROR_TOLERANCE = 0.25


class MirrorsItself(MeshProblem):
    """The handle's mirror image is the handle."""


def mirror_image(ob, chosen, axis):
    """(image, missing): (n,) bool, the vertices at the mirror images of the chosen ones, and a list of the chosen
    vertices without a counterpart. axis: 0, 1 or 2."""
    points = mesh_data.positions(ob.data)
    ends = points[mesh_data.edges(ob.data)]
    if not len(ends) or not chosen.any():
        return np.zeros(len(points), bool), np.flatnonzero(chosen).tolist()
    near = _MIRROR_TOLERANCE * float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
    mirrored = points[chosen]
    mirrored[:, axis] *= -1
    # The k-d tree holds only the vertices in the box of the images: on large meshes, building it dominates the time.
    candidates = np.flatnonzero(((points >= mirrored.min(0) - near) & (points <= mirrored.max(0) + near)).all(axis=1))
    tree = kdtree.KDTree(len(candidates))
    for vertex, point in zip(candidates.tolist(), points[candidates].tolist()):
        tree.insert(point, vertex)
    tree.balance()
    image, missing = np.zeros(len(points), bool), []
    for vertex, point in zip(np.flatnonzero(chosen).tolist(), mirrored.tolist()):
        _, other, distance = tree.find(point)
        if other is not None and distance <= near:
            image[other] = True
        else:
            missing.append(vertex)
    return image, missing


def _mirrored_empty(context, ob, handle, axis, name, image):
    source = handle.target
    depsgraph = context.evaluated_depsgraph_get()
    # A bound handle may be posed: its home is mirrored, which gives the home of the image.
    local = (handle_rests.home_transform(handle) if handle_rests.has_rest(handle) else
             handle_transforms.local_transform(ob, handle, depsgraph))
    flip = handle_motions.reflection('XYZ'[axis])
    world = ob.matrix_world @ Matrix((start.rigid_motion(ob, image) @ flip @ local @ flip).tolist())
    size = source.empty_display_size
    if source.parent_type == 'BONE' or source.parent == ob:
        similarity = displayed.similarities(ob, [np.flatnonzero(image)], depsgraph)[0]
        made = empties.make_on_skin(context, ob, name, empties.without_shear(world), size, skin.Rigs(ob).of(image),
                                    similarity, depsgraph)
    else:
        similarity = None
        made = empties.make(context, ob, name, world, size, source.parent if source.parent_type == 'OBJECT' else None)
    empties.put_in_place(context, ob, [made])
    empty = made[0]
    empty.empty_display_type = source.empty_display_type
    return empty, similarity


def _mirror_reach(ob, name, first, axis):
    """Makes the union of a handle's reach and its mirror image the reach of both the handle and its mirror images,
    which are the handles from index first on. With one reach they are bound together, so that they deform symmetrically
    where both reach. A vertex group of the user's is left unchanged."""
    handles = ob.detail_deform.handles
    source = handles[name]
    if source.reach not in ob.vertex_groups:
        return
    reach = mesh_data.members(ob, source.reach)
    sharing = [handle for handle in handles if handle.reach == source.reach]
    region_setup.set_reach(ob, [*sharing, *list(handles)[first:]], reach | mirror_image(ob, reach, axis)[0])


def _mirror_region(ob, image, axis):
    """Adds its mirror image to a region that the add-on made, unless the region contains the mirrored handle already.
    image: (n,) bool, the vertices of the mirrored handle."""
    settings = ob.detail_deform
    if not settings.region or settings.region != settings.own_region:
        return
    region = mesh_data.members(ob, settings.region)
    if (region & image).sum() < image.sum():
        group = ob.vertex_groups[settings.region]
        selection.fill_group(ob, group, region | image | mirror_image(ob, region, axis)[0])


def keep_symmetric(ob, handle, axis, image=None):
    """Makes a handle symmetric that straddles the object's plane: the mirror images of its vertices are added to its
    group, if that is its own, and its motion is restricted to symmetric ones. image: as for mirror()."""
    if handle.vertex_group == handle.own_group and not handle_setup.shares_group(ob, handle, handle.own_group):
        chosen = mesh_data.members(ob, handle.vertex_group)
        image = mirror_image(ob, chosen, axis)[0] if image is None else image
        selection.fill_group(ob, ob.vertex_groups[handle.own_group], chosen | image)
    handle.symmetric |= {'XYZ'[axis]}


def _split_middle(ob, handle, letter, chosen, image):
    """(n,) bool: the vertices on the plane, which the handle and its mirror image would move differently. They become a
    handle of their own that moves by the mean of both motions. All false, and nothing is made, if there are none, or if
    the handle's group is not its own."""
    middle, own = chosen & image, handle.own_group
    if not middle.any() or handle.vertex_group != own or handle_setup.shares_group(ob, handle, own):
        return np.zeros(len(chosen), bool)
    selection.fill_group(ob, ob.vertex_groups[own], chosen & ~middle)
    name = handle.name
    group_name = selection.new_group(ob, f"{name} Middle", middle).name
    made = handle_setup.append(ob, group_name, None)
    made.own_group = group_name
    made.mirrors, made.symmetric = name, {letter}
    if start.has_previous_offsets(ob.data):
        made.rest_matrix = start.rigid_motion(ob, middle, start.PREVIOUS_OFFSETS).ravel().tolist()
    return middle


def mirror(context, ob, handle, axis, symmetric, reaches=True, image=None):
    """Adds the mirror image of a handle across the object's local plane perpendicular to axis 0, 1 or 2. symmetric: the
    image has no empty but mirrors the handle's motion. reaches: extend the handle's reach, or the region, accordingly.
    image: (n,) bool, the vertices of the image, where they aren't those at the places of mirror_image().

    Returns a sentence about vertices that have no counterpart, or ''. Raises MeshProblem."""
    name, letter = handle.name, 'XYZ'[axis]
    if handle.vertex_group not in ob.vertex_groups or handle.target is None:
        raise MeshProblem(f"Handle '{name}' has no vertex group or no empty, so there is nothing to mirror.")
    if handle.mirrors:
        raise MeshProblem(f"Handle '{name}' mirrors another one itself: mirror that one.")
    if handle_curves.has_curve(handle):
        raise MeshProblem(f"Handle '{name}' follows a curve, which can't be mirrored: pull the other side by a curve "
                          "of its own.")
    if ob.mode == 'EDIT':
        ob.update_from_editmode()
    chosen = mesh_data.members(ob, handle.vertex_group)
    image, missing = mirror_image(ob, chosen, axis) if image is None else (image.copy(), [])
    if not image.any():
        raise MeshProblem(f"No vertex of handle '{name}' has a counterpart across the object's {letter} axis: "
                          "the mesh is not symmetric there, or not about its origin.")
    if (image & chosen).sum() > 0.5 * chosen.sum():
        raise MirrorsItself(f"Handle '{name}' lies across the object's {letter} axis: its mirror image is itself.")
    # Read before a handle is added, which reallocates the list of handles.
    turns, falloff, reach, count = handle.turns, handle.falloff, handle.reach, len(ob.detail_deform.handles)
    if symmetric:
        image &= ~_split_middle(ob, handle, letter, chosen, image)
        handle = None
        if not image.any():
            return (f"Nothing of '{name}' but what lies on the plane has a counterpart across the object's {letter} "
                    "axis.")
    flipped = bpy.utils.flip_name(name)
    group_name = selection.new_group(ob, flipped if flipped != name else f"{name} Mirrored", image).name
    empty, similarity = (None, None) if symmetric else _mirrored_empty(context, ob, handle, axis, group_name, image)
    made = handle_setup.append(ob, group_name, empty)
    made.own_group = group_name
    made.turns, made.falloff = turns, falloff
    if reaches and reach:
        _mirror_reach(ob, name, count, axis)
    elif reaches:
        _mirror_region(ob, image, axis)
    if symmetric:
        made.mirrors, made.mirror_axis = name, letter
        if start.has_previous_offsets(ob.data):  # without an empty, its rest is the motion that its vertices have made
            made.rest_matrix = start.rigid_motion(ob, image, start.PREVIOUS_OFFSETS).ravel().tolist()
    else:
        empties.store_pose_matrix(ob, made, similarity, context.evaluated_depsgraph_get())
        handle_setup.store_homes(context, ob, [made], [np.flatnonzero(image)])
    if not missing:
        return ""
    return (f"{len(missing):,} of {chosen.sum():,} vertices of '{name}' (such as vertex {missing[0]}) have no "
            f"counterpart across the object's {letter} axis and were left out.")
