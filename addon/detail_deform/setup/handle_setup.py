# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles made from a selection, a group or another handle, changed, and taken away again."""

import itertools

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector, kdtree

from ..follow import binding, life
from ..scene import handle_matrices, mesh_data, seen, selection, skin, start, users, window
from ..scene.mesh_data import MeshProblem
from . import region_setup

_GROUP_NAME = "Handle"
_MOST_AT_ONCE = 1000
_COLLECTION_NAME = "{} Handles"
# Of the mean edge length: as far may a vertex be from the mirror image of another.
_MIRROR_TOLERANCE = 0.25
SELECT_FOR_HANDLE = "select those that the handle should move"


class MirrorsItself(MeshProblem):
    """The handle's mirror image is the handle."""


def owner(empty):
    """The mesh object that has this empty for a handle, and the handle's number; None and -1 for others."""
    if empty is None or empty.type != 'EMPTY':
        return None, -1
    # Nearly always the parent, and this is asked at every redraw.
    for ob in itertools.chain([empty.parent] if empty.parent else [], bpy.data.objects):
        if ob.type == 'MESH':
            for number, handle in enumerate(ob.detail_deform.handles):
                if handle.target == empty:
                    return ob, number
    return None, -1


def empty_of(ob, index):
    """Raises MeshProblem where the handle of that number, or its empty, isn't there."""
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


def _normals(triangles, points, parts):
    """(parts, 3): area-weighted normals of the faces around each of some arrays of vertices, of length 1, or zero."""
    part_of = np.full(len(points), -1)
    for number, part in enumerate(parts):
        part_of[part] = number
    near = triangles[(part_of[triangles] >= 0).any(axis=1)]
    a, b, c = np.moveaxis(points.astype(float)[near], 1, 0)
    crosses = np.cross(b - a, c - a)
    sums, areas = np.zeros((len(parts), 3)), np.zeros(len(parts))
    corners = part_of[near]
    for k in range(3):
        # A face counts once for a part, also with several corners in it.
        first = (corners[:, k] >= 0) & (corners[:, :k] != corners[:, k:k + 1]).all(axis=1)
        np.add.at(sums, corners[first, k], crosses[first])
        np.add.at(areas, corners[first, k], np.linalg.norm(crosses[first], axis=1))
    # A ring around a limb points nowhere, and neither does what is not finite.
    lengths = np.linalg.norm(sums, axis=1)  # squares of lengths leave the range of single precision early
    points_somewhere = lengths > 0.2 * areas
    sums[~points_somewhere] = 0
    return sums / np.where(points_somewhere, lengths, 1)[:, None]


def _places(ob, parts, align):
    """For each of some arrays of vertices the world matrix at their middle as they are seen, with its Z axis along
    their normal if asked, and half the extent of their box."""
    visible = start.visible(ob)
    normals = _normals(mesh_data.triangles(ob.data), visible, parts) if align else np.zeros((len(parts), 3))
    turned = ob.matrix_world.to_3x3().inverted_safe().transposed()
    for part, normal in zip(parts, normals):
        points = visible[part]
        low, high, middle = (ob.matrix_world @ Vector(p) for p in (points.min(0), points.max(0), points.mean(0)))
        place = Matrix.Translation(middle)
        if normal.any():
            place = place @ (turned @ Vector(normal)).to_track_quat('Z', 'Y').to_matrix().to_4x4()
        yield place, 0.5 * (high - low).length


def collection_of(context, ob):
    """Where the object's empties are: a collection of their own, so that they can be hidden at once."""
    settings = ob.detail_deform
    shown = set(_shown_collections(context.view_layer.layer_collection))
    if settings.handle_collection not in shown:
        made = bpy.data.collections.new(_COLLECTION_NAME.format(ob.name))
        parents = [c for c in ob.users_collection if c in shown]
        (parents or [context.scene.collection])[0].children.link(made)
        settings.handle_collection = made
    return settings.handle_collection


