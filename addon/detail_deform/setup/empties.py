# SPDX-License-Identifier: GPL-3.0-or-later
"""Empties and curves of handles: created where their vertices are displayed, in a collection of the object's own."""

import math

import bpy
import numpy as np
from mathutils import Euler, Matrix, Quaternion, Vector

from ..scene import handle_transforms, mesh_data, skin, start, window

_COLLECTION_NAME = "{} Handles"
# Horizontal part of a unit normal below which it counts as vertical: three degrees, which look level.
_LEVEL = 0.05


def _normals(triangles, points, parts):
    """(p, 3): for each part, an array of vertices, the area-weighted unit normal of the triangles that touch it; zero
    where these normals cancel out."""
    part_of = np.full(len(points), -1)
    for number, part in enumerate(parts):
        part_of[part] = number
    near = triangles[mesh_data.touching(triangles, part_of >= 0)]
    a, b, c = np.moveaxis(points.astype(float)[near], 1, 0)
    crosses = np.cross(b - a, c - a)
    sums, areas = np.zeros((len(parts), 3)), np.zeros(len(parts))
    corners = part_of[near]
    for k in range(3):
        # A triangle counts once for a part, even if several of its corners are in it.
        first = (corners[:, k] >= 0) & (corners[:, :k] != corners[:, k:k + 1]).all(axis=1)
        np.add.at(sums, corners[first, k], crosses[first])
        np.add.at(areas, corners[first, k], np.linalg.norm(crosses[first], axis=1))
    # The normals of a ring around a limb cancel out: below 20% of the sum of the areas the mean has no direction. The
    # comparison is false for values that aren't finite, too.
    lengths = np.linalg.norm(sums, axis=1)  # double precision: single may overflow
    points_somewhere = lengths > 0.2 * areas
    sums[~points_somewhere] = 0
    return sums / np.where(points_somewhere, lengths, 1)[:, None]


def placements(ob, parts, align):
    """Yields (place, extent) for each part, an array of vertices: a world matrix at the mean of their displayed
    positions, with Z along the mean normal if align is set, and half the diagonal of their bounding box."""
    visible = start.deformed_positions(ob)
    normals = _normals(mesh_data.triangles(ob.data), visible, parts) if align else np.zeros((len(parts), 3))
    normal_matrix = ob.matrix_world.to_3x3().inverted_safe().transposed()
    for part, normal in zip(parts, normals):
        points = visible[part]
        low, high, middle = (ob.matrix_world @ Vector(p) for p in (points.min(0), points.max(0), points.mean(0)))
        world = Matrix.Translation(middle)
        if normal.any():
            world = world @ _along((normal_matrix @ Vector(normal)).normalized()).to_matrix().to_4x4()
        yield world, 0.5 * (high - low).length


def _along(normal):
    """The rotation that takes Z to a unit normal, with Y as upright as can be. Where the normal is vertical, Y stays
    as it is: for a handle on top, the former would be half a turn, whose angle is 180 or -180 degrees by rounding, and
    whole turns are told by angles."""
    if normal.xy.length > _LEVEL:
        return normal.to_track_quat('Z', 'Y')
    level = Vector((0, 0, math.copysign(1, normal.z)))
    upside_down = Quaternion((0, 1, 0), math.pi if normal.z < 0 else 0)
    return level.rotation_difference(normal) @ upside_down


def place(empty, world, euler):
    """Sets its world matrix. euler: of all the angles of this rotation the nearest to these are taken, as a matrix has
    no whole turns; not read where the empty's rotation is no Euler angles."""
    empty.matrix_world = world
    mode = empty.rotation_mode
    if mode not in {'QUATERNION', 'AXIS_ANGLE'}:
        empty.rotation_euler = empty.rotation_euler.to_matrix().to_euler(mode, Euler(euler, mode))


def collection_of(context, ob):
    """The collection of the object's empties, which lets a user hide them all at once. Created if it doesn't exist, is
    linked from another file, or is excluded from the view layer."""
    settings = ob.detail_deform
    shown = set(_shown_collections(context.view_layer.layer_collection))
    if settings.handle_collection not in shown:
        made = bpy.data.collections.new(_COLLECTION_NAME.format(ob.name))
        parents = [c for c in ob.users_collection if c in shown]
        (parents or [context.scene.collection])[0].children.link(made)
        settings.handle_collection = made
    return settings.handle_collection


def _shown_collections(layer):
    """Yields the collections of a view layer that are not excluded and accept local objects."""
    if layer.exclude:
        return
    collection = layer.collection
    if not (collection.library or collection.override_library):
        yield collection
    for child in layer.children:
        yield from _shown_collections(child)


def make(context, ob, name, world, size, parent, bone="", curve=None):
    """Creates an empty, or the object of a curve. Returns (empty, place): world is the world matrix that put_in_place()
    has yet to set, or None if it is set already. bone: name of the parent's bone, if the parent is an armature."""
    empty = bpy.data.objects.new(f"{ob.name} {name}", curve)
    if curve is None:
        empty.empty_display_type = 'ARROWS'
        empty.empty_display_size = size
    empty.show_in_front = True
    collection_of(context, ob).objects.link(empty)
    if parent:
        empty.parent = parent
        if bone:
            empty.parent_type, empty.parent_bone = 'BONE', bone
            return empty, world
        empty.matrix_parent_inverse = parent.matrix_world.inverted_safe()
    empty.matrix_basis = world
    return empty, None


def put_in_place(context, ob, made):
    """Places the empties that are parented to bones, whose matrices are known only after an update, and adds all of
    them to the views in which the object is in Local View. made: the results of make()."""
    waiting = [(empty, world) for empty, world in made if world is not None]
    views = window.local_views(ob, context.evaluated_depsgraph_get())
    if waiting or views:
        context.view_layer.update()
    for empty, world in waiting:
        empty.matrix_world = world
    for view in views:
        for empty, _ in made:
            empty.local_view_set(view, True)


def make_on_skin(context, ob, name, world, size, posed_by, similarity, depsgraph, parented=True, curve=None):
    """As make(), but where other modifiers display the handle's vertices. world: the world matrix before these
    modifiers. posed_by: result of skin.Rigs.of(). similarity: from displayed.similarities(). parented: make the empty a
    child of the object, or of the bone with the largest mean weight on the vertices."""
    rig, means = posed_by
    if similarity is None and means:
        similarity = skin.mean_bone_motion(ob, rig, means, depsgraph)
    if similarity is not None:
        posed = ob.matrix_world @ Matrix(similarity.tolist()) @ ob.matrix_world.inverted_safe() @ world
        world = without_shear(posed, world.to_scale())
    if not (means and parented):
        return make(context, ob, name, world, size, ob if parented else None, curve=curve)
    return make(context, ob, name, world, size, rig, max(means, key=means.get), curve)


def without_shear(matrix, scale=None):
    """The matrix without its shear, which an object's transform can't represent. scale: replaces its own scale."""
    where, turn, size = matrix.decompose()
    return Matrix.LocRotScale(where, turn, scale or size)


def store_pose_matrix(ob, handle, similarity, depsgraph):
    handle_transforms.set_pose_matrix(
        handle, handle_transforms.pose_matrix_beside_bone(ob, handle.target, similarity, depsgraph))
