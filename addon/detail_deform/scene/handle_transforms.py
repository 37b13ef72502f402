# SPDX-License-Identifier: GPL-3.0-or-later
"""The transforms of handles' empties in the local space of the object that they move, without the motion that bones and
modifiers give them anyway."""

import bpy
import numpy as np

from . import handle_rests, mesh_data, skin, world_transforms
from .mesh_data import MeshProblem


def local_transforms(subject, pose_matrices=None, last=None):
    """(h, 4, 4) float32: the evaluated transform of each handle's empty in the object's local space, with the
    motion of its bone and of modifiers (pose_matrix) undone. The identity for handles that mirror another.
    pose_matrices: {index: pose_matrix_beside_bone()}, replaces a handle's stored one. last: as for transforms_of().
    Raises MeshProblem that names the handle."""
    handles, own = subject.handles, subject.own
    transforms = np.empty((len(handles), 4, 4), np.float32)
    transforms[:] = np.eye(4)  # stays for handles that mirror another
    posed = subject.values('pose_matrix', 16).any(axis=1)
    chosen = [(pose_matrices or {}).get(number, _stored_pose_matrix(handles[number]) if posed[number] else None)
              for number in own]
    transforms[own] = transforms_of(subject.ob, [handles[number] for number in own], subject.depsgraph, chosen,
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
    transforms, presence = np.empty((len(handles), 4, 4)), world_transforms.ObjectPresence(depsgraph)
    is_absent = [handle.target is None or not presence.is_in_scene(handle.target) for handle in handles]
    is_deleted = [is_out and handle_rests.has_rest(handle) and presence.is_deleted(handle.target)
                  for is_out, handle in zip(is_absent, handles)]
    for handle in handles:
        if handle.target is None and not handle_rests.has_rest(handle):
            raise MeshProblem(f"Handle '{handle.name}' has no empty, or its empty was deleted: choose "
                              "one in Empty (Handles).")
    known = [number for number, is_out in enumerate(is_deleted) if not is_out]
    owners = _space_owners(ob, [handles[number] for number in known])
    to_local = {owner: world_transforms.world_to_local(owner, depsgraph) for owner in {ob, *owners}}
    worlds = world_transforms.evaluated_worlds(
        [(handles[number].target, f"Handle '{handles[number].name}': empty") for number in known], depsgraph,
        [is_absent[number] for number in known])
    if any(owner != ob for owner in owners):
        transforms[known] = np.array([to_local[owner] for owner in owners]) @ worlds
    else:
        transforms[known] = to_local[ob] @ worlds
    for number in np.flatnonzero(is_deleted):
        world = _world_of_deleted(handles[number].target, depsgraph)
        if world is None:
            transforms[number] = handle_rests.rest_transform(handles[number]) if last is None else last[number]
            continue
        known.append(number)
        transforms[number] = to_local[ob] @ world
    for number in known:
        handle = handles[number]
        if handle.target.parent_type == 'BONE':
            bone_motion = skin.bone_motion_of(ob, handle.target, depsgraph)
            transforms[number] = world_transforms.inverse_or_refuse(
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
    if empty.parent_bone not in rig.data.bones or not world_transforms.in_scene(rig, depsgraph):
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
    return matrix if np.isfinite(matrix).all() and not world_transforms.are_singular(matrix) else None


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
    return None if world_transforms.are_singular(bone) else np.linalg.inv(bone) @ similarity


def set_pose_matrix(handle, matrix):
    """Stores a matrix of pose_matrix_beside_bone(), or none."""
    if matrix is None:
        handle.property_unset('pose_matrix')
    else:
        handle.pose_matrix = matrix.ravel().tolist()


def rest_transforms(subject, transforms, roles):
    """(h, 4, 4) float32: rest transforms of the empties: their present ones, except on bones of a disabled armature,
    which no longer poses the mesh. There it is the present one or that with the bone at rest, whichever is nearer to
    the centroid of the handle's vertices. roles: (n,) of the binding."""
    result, rest_positions = transforms.copy(), None
    ob, depsgraph = subject.ob, subject.depsgraph
    for number in subject.own:
        handle = subject.handles[number]
        if handle.target is None or handle.target.parent_type != 'BONE':
            continue
        bone_motion = skin.former_bone_motion_of(ob, handle.target, depsgraph)
        if world_transforms.are_singular(bone_motion) or np.array_equal(bone_motion, np.eye(4)):
            continue
        if rest_positions is None:
            rest_positions = mesh_data.rest_positions(ob.data)
        centre, at_rest = rest_positions[roles == number].mean(axis=0), np.linalg.inv(bone_motion) @ transforms[number]
        if np.linalg.norm(at_rest[:3, 3] - centre) < np.linalg.norm(transforms[number, :3, 3] - centre):
            result[number] = at_rest
    return result


def convert_for_copies(ob, empties):
    """Converts the rests and homes of copies of the object that use these empties from the object's space to their own,
    so that nothing moves when the object lets go of the empties. See _space_owners()."""
    for other in bpy.data.objects if empties else ():
        if other.type != 'MESH' or other == ob:
            continue
        handles = [handle for handle in other.detail_deform.handles if handle.target in empties
                   and _space_owners(other, [handle])[0] == ob and handle_rests.has_rest(handle)]
        for handle in handles:
            worlds = [np.array(each.matrix_world, np.float64) for each in (handle.target, ob, other)]
            if any(map(world_transforms.are_singular, worlds)):
                continue
            empty, to_original, own = worlds
            pose = pose_matrix_of(handle)
            before, after = (np.linalg.inv(space @ pose) @ empty for space in (to_original, own))
            for name in ('rest_matrix', 'home_matrix'):
                transform = np.array(getattr(handle, name), np.float64).reshape(4, 4)
                if transform.any():  # changed so that the motion from it to the present transform is the same
                    setattr(handle, name, (transform @ np.linalg.inv(before) @ after).ravel().tolist())


def start_from_new_empty(ob, handle, depsgraph):
    """Makes the transform of a handle's new empty its rest, instead of its earlier empty's, and converts its home."""
    before, transform = handle_rests.rest_transform(handle), local_transform(ob, handle, depsgraph)
    if any(handle.home_matrix):
        handle_rests.set_home(handle, transform @ np.linalg.inv(before) @ handle_rests.home_transform(handle))
    handle_rests.set_rest(handle, transform.astype(np.float32))