def _shown_collections(layer):
    """Those of the view layer that something can be put into and is then seen to."""
    if layer.exclude:
        return
    collection = layer.collection
    if not (collection.library or collection.override_library):
        yield collection
    for child in layer.children:
        yield from _shown_collections(child)


def _make_empty(context, ob, name, place, size, parent, bone=""):
    """The empty, and where it is still to be put, or None: see _stand(). bone: of the parent, an armature."""
    empty = bpy.data.objects.new(f"{ob.name} {name}", None)
    empty.empty_display_type = 'ARROWS'
    empty.empty_display_size = size
    empty.show_in_front = True
    collection_of(context, ob).objects.link(empty)
    if parent:
        empty.parent = parent
        if bone:
            empty.parent_type, empty.parent_bone = 'BONE', bone
            return empty, place
        empty.matrix_parent_inverse = parent.matrix_world.inverted_safe()
    empty.matrix_basis = place
    return empty, None


def _stand(context, ob, made):
    """Puts the empties that go with bones to their places, which are known now, and all of them into views that show
    the object alone."""
    waiting = [(empty, place) for empty, place in made if place is not None]
    views = window.local_views(ob, context.evaluated_depsgraph_get())
    if waiting or views:
        context.view_layer.update()
    for empty, place in waiting:
        empty.matrix_world = place
    for view in views:
        for empty, _ in made:
            empty.local_view_set(view, True)


def add_handles(context, ob, group_name="", each='SELECTION', parented=True, align=True):
    """Adds handles to the object's settings, one or more; see the operator. Returns the first."""
    if ob.library or ob.data.library:
        mesh_data.check_object(ob)
    from_selection = ob.mode == 'EDIT'
    if from_selection:
        parts = _selected_parts(ob, each)
        names = [group.name for group in selection.new_groups(ob, _GROUP_NAME, parts)]
    elif each != 'SELECTION':
        raise MeshProblem(f"'{ob.name}' is not in Edit Mode: select there the vertices that get a handle each.")
    else:
        names = [_chosen_group(ob, group_name)]
        parts = [np.flatnonzero(mesh_data.members(ob, names[0]))]
        if not len(parts[0]):
            raise MeshProblem(f"The group '{names[0]}' has no vertex with a weight over "
                              f"{mesh_data.MEMBER_WEIGHT}: assign the vertices that the handle should move.")
    # Many of them stand close to each other.
    least = max(0.05 * max(ob.dimensions) / max(1.0, len(parts) ** 0.5 / 3), 1e-3)
    rigs, made, depsgraph = skin.Rigs(ob), [], context.evaluated_depsgraph_get()
    motions = seen.motions(ob, parts, depsgraph)
    for name, part, motion, (place, extent) in zip(names, parts, motions, _places(ob, parts, align)):
        made.append(_make_on_skin(context, ob, name, place, max(extent, least), rigs.of(part), motion, depsgraph,
                                  parented))
    _stand(context, ob, made)
    first = len(ob.detail_deform.handles)
    for name, (empty, _) in zip(names, made):
        _append(ob, name, empty).own_group = name if from_selection else ""
    handles, depsgraph = ob.detail_deform.handles[first:], context.evaluated_depsgraph_get()
    for handle, motion in zip(handles, motions):
        _pose(ob, handle, motion, depsgraph)
    _note_homes(context, ob, handles, parts)
    return ob.detail_deform.handles[first]


def _selected_parts(ob, each):
    chosen = selection.selected(ob)
    if not chosen.any():
        raise MeshProblem(f"No vertex is selected: {SELECT_FOR_HANDLE}.")
    if each == 'SELECTION':
        return [np.flatnonzero(chosen)]
    parts = selection.islands(chosen, mesh_data.edges(ob.data) if each == 'ISLAND' else np.empty((0, 2), int))
    if len(parts) > _MOST_AT_ONCE:
        raise MeshProblem(f"{len(parts):,} handles at once, each with an empty of its own, are too many to work with: "
                          f"select fewer, {_MOST_AT_ONCE:,} at most.")
    return parts


