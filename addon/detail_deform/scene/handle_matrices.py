# SPDX-License-Identifier: GPL-3.0-or-later
"""Computes the 3×4 matrices of handles, as the library takes them, from their empties."""

import bpy
import numpy as np

from . import euler_angles, mesh_data, skin, symmetric
from .mesh_data import MeshProblem


# The properties of a handle that a binding sets.
BINDING_PROPERTIES = ('rest_matrix', 'rest_euler', 'rest_order', 'home_matrix', 'home_euler', 'home_order',
                      'mirror_space', 'pose_matrix')


def enabled_handles(settings):
    return [handle for handle in settings.handles if handle.enabled]


def with_empties(settings):
    """The enabled handles that don't mirror another one, and so have an empty."""
    return [handle for handle in enabled_handles(settings) if not handle.mirrors]


def in_scene(ob, depsgraph):
    """Whether the object belongs to the depsgraph's scene and is evaluated there. An object that is only referred to is
    evaluated too, but its transform then is meaningless."""
    return ObjectPresence(depsgraph).is_in_scene(ob)


class ObjectPresence:
    """Whether objects are in the scene, or deleted. For many at once: sets of all objects are built once, if needed."""

    def __init__(self, depsgraph):
        self._depsgraph, self._in_scene, self._anywhere = depsgraph, None, None

    def is_in_scene(self, ob):
        """As in_scene()."""
        layer = self._depsgraph.view_layer
        if not ob.evaluated_get(self._depsgraph).is_evaluated:
            return False
        # Fast and nearly always sufficient; the last test below goes through all objects.
        if ob.visible_get(view_layer=layer) or ob.hide_get(view_layer=layer):
            return True
        if self._in_scene is None:
            self._in_scene = set(self._depsgraph.scene.objects)
        return ob in self._in_scene

    def is_deleted(self, empty):
        """Whether an empty was deleted: from the file, or from all collections while references keep the data-block."""
        if empty is None:
            return True
        if self.is_in_scene(empty):
            return False
        if self._anywhere is None:
            collections = (*bpy.data.collections, *(scene.collection for scene in bpy.data.scenes))
            self._anywhere = {ob for collection in collections for ob in collection.objects}
        return empty not in self._anywhere


def evaluated_world(ob, depsgraph, what):
    return _evaluated_worlds([(ob, what)], depsgraph)[0]


def _evaluated_worlds(named, depsgraph, is_absent=None):
    """(k, 4, 4) float64: evaluated world matrices. named: [(object, what messages call it)]. is_absent: (k,) bool,
    whether each is not in_scene(), if known. Raises MeshProblem."""
    rows = []
    for number, (ob, what) in enumerate(named):
        if is_absent[number] if is_absent is not None else not in_scene(ob, depsgraph):
            raise MeshProblem(f"{what} '{ob.name}' is not in this scene, or is disabled or excluded so that "
                              "its place is not known: bring it back, or choose another one.")
        world = ob.evaluated_get(depsgraph).matrix_world
        rows += (*world[0], *world[1], *world[2], *world[3])  # numpy converts a Matrix far more slowly
    worlds = np.array(rows, np.float64).reshape(-1, 4, 4)
    for number in np.flatnonzero(~np.isfinite(worlds).all(axis=(1, 2))):
        ob, what = named[number]
        raise MeshProblem(f"{what} '{ob.name}' has a location, rotation or scale that is not a finite number: set it "
                          "anew, or look at what moves it.")
    return worlds


def _are_singular(matrices):
    """(...) bool: which of these have a singular linear part: |det| < 1e-30, as of a scale of 1e-10. Safety before
    an inverse; a scale of 1e-6 is a legal, if odd, unit."""
    with np.errstate(invalid='ignore'):  # NaN passes here: the result shows it
        return np.abs(np.linalg.det(matrices[..., :3, :3])) < 1e-30


def _inverse_or_refuse(matrix, sentence):
    if _are_singular(matrix):
        raise MeshProblem(sentence)
    return np.linalg.inv(matrix)


def world_to_local(ob, depsgraph):
    """(4, 4): the inverse of the object's evaluated world matrix. Raises MeshProblem where it is singular."""
    return _inverse_or_refuse(evaluated_world(ob, depsgraph, "Object"),
                              f"'{ob.name}' has a scale of zero: give it a size.")


