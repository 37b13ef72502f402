# SPDX-License-Identifier: GPL-3.0-or-later
"""The motions of handles since rest, as the library takes them: 3×4 matrices, whole turns, and pivots."""

import numpy as np

from . import euler_angles, handle_rests, symmetric, world_transforms
from .mesh_data import MeshProblem


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
    if not np.isfinite(space).all() or world_transforms.are_singular(space):  # the file was modified by something else
        return flip
    return space @ flip @ np.linalg.inv(space)


def motions(subject, transforms):
    """(h, 3, 4) float64: affine motion of each enabled handle from rest to transforms, in the object's local space.
    transforms: (h, 4, 4) float32 of local_transforms(). Raises MeshProblem.

    Rest and present transform are relative to the object, as for Blender's Hook modifier: moving the object together
    with its empties moves no vertex. Both are rounded to single precision, so that an empty that did not move gives the
    identity without any rounding error.
    """
    rests = subject.rests
    for number in np.flatnonzero(world_transforms.are_singular(rests)):
        raise MeshProblem(f"Handle '{subject.handles[number].name}': its empty had a scale of zero when it "
                          "was bound. Give it a size, then press Unbind and Bind.")
    result = _with_mirrored(subject, transforms) @ np.linalg.inv(rests)
    for number in subject.symmetric:
        handle = subject.handles[number]
        if not handle.mirrors:
            result[number] = symmetric.motion(result[number], _reflections_of(handle), rests[number, :3, 3])
    return result[:, :3]


def _with_mirrored(subject, transforms):
    """(h, 4, 4) float64: the transforms, with those of handles that mirror another from _mirrored_transform()."""
    handles, result = subject.handles, transforms.astype(np.float64)
    for number, source in subject.mirror_sources.items():
        result[number] = _mirrored_transform(handles[number], handles[source], result[source])
    return result


def _mirrored_transform(handle, source, transform):
    """(4, 4): the source's motion from its home to transform, mirrored; for a symmetric handle, made its own mirror
    image. It serves as the transform of the mirroring handle, which has none of its own."""
    if not handle_rests.has_home(source):
        return np.eye(4)
    motion = transform @ np.linalg.inv(handle_rests.home_transform(source))
    if source.symmetric:
        motion = symmetric.motion(motion, _reflections_of(source), handle_rests.home_transform(source)[:3, 3])
    if handle.symmetric:
        return symmetric.motion(motion, _reflections_of(handle), handle_rests.home_transform(source)[:3, 3])
    flip = _reflection_of(handle)
    return flip @ motion @ flip


def are_translations(motions):
    """(h,) bool: which of these (h, 3, 4) motions are non-zero translations: their linear part is the identity to 1e-5,
    some 100 float32 epsilons."""
    turned = np.abs(motions[:, :, :3] - np.eye(3)).max(axis=(1, 2), initial=0)
    return (turned < 1e-5) & motions[:, :, 3].any(axis=1)


def pivots(subject):
    """(h, 3) float64: pivots of the enabled handles: their empties' positions at Bind, in the object's local space."""
    handles, result = subject.handles, subject.rests[:, :3, 3].copy()
    for number in subject.symmetric:
        handle = handles[number]
        if not handle.mirrors:
            result[number] = symmetric.point(result[number], _reflections_of(handle))
    for number, source in subject.mirror_sources.items():
        handle, point = handles[number], handle_rests.home_transform(handles[source])[:, 3].copy()
        if handles[source].symmetric:
            point[:3] = symmetric.point(point[:3], _reflections_of(handles[source]))
        image = (np.append(symmetric.point(point[:3], _reflections_of(handle)), 1.0) if handle.symmetric else
                 _reflection_of(handle) @ point)
        result[number] = (handle_rests.rest_transform(handle) @ image)[:3]
    return result