def _make_on_skin(context, ob, name, place, size, posed_by, motion, depsgraph, parented=True):
    """(empty, place) as of _make_empty, where its vertices are seen. place: among these, in the world, where nothing
    poses them. posed_by: of skin.Rigs. motion: of scene/seen.py. parented: it goes with the object, or with the bone
    that poses most of them."""
    rig, means = posed_by
    if motion is None and means:
        motion = skin.mean_motion(ob, rig, means, depsgraph)
    if motion is not None:
        posed = ob.matrix_world @ Matrix(motion.tolist()) @ ob.matrix_world.inverted_safe() @ place
        place = _without_shear(posed, place.to_scale())
    if not (means and parented):
        return _make_empty(context, ob, name, place, size, ob if parented else None)
    return _make_empty(context, ob, name, place, size, rig, max(means, key=means.get))


def _without_shear(place, scale=None):
    """As an empty can stand; scale: as large as this."""
    where, turn, size = place.decompose()
    return Matrix.LocRotScale(where, turn, scale or size)


def _note_homes(context, ob, handles, parts):
    """Of handles whose empties were put on the surface as it is seen. parts: the vertices of each."""
    if not ob.detail_deform.signature:
        return
    context.view_layer.update()  # the empties' places
    places = handle_matrices.places_of(ob, handles, context.evaluated_depsgraph_get())
    for handle, place, motion in zip(handles, places, start.motions(ob, parts)):
        home = Matrix((np.linalg.inv(motion) @ place).tolist())
        home = ob.matrix_world.inverted_safe() @ _without_shear(ob.matrix_world @ home)
        handle_matrices.set_home(handle, np.array(home))


def _pose(ob, handle, motion, depsgraph):
    handle_matrices.set_pose(handle, handle_matrices.pose_through(ob, handle.target, motion, depsgraph))


def _append(ob, group_name, empty):
    settings = ob.detail_deform
    handle = settings.handles.add()
    settings.handle_index = len(settings.handles) - 1
    handle.name = group_name
    handle.target = handle.own_target = empty
    handle.vertex_group = group_name
    return handle


def remove_handles(ob, indices):
    """Removes handles with the groups and the empties that were made for them, unless something else uses them now."""
    handles = [ob.detail_deform.handles[index] for index in indices]
    groups = users.needed_groups(ob, [name for handle in handles for name in (handle.own_group, handle.own_reach)])
    empties = users.needed_empties(ob, filter(None, (handle.own_target for handle in handles)))
    handle_matrices.hand_over(ob, empties)
    for index in sorted(indices, reverse=True):
        _remove_handle(ob, index, groups, empties)


def _remove_handle(ob, index, needed_groups, needed_empties):
    settings = ob.detail_deform
    handle = settings.handles[index]
    own, reach, target = handle.own_group, handle.own_reach, handle.own_target
    unshared = [own] if not _shares_group(ob, handle, own) else []
    settings.handles.remove(index)
    if not any(reach in {h.reach, h.own_reach, h.vertex_group} for h in settings.handles):
        unshared += {reach} - {settings.region, settings.influence, own}
    for group in filter(None, map(ob.vertex_groups.get, unshared)):
        if group.name not in needed_groups:
            ob.vertex_groups.remove(group)
    if target and target not in needed_empties and not any(h.target == target for h in settings.handles):
        for child in target.children:
            place = child.matrix_world.copy()
            child.parent = None
            child.matrix_world = place
        bpy.data.objects.remove(target)
    collection = settings.handle_collection
    if collection and not collection.objects and not collection.children:
        bpy.data.collections.remove(collection)


def _shares_group(ob, handle, name):
    """Whether the region or another handle uses the group of that name too."""
    settings = ob.detail_deform
    return name in {settings.region, settings.influence} or any(
        name == h.reach or h != handle and h.vertex_group == name for h in settings.handles)