def local_transforms(ob, depsgraph, pose_matrices=None, last=None):
    """(h, 4, 4) float32: the evaluated transform of each enabled handle's empty in the object's local space, with the
    motion of its bone and of modifiers (pose_matrix) undone. The identity for handles that mirror another.
    pose_matrices: {index: pose_matrix_beside_bone()}, replaces a handle's stored one. last: as for transforms_of().
    Raises MeshProblem that names the handle."""
    handles = enabled_handles(ob.detail_deform)
    own = [number for number, handle in enumerate(handles) if not handle.mirrors]
    transforms = np.empty((len(handles), 4, 4), np.float32)
    transforms[:] = np.eye(4)  # stays for handles that mirror another
    posed = _of_enabled(ob.detail_deform, 'pose_matrix', 16).any(axis=1)
    transforms[own] = transforms_of(ob, [handles[number] for number in own], depsgraph,
                                    [(pose_matrices or {}).get(
                                        number, _stored_pose_matrix(handles[number]) if posed[number] else None)
                                     for number in own],
                                    last if last is not None and len(last) == len(own) else None)
    return transforms


def local_transform(ob, handle, depsgraph):
    """(4, 4) float64: transforms_of() one handle."""
    return transforms_of(ob, [handle], depsgraph)[0]


def transforms_of(ob, handles, depsgraph, pose_matrices=None, last=None):
    """(k, 4, 4) float64: local transforms of handles with empties, as of local_transforms(). A bound handle whose empty
    was deleted stays at the empty's last transform.

    pose_matrices: one (4, 4) or None for each handle, replaces the stored pose matrix. last: the previous result, used
    for handles of whose empty nothing is left; without it they are at rest. Raises MeshProblem."""
    transforms, presence = np.empty((len(handles), 4, 4)), ObjectPresence(depsgraph)
    is_absent = [handle.target is None or not presence.is_in_scene(handle.target) for handle in handles]
    is_deleted = [is_out and has_rest(handle) and presence.is_deleted(handle.target)
                  for is_out, handle in zip(is_absent, handles)]
    for handle in handles:
        if handle.target is None and not has_rest(handle):
            raise MeshProblem(f"Handle '{handle.name}' has no empty, or its empty was deleted: choose "
                              "one in Empty (Handles).")
    known = [number for number, is_out in enumerate(is_deleted) if not is_out]
    owners = _space_owners(ob, [handles[number] for number in known])
    to_local = {owner: world_to_local(owner, depsgraph) for owner in {ob, *owners}}
    worlds = _evaluated_worlds([(handles[number].target, f"Handle '{handles[number].name}': empty")
                                for number in known], depsgraph, [is_absent[number] for number in known])
    if any(owner != ob for owner in owners):
        transforms[known] = np.array([to_local[owner] for owner in owners]) @ worlds
    else:
        transforms[known] = to_local[ob] @ worlds
    for number in np.flatnonzero(is_deleted):
        world = _world_of_deleted(handles[number].target, depsgraph)
        if world is None:
            transforms[number] = rest_transform(handles[number]) if last is None else last[number]
            continue
        known.append(number)
        transforms[number] = to_local[ob] @ world
    for number in known:
        handle = handles[number]
        if handle.target.parent_type == 'BONE':
            bone_motion = skin.bone_motion_of(ob, handle.target, depsgraph)
            transforms[number] = _inverse_or_refuse(
                bone_motion, f"Handle '{handle.name}': the bone of its empty has a scale of zero.") @ transforms[number]
        pose_matrix = pose_matrices[number] if pose_matrices is not None else _stored_pose_matrix(handle)
        if pose_matrix is not None:
            transforms[number] = np.linalg.inv(pose_matrix) @ transforms[number]
    return transforms


def _world_of_deleted(empty, depsgraph):
    """(4, 4): world matrix of a deleted empty whose data-block still exists, by its bone's present pose if it is
    parented to one; None where it can't be known."""
    if empty is None:
        return None
    rig = empty.parent
    if empty.parent_type != 'BONE' or rig is None:
        return np.array(empty.matrix_world, np.float64)
    if empty.parent_bone not in rig.data.bones or not in_scene(rig, depsgraph):
        return None
    posed = rig.evaluated_get(depsgraph)
    bone = posed.pose.bones[empty.parent_bone]
    end = np.eye(4)
    end[1, 3] = bone.length
    parts = posed.matrix_world, bone.matrix, end, empty.matrix_parent_inverse, empty.matrix_basis
    return np.linalg.multi_dot([np.array(part, np.float64) for part in parts])