def check_rest(subject, transforms):
    """Raises MeshProblem where one of these transforms is singular, so that it can't become a rest."""
    for number in np.flatnonzero(world_transforms.are_singular(transforms.astype(np.float64))):
        if number in subject.own:
            raise MeshProblem(f"Handle '{subject.handles[number].name}': its empty has a scale of zero. Give it a "
                              "size, then press Bind.")


def make_present_rest(subject, transforms):
    """Stores these transforms as rests of the enabled handles. Homes stay, and the previous rest of a handle becomes
    its home if it has none. Disabled handles with an empty lose their rest: their transform when they are enabled again
    becomes it."""
    found = dict(zip((handle.name for handle in subject.handles), _with_mirrored(subject, transforms)))
    settings = subject.settings
    for handle in settings.handles:
        if handle_rests.has_rest(handle) and not handle.mirrors and not any(handle.home_matrix):
            (handle.home_matrix, handle.home_euler, handle.home_order,
             handle.home_curve) = handle_rests.home_to_store(handle)
        elif any(handle.home_matrix) and not handle.home_curve:
            handle.home_curve = handle.rest_curve
    for handle in settings.handles:
        source = next((h for h in settings.handles if h.name == handle.mirrors), None)
        if handle.enabled:
            handle_rests.set_rest(handle, found[handle.name])
        elif not handle.mirrors:
            handle.property_unset('rest_matrix')  # the transform that it has when it is enabled again becomes its rest
            handle.property_unset('rest_curve')
        elif source and source.name in found:
            handle_rests.set_rest(handle, _mirrored_transform(handle, source, found[source.name]))


def turn_vectors(subject, transforms):
    """(h, 3) float64: the turn of each handle since rest: a rotation vector with whole turns, in the subject's space.
    It is the sum of the changes of the empty's Euler channels since rest, each times the channel's present axis: exact
    where only one channel changes, an estimate otherwise. Zero for an empty that is rotated by a quaternion or a
    parent, as their matrix doesn't tell whole turns."""
    handles, proportions = subject.handles, subject.space.linear
    rests = [tuple(rest) for rest in subject.values('rest_euler', 3).tolist()]
    result = np.zeros((len(handles), 3))
    for number in subject.own:
        if handles[number].target is not None:  # without an empty it counts as unturned
            result[number] = _turn(handles[number], rests[number], subject.depsgraph,
                                   proportions @ transforms[number][:3, :3].astype(np.float64))
    back = np.linalg.inv(proportions)
    for number in {*subject.mirror_sources, *subject.symmetric}:
        handle = handles[number]
        given = result[subject.mirror_sources.get(number, number)]
        if handle.symmetric:
            planes = [proportions @ flip[:3, :3] @ back for flip in _reflections_of(handle)]
            result[number] = symmetric.turn_vector(given, planes)
        else:
            result[number] = -(proportions @ _reflection_of(handle)[:3, :3] @ back) @ given  # axial, so negated
    return result


def _turn(handle, rest, depsgraph, linear):
    """(3,) float64: turn_vectors() of a handle with an empty. rest: its Euler angles at rest. linear: (3, 3), from the
    empty's space to the subject's."""
    target = handle.target.evaluated_get(depsgraph)
    order, euler = target.rotation_mode, target.rotation_euler[:]
    if order in {'QUATERNION', 'AXIS_ANGLE'} or euler == rest and handle.rest_order in {'', order}:
        return np.zeros(3)
    basis = np.array(target.matrix_basis, np.float64)[:3, :3]
    if world_transforms.are_singular(basis):
        return np.zeros(3)  # no axes can be read from it
    change = euler_angles.channel_turns(euler, euler_angles.in_order(rest, handle.rest_order, order), order,
                                        animated=target.animation_data is not None)
    # From the empty's parent space to the object's. Axes of rotation are axial vectors: a reflection negates them.
    to_object = linear @ np.linalg.inv(basis)
    axes = np.sign(np.linalg.det(to_object)) * to_object @ euler_angles.channel_axes(euler, order)
    return (change * axes / np.linalg.norm(axes, axis=0)).sum(axis=1)