def assign(ob, handle):
    """Gives the handle the selected vertices. A group that is not its own alone stays as it is."""
    chosen = selection.selected(ob)
    if not chosen.any():
        raise MeshProblem(f"No vertex is selected: select those that '{handle.name}' should move.")
    handle.own_group = selection.fill_own_group(
        ob, handle.own_group, not _shares_group(ob, handle, handle.own_group), handle.name, chosen)
    life.check(ob)
    if handle.vertex_group != handle.own_group:
        handle.vertex_group = handle.own_group


def select(ob, handle, extend):
    if handle.vertex_group not in ob.vertex_groups:
        raise MeshProblem(f"Handle '{handle.name}' has no vertex group: choose that of its vertices in Vertices.")
    if ob.mode == 'EDIT':
        ob.update_from_editmode()
    selection.select(ob, mesh_data.members(ob, handle.vertex_group), extend)


# Mirroring

def mirror_image(ob, chosen, axis):
    """(n,) bool: the vertices nearest to the mirror images of the chosen ones, and how many of those
    have none, with an example."""
    points = mesh_data.positions(ob.data)
    ends = points[mesh_data.edges(ob.data)]
    if not len(ends) or not chosen.any():
        return np.zeros(len(points), bool), np.flatnonzero(chosen).tolist()
    near = _MIRROR_TOLERANCE * float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
    mirrored = points[chosen]
    mirrored[:, axis] *= -1
    # Only what may be near: in a large mesh the tree takes longer than all else.
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
    # While it is posed, its home: that is where its mirror image has its own.
    local = (handle_matrices.home(handle) if handle_matrices.has_rest(handle) else
             handle_matrices.local_place(ob, handle, depsgraph))
    flip = handle_matrices.reflection('XYZ'[axis])
    place = ob.matrix_world @ Matrix((start.motion(ob, image) @ flip @ local @ flip).tolist())
    size = source.empty_display_size
    if source.parent_type == 'BONE' or source.parent == ob:
        motion = seen.motions(ob, [np.flatnonzero(image)], depsgraph)[0]
        made = _make_on_skin(context, ob, name, _without_shear(place), size, skin.Rigs(ob).of(image), motion,
                             depsgraph)
    else:
        motion = None
        made = _make_empty(context, ob, name, place, size, source.parent if source.parent_type == 'OBJECT' else None)
    _stand(context, ob, [made])
    empty = made[0]
    empty.empty_display_type = source.empty_display_type
    return empty, motion


def _mirror_reach(ob, name, first, axis):
    """What the handle of that name reaches, and the mirror image of that, is within reach of it and of its mirror
    images, the handles from that number on: bound as one, they are mirror images also where both reach. A group of the
    user's stays as it is."""
    handles = ob.detail_deform.handles
    source = handles[name]
    if source.reach not in ob.vertex_groups:
        return
    reach = mesh_data.members(ob, source.reach)
    sharing = [handle for handle in handles if handle.reach == source.reach]
    region_setup.set_reach(ob, [*sharing, *list(handles)[first:]], reach | mirror_image(ob, reach, axis)[0])


def _mirror_region(ob, image, axis):
    """A region made here that doesn't reach the mirrored handle gets its own mirror image too."""
    settings = ob.detail_deform
    if not settings.region or settings.region != settings.own_region:
        return
    region = mesh_data.members(ob, settings.region)
    if (region & image).sum() < image.sum():
        group = ob.vertex_groups[settings.region]
        selection.fill_group(ob, group, region | image | mirror_image(ob, region, axis)[0])


def keep_symmetric(ob, handle, axis):
    """Of a handle across the object's own plane: its vertices, and their mirror images, move as their own mirror image.
    """
    if handle.vertex_group == handle.own_group and not _shares_group(ob, handle, handle.own_group):
        chosen = mesh_data.members(ob, handle.vertex_group)
        selection.fill_group(ob, ob.vertex_groups[handle.own_group], chosen | mirror_image(ob, chosen, axis)[0])
    handle.symmetric |= {'XYZ'[axis]}