def _space_owners(ob, handles):
    """[object]: for each handle the object in whose local space its empty's motion is measured. It is ob, except for a
    copy that still uses the empties made for, and parented to, the original mesh: then the original, so that the copy
    is posed alike wherever it stands."""
    owners, empties_of = [ob] * len(handles), {}
    for number, handle in enumerate(handles):
        parent = handle.target.parent
        if parent is None or parent == ob or parent.type != 'MESH' or handle.own_target != handle.target:
            continue
        if parent not in empties_of:
            empties_of[parent] = {h.target for h in parent.detail_deform.handles if h.target == h.own_target}
        if handle.target in empties_of[parent]:
            owners[number] = parent
    return owners


def _stored_pose_matrix(handle):
    """(4, 4): pose_matrix_beside_bone() from when the handle's empty was placed; None if there is none or it is
    malformed."""
    if not any(handle.pose_matrix):
        return None
    matrix = np.array(handle.pose_matrix, np.float64).reshape(4, 4)
    # The file may have been modified by something else.
    return matrix if np.isfinite(matrix).all() and not _are_singular(matrix) else None


def pose_matrix_of(handle):
    """(4, 4): the motion of the handle's vertices by modifiers when its empty was placed, without that of the empty's
    bone; the identity if none is stored."""
    matrix = _stored_pose_matrix(handle)
    return np.eye(4) if matrix is None else matrix


def pose_matrix_beside_bone(ob, empty, similarity, depsgraph):
    """(4, 4): the pose matrix for this similarity, of displayed.similarities(): bone⁻¹ similarity, as the motion of the
    bone that carries the empty, if any, is applied in every frame. None where similarity is None or the bone's is
    singular. Raises MeshProblem."""
    if similarity is None:
        return None
    bone = skin.bone_motion_of(ob, empty, depsgraph)
    return None if _are_singular(bone) else np.linalg.inv(bone) @ similarity


def set_pose_matrix(handle, matrix):
    """Stores a matrix of pose_matrix_beside_bone(), or none."""
    if matrix is None:
        handle.property_unset('pose_matrix')
    else:
        handle.pose_matrix = matrix.ravel().tolist()


def rest_transforms(ob, transforms, roles, depsgraph):
    """(h, 4, 4) float32: rest transforms of the empties: their present ones, except on bones of a disabled armature,
    which no longer poses the mesh. There it is the present one or that with the bone at rest, whichever is nearer to
    the centroid of the handle's vertices. roles: (n,) of the binding."""
    result, rest_positions = transforms.copy(), None
    for number, handle in enumerate(enabled_handles(ob.detail_deform)):
        if handle.mirrors or handle.target is None or handle.target.parent_type != 'BONE':
            continue
        bone_motion = skin.former_bone_motion_of(ob, handle.target, depsgraph)
        if _are_singular(bone_motion) or np.array_equal(bone_motion, np.eye(4)):
            continue
        if rest_positions is None:
            rest_positions = mesh_data.rest_positions(ob.data)
        centre, at_rest = rest_positions[roles == number].mean(axis=0), np.linalg.inv(bone_motion) @ transforms[number]
        if np.linalg.norm(at_rest[:3, 3] - centre) < np.linalg.norm(transforms[number, :3, 3] - centre):
            result[number] = at_rest
    return result


def mirror_sources(handles):
    """Generator of (index, index of its source) for the handles that mirror another one. Raises MeshProblem."""
    for number, handle in enumerate(handles):
        if not handle.mirrors:
            continue
        source = next((k for k, h in enumerate(handles) if h.name == handle.mirrors and not h.mirrors), None)
        if source is None:
            raise MeshProblem(f"Handle '{handle.name}' mirrors '{handle.mirrors}', which is not there, is not "
                              "enabled or mirrors another one: choose one with an empty in Mirrors (Handles).")
        yield number, source


def reflection(axis):
    """(4, 4): the reflection across the plane through the object's origin normal to its axis X, Y or Z."""
    return np.diag([*(-1.0 if letter == axis else 1.0 for letter in 'XYZ'), 1.0])


def _reflection_of(handle):
    """(4, 4): the reflection by which the handle mirrors another's motion, across the plane as it was at Bind."""
    return _in_mirror_space(handle, reflection(handle.mirror_axis))