def _split_middle(ob, handle, letter, chosen, image):
    """(n,) bool: the vertices on the plane, which the handle and its mirror image would move in two ways: they get a
    handle that moves in the middle of both. None where its group isn't its own to change."""
    middle = chosen & image
    if not middle.any() or handle.vertex_group != handle.own_group or _shares_group(ob, handle, handle.own_group):
        return np.zeros(len(chosen), bool)
    selection.fill_group(ob, ob.vertex_groups[handle.own_group], chosen & ~middle)
    name = handle.name
    group_name = selection.new_group(ob, f"{name} Middle", middle).name
    made = _append(ob, group_name, None)
    made.own_group = group_name
    made.mirrors, made.symmetric = name, {letter}
    if start.is_deformed(ob.data):
        made.rest_matrix = start.motion(ob, middle, start.KEPT).ravel().tolist()
    return middle


def mirror(context, ob, handle, axis, symmetric, reaches=True):
    """Adds the mirror image of a handle across the object's own plane; axis: 0, 1 or 2. symmetric: it gets
    no empty but mirrors the other's motion. reaches: whether its reach, or the region, is to hold that, too.

    Returns a sentence about vertices that have no counterpart, or ''."""
    name, letter = handle.name, 'XYZ'[axis]
    if handle.vertex_group not in ob.vertex_groups or handle.target is None:
        raise MeshProblem(f"Handle '{name}' has no vertex group or no empty, so there is nothing to mirror.")
    if handle.mirrors:
        raise MeshProblem(f"Handle '{name}' mirrors another one itself: mirror that one.")
    if ob.mode == 'EDIT':
        ob.update_from_editmode()
    chosen = mesh_data.members(ob, handle.vertex_group)
    image, missing = mirror_image(ob, chosen, axis)
    if not image.any():
        raise MeshProblem(f"No vertex of handle '{name}' has a counterpart across the object's {letter} axis: "
                          "the mesh is not symmetric there, or not about its origin.")
    if (image & chosen).sum() > 0.5 * chosen.sum():
        raise MirrorsItself(f"Handle '{name}' lies across the object's {letter} axis: its mirror image is itself.")
    # The list of handles is another one once one is added.
    turns, falloff, reach, count = handle.turns, handle.falloff, handle.reach, len(ob.detail_deform.handles)
    if symmetric:
        image &= ~_split_middle(ob, handle, letter, chosen, image)
        handle = None
        if not image.any():
            return (f"Nothing of '{name}' but what lies on the plane has a counterpart across the object's {letter} "
                    "axis.")
    flipped = bpy.utils.flip_name(name)
    group_name = selection.new_group(ob, flipped if flipped != name else f"{name} Mirrored", image).name
    empty, motion = (None, None) if symmetric else _mirrored_empty(context, ob, handle, axis, group_name, image)
    made = _append(ob, group_name, empty)
    made.own_group = group_name
    made.turns, made.falloff = turns, falloff
    if reaches and reach:
        _mirror_reach(ob, name, count, axis)
    elif reaches:
        _mirror_region(ob, image, axis)
    if symmetric:
        made.mirrors, made.mirror_axis = name, letter
        if start.is_deformed(ob.data):  # where its vertices start, so that it takes the mirrored pose from there
            made.rest_matrix = start.motion(ob, image, start.KEPT).ravel().tolist()
    else:
        _pose(ob, made, motion, context.evaluated_depsgraph_get())
        _note_homes(context, ob, [made], [np.flatnonzero(image)])
    if not missing:
        return ""
    return (f"{len(missing):,} of {chosen.sum():,} vertices of '{name}' (such as vertex {missing[0]}) have no "
            f"counterpart across the object's {letter} axis and were left out.")


# Empties that were deleted