def _reflections_of(handle):
    """[(4, 4)]: the reflections under which the handle's own motion is kept invariant."""
    return [_in_mirror_space(handle, reflection(letter)) for letter in sorted(handle.symmetric)]


# The reflection conjugated by mirror_space: from the object's space at Bind to the present one.
def _in_mirror_space(handle, flip):
    if not any(handle.mirror_space):
        return flip
    space = np.array(handle.mirror_space, np.float64).reshape(4, 4)
    if not np.isfinite(space).all() or _are_singular(space):  # the file was modified by something else
        return flip
    return space @ flip @ np.linalg.inv(space)


def motions(settings, transforms):
    """(h, 3, 4) float64: affine motion of each enabled handle from rest to transforms, in the object's local space.
    transforms: (h, 4, 4) float32 of local_transforms(). Raises MeshProblem.

    Rest and present transform are relative to the object, as for Blender's Hook modifier: moving the object together
    with its empties moves no vertex. Both are rounded to single precision, so that an empty that did not move gives the
    identity without any rounding error.
    """
    rests = _rest_transforms(settings)
    for number in np.flatnonzero(_are_singular(rests)):
        raise MeshProblem(f"Handle '{enabled_handles(settings)[number].name}': its empty had a scale of zero when it "
                          "was bound. Give it a size, then press Unbind and Bind.")
    result = _with_mirrored(settings, transforms) @ np.linalg.inv(rests)
    for number, handle in _symmetric_handles(settings):
        if not handle.mirrors:
            result[number] = symmetric.motion(result[number], _reflections_of(handle), rests[number, :3, 3])
    return result[:, :3]


def _symmetric_handles(settings):
    """[(number, handle)] of the enabled handles whose motion is kept its own mirror image."""
    flags = np.empty(len(settings.handles), np.int32)
    settings.handles.foreach_get('symmetric', flags)
    return [(number, handle) for number, handle in enumerate(enabled_handles(settings)) if handle.symmetric
            ] if flags.any() else []


def _of_enabled(settings, name, size):
    """(h, size) float64: the array property of this name of each enabled handle."""
    values = np.empty(size * len(settings.handles), np.float32)
    settings.handles.foreach_get(name, values)
    enabled = [number for number, handle in enumerate(settings.handles) if handle.enabled]
    return values.reshape(-1, size)[enabled].astype(np.float64)


def _rest_transforms(settings):
    """(h, 4, 4) float64: rest_transform() of each enabled handle, read in bulk."""
    rests = _of_enabled(settings, 'rest_matrix', 16)
    rests[~rests.any(axis=1)] = np.eye(4).ravel()
    return rests.reshape(-1, 4, 4)


def _with_mirrored(settings, transforms):
    """(h, 4, 4) float64: the transforms, with those of handles that mirror another from _mirrored_transform()."""
    handles, result = enabled_handles(settings), transforms.astype(np.float64)
    for number, source in mirror_sources(handles):
        result[number] = _mirrored_transform(handles[number], handles[source], result[source])
    return result


def _mirrored_transform(handle, source, transform):
    """(4, 4): the source's motion from its home to transform, mirrored; for a symmetric handle, made its own mirror
    image. It serves as the transform of the mirroring handle, which has none of its own."""
    if not has_home(source):
        return np.eye(4)
    motion = transform @ np.linalg.inv(home_transform(source))
    if handle.symmetric:
        return symmetric.motion(motion, _reflections_of(handle), home_transform(source)[:3, 3])
    flip = _reflection_of(handle)
    return flip @ motion @ flip


def are_translations(motions):
    """(h,) bool: which of these (h, 3, 4) motions are non-zero translations: their linear part is the identity to 1e-5,
    some 100 float32 epsilons."""
    turned = np.abs(motions[:, :, :3] - np.eye(3)).max(axis=(1, 2), initial=0)
    return (turned < 1e-5) & motions[:, :, 3].any(axis=1)


def are_free(settings):
    """(h,) bool: which enabled handles are free, that is, only place. Handles that mirror another one are as it is."""
    handles = enabled_handles(settings)
    result = np.array([handle.turns == 'FREE' for handle in handles], bool)
    for number, source in mirror_sources(handles):
        result[number] = result[source]
    return result