def bring_back(context, ob):
    """Puts those of its handles that something still keeps back into the scene, and makes new ones for the others."""
    whereabouts = handle_matrices.Whereabouts(context.evaluated_depsgraph_get())
    lost = [handle for handle in handle_matrices.with_empties(ob.detail_deform)
            if whereabouts.is_gone(handle.target)]
    for empty in {handle.target for handle in lost if handle.target}:
        collection_of(context, ob).objects.link(empty)
    _make_anew(context, ob, [handle for handle in lost if handle.target is None])
    _stand(context, ob, [(handle.target, None) for handle in lost])
    binding.targets_changed(ob)
    life.refresh(ob, context.evaluated_depsgraph_get(), force=True)


def _make_anew(context, ob, handles):
    """At rest, where their motions are counted from."""
    for handle, part in zip(handles, _parts_of(ob, handles)):
        place = ob.matrix_world @ Matrix((handle_matrices.pose_of(handle) @ handle_matrices.rest(handle)).tolist())
        extent = next(_places(ob, [part], align=False))[1] if len(part) else 0.05 * max(ob.dimensions)
        size = max(extent, 1e-3)
        empty, _ = _make_empty(context, ob, handle.name, _without_shear(place, Vector((1, 1, 1))), size, ob)
        handle.target = handle.own_target = empty
    context.view_layer.update()
    depsgraph = context.evaluated_depsgraph_get()
    for handle in handles:
        handle_matrices.start_from(ob, handle, depsgraph)


def _parts_of(ob, handles):
    """[vertices] of each of some handles; none where its group is gone."""
    groups = [handle.vertex_group for handle in handles]
    found = dict(zip(there := sorted({*groups} & {*ob.vertex_groups.keys()}), mesh_data.members_of_each(ob, there)))
    return [found.get(group, np.empty(0, int)) for group in groups]


# Back to rest

def to_rest(context, ob, handles):
    """Puts the handles' empties where they are without deformation."""
    movable = [h for h in handles if h.target and handle_matrices.has_home(h)]
    _pose_anew(context, ob, [h for h in movable if not h.target.animation_data])
    by_depth = {}
    for handle in movable:
        by_depth.setdefault(_depth(handle.target), []).append(handle)
    for depth in sorted(by_depth):  # parents first: they move their children
        depsgraph = context.evaluated_depsgraph_get()
        for handle in by_depth[depth]:
            _put_home(ob, handle, depsgraph)
        context.view_layer.update()


def _put_home(ob, handle, depsgraph):
    pose = skin.pose_of(ob, handle.target, depsgraph) @ handle_matrices.pose_of(handle)
    place = ob.matrix_world @ Matrix((pose @ handle_matrices.home(handle)).tolist())
    handle.target.matrix_world = _without_shear(place) if any(handle.pose_matrix) else place
    mode = handle.target.rotation_mode
    if mode not in {'QUATERNION', 'AXIS_ANGLE'}:  # a matrix can't tell whole turns apart
        home = Euler(handle_matrices.home_euler(handle, mode), mode)
        handle.target.rotation_euler = handle.target.rotation_euler.to_matrix().to_euler(mode, home)


def _pose_anew(context, ob, handles):
    """As modifiers pose their vertices now, where the empties go to these."""
    if not seen.needs_measuring(ob):
        return
    depsgraph = context.evaluated_depsgraph_get()
    parts = _parts_of(ob, handles)
    handles = [handle for handle, part in zip(handles, parts) if len(part)]
    for handle, motion in zip(handles, seen.motions(ob, list(filter(len, parts)), depsgraph)):
        _pose(ob, handle, motion, depsgraph)


def all_to_rest(context, ob):
    """All of them, and with them the surface: it shows the mesh as it is without any deformation."""
    to_rest(context, ob, list(ob.detail_deform.handles))
    binding.go_home(ob, context.evaluated_depsgraph_get(), wait=bpy.app.background)


def _depth(ob):
    return 1 + _depth(ob.parent) if ob.parent else 0