def pivots(settings):
    """(h, 3) float64: pivots of the enabled handles: their empties' positions at Bind, in the object's local space."""
    handles = enabled_handles(settings)
    result = _rest_transforms(settings)[:, :3, 3].copy()
    for number, handle in enumerate(handles):
        if handle.symmetric and not handle.mirrors:
            result[number] = symmetric.point(result[number], _reflections_of(handle))
    for number, source in mirror_sources(handles):
        handle, point = handles[number], home_transform(handles[source])[:, 3]
        image = (np.append(symmetric.point(point[:3], _reflections_of(handle)), 1.0) if handle.symmetric else
                 _reflection_of(handle) @ point)
        result[number] = (rest_transform(handle) @ image)[:3]
    return result


def convert_for_copies(ob, empties):
    """Converts the rests and homes of copies of the object that use these empties from the object's space to their own,
    so that nothing moves when the object lets go of the empties. See _space_owners()."""
    for other in bpy.data.objects if empties else ():
        if other.type != 'MESH' or other == ob:
            continue
        handles = [handle for handle in other.detail_deform.handles
                   if handle.target in empties and _space_owners(other, [handle])[0] == ob and has_rest(handle)]
        for handle in handles:
            worlds = [np.array(each.matrix_world, np.float64) for each in (handle.target, ob, other)]
            if any(map(_are_singular, worlds)):
                continue
            empty, to_original, own = worlds
            pose = pose_matrix_of(handle)
            before, after = (np.linalg.inv(space @ pose) @ empty for space in (to_original, own))
            for name in ('rest_matrix', 'home_matrix'):
                transform = np.array(getattr(handle, name), np.float64).reshape(4, 4)
                if transform.any():  # changed so that the motion from it to the present transform is the same
                    setattr(handle, name, (transform @ np.linalg.inv(before) @ after).ravel().tolist())


def has_rest(handle):
    return any(handle.rest_matrix)


def rest_transform(handle):
    """(4, 4): the transform relative to which the handle's motion is measured. For one that mirrors another: the motion
    of its vertices from home to the start of the binding. The identity if none is stored."""
    return np.array(handle.rest_matrix, np.float64).reshape(4, 4) if has_rest(handle) else np.eye(4)


def has_home(handle):
    return has_rest(handle) or any(handle.home_matrix)


def home_transform(handle):
    """(4, 4): the transform of the handle's empty where the mesh is undeformed: its rest, unless the handle was bound
    to a deformed mesh."""
    return np.array(handle.home_matrix, np.float64).reshape(4, 4) if any(handle.home_matrix) else rest_transform(handle)


def home_euler(handle, order):
    """The empty's local rotation that belongs to home_transform(), as Euler angles of this order. With them an empty
    that is put back gets the whole turns, which the matrix doesn't have."""
    _, euler, own = _stored_home(handle)
    return euler_angles.in_order(euler, own, order)


def _stored_home(handle):
    """(flat matrix, Euler angles, their order): the home as stored."""
    if any(handle.home_matrix):
        return handle.home_matrix[:], handle.home_euler[:], handle.home_order
    return handle.rest_matrix[:], handle.rest_euler[:], handle.rest_order


def home_to_store(handle):
    """The values of home_matrix, home_euler and home_order that keep this handle's home when its rest is replaced:
    those of _stored_home(), or a matrix of zeros for handles that have no home or mirror another."""
    if handle.mirrors or not has_home(handle):
        return [0.0] * 16, (0.0, 0.0, 0.0), ''
    return _stored_home(handle)


def set_home(handle, matrix):
    """Stores the home, (4, 4), of a handle that is added to a deformed mesh."""
    handle.home_matrix = np.asarray(matrix, np.float32).ravel().tolist()
    if handle.target:
        handle.home_euler, handle.home_order = euler_angles.local_euler(handle.target)


def check_rest(settings, transforms):
    """Raises MeshProblem where one of these transforms is singular, so that it can't become a rest."""
    handles = enabled_handles(settings)
    for number in np.flatnonzero(_are_singular(transforms.astype(np.float64))):
        if not handles[number].mirrors:
            raise MeshProblem(f"Handle '{handles[number].name}': its empty has a scale of zero. Give it a size, then "
                              "press Bind.")


def store_rest(settings, transforms, only_new):
    """Stores these transforms as rests, and removes the homes, which then are the same. only_new: stores only the rests
    of handles that have none, and leaves homes as they are."""
    for handle, transform in zip(enabled_handles(settings), transforms):
        if not only_new:
            handle.property_unset('home_matrix')
            handle.property_unset('mirror_space')
        if not (only_new and has_rest(handle)):
            _set_rest(handle, transform)


def make_present_rest(settings, transforms):
    """Stores these transforms as rests of the enabled handles. Homes stay, and the previous rest of a handle becomes
    its home if it has none. Disabled handles with an empty lose their rest: their transform when they are enabled again
    becomes it."""
    found = dict(zip((handle.name for handle in enabled_handles(settings)), _with_mirrored(settings, transforms)))
    for handle in settings.handles:
        if has_rest(handle) and not handle.mirrors and not any(handle.home_matrix):
            handle.home_matrix, handle.home_euler, handle.home_order = home_to_store(handle)
    for handle in settings.handles:
        source = next((h for h in settings.handles if h.name == handle.mirrors), None)
        if handle.enabled:
            _set_rest(handle, found[handle.name])
        elif not handle.mirrors:
            handle.property_unset('rest_matrix')  # the transform that it has when it is enabled again becomes its rest
        elif source and source.name in found:
            _set_rest(handle, _mirrored_transform(handle, source, found[source.name]))


def start_from_new_empty(ob, handle, depsgraph):
    """Makes the transform of a handle's new empty its rest, instead of its earlier empty's, and converts its home."""
    before, transform = rest_transform(handle), local_transform(ob, handle, depsgraph)
    if any(handle.home_matrix):
        set_home(handle, transform @ np.linalg.inv(before) @ home_transform(handle))
    _set_rest(handle, transform.astype(np.float32))


def _set_rest(handle, transform):
    handle.rest_matrix = np.asarray(transform).ravel().tolist()
    if handle.target:
        handle.rest_euler, handle.rest_order = euler_angles.local_euler(handle.target)


def reset_rests_to_homes(settings):
    """Makes the home of every handle its rest again. Handles that mirror another lose theirs, which is the identity
    then."""
    for handle in settings.handles:
        if handle.mirrors:
            handle.property_unset('rest_matrix')
        elif any(handle.home_matrix):
            handle.rest_matrix, handle.rest_euler, handle.rest_order = home_to_store(handle)
            handle.property_unset('home_matrix')


def turn_vectors(settings, transforms, depsgraph, proportions):
    """(h, 3) float64: the turn of each handle since rest: a rotation vector with whole turns, in the object's space
    transformed by proportions, (3, 3). It is the sum of the changes of the empty's Euler channels since rest, each
    times the channel's present axis: exact where only one channel changes, an estimate otherwise. Zero for an empty
    that is rotated by a quaternion or a parent, as their matrix doesn't tell whole turns."""
    result = np.zeros((len(transforms), 3))
    handles = enabled_handles(settings)
    rests = [tuple(rest) for rest in _of_enabled(settings, 'rest_euler', 3).tolist()]
    for number, handle in enumerate(handles):
        if handle.mirrors or handle.target is None:  # without an empty it counts as unturned
            continue
        target = handle.target.evaluated_get(depsgraph)
        order = target.rotation_mode
        if order in {'QUATERNION', 'AXIS_ANGLE'}:
            continue
        euler = target.rotation_euler[:]
        if euler == rests[number] and handle.rest_order in {'', order}:
            continue
        change = euler_angles.channel_turns(
            euler, euler_angles.in_order(rests[number], handle.rest_order, order), order,
            animated=target.animation_data is not None)
        basis = np.array(target.matrix_basis, np.float64)[:3, :3]
        if _are_singular(basis):
            continue  # no axes can be read from it
        # From the empty's parent space to the object's. Axes of rotation are axial vectors: a reflection negates them.
        to_object = proportions @ transforms[number][:3, :3].astype(np.float64) @ np.linalg.inv(basis)
        axes = np.sign(np.linalg.det(to_object)) * to_object @ euler_angles.channel_axes(euler, order)
        result[number] = (change * axes / np.linalg.norm(axes, axis=0)).sum(axis=1)
    back = np.linalg.inv(proportions)
    sources = dict(mirror_sources(handles))
    for number, handle in enumerate(handles):
        given = result[sources.get(number, number)]
        if handle.symmetric:
            planes = [proportions @ flip[:3, :3] @ back for flip in _reflections_of(handle)]
            result[number] = symmetric.turn_vector(given, planes)
        elif number in sources:
            result[number] = -(proportions @ _reflection_of(handle)[:3, :3] @ back) @ given  # axial, so negated
    return result
