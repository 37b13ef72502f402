# SPDX-License-Identifier: GPL-3.0-or-later
"""The stored rest and home of a handle: the transform of its empty from which motions are measured, and that on the
undeformed mesh, both in the object's local space."""

import numpy as np

from . import euler_angles

# The properties of a handle that a binding sets.
BINDING_PROPERTIES = ('rest_matrix', 'rest_euler', 'rest_order', 'home_matrix', 'home_euler', 'home_order',
                      'mirror_space', 'pose_matrix', 'rest_curve', 'home_curve')


def has_rest(handle):
    return any(handle.rest_matrix)


def rest_transform(handle):
    """(4, 4): the transform from which the handle's motion is measured; the identity if none is stored. A handle that
    mirrors another has no empty: its rest is the motion that its vertices had made from home when the binding
    started."""
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
    _, euler, own, _ = _stored_home(handle)
    return euler_angles.in_order(euler, own, order)


def home_curve(handle):
    """The text of the handle's curve that belongs to home_transform(); '' without one."""
    return _stored_home(handle)[3]


def _stored_home(handle):
    """(flat matrix, Euler angles, their order, curve): the home as stored."""
    if any(handle.home_matrix):
        # A curve that was added to a deformed mesh was only moved there as a whole.
        curve = handle.home_curve or handle.rest_curve
        return handle.home_matrix[:], handle.home_euler[:], handle.home_order, curve
    return handle.rest_matrix[:], handle.rest_euler[:], handle.rest_order, handle.rest_curve


def home_to_store(handle):
    """The values of home_matrix, home_euler, home_order and home_curve that keep this handle's home when its rest is
    replaced: those of _stored_home(), or a matrix of zeros for handles that have no home or mirror another."""
    if handle.mirrors or not has_home(handle):
        return [0.0] * 16, (0.0, 0.0, 0.0), '', ''
    return _stored_home(handle)


def set_home(handle, matrix):
    """Stores the home, (4, 4), of a handle that is added to a deformed mesh."""
    handle.home_matrix = np.asarray(matrix, np.float32).ravel().tolist()
    if handle.target:
        handle.home_euler, handle.home_order = euler_angles.local_euler(handle.target)


def store_rest(handles, transforms, only_new):
    """Stores these transforms as rests, and removes the homes, which then are the same. only_new: stores only the rests
    of handles that have none, and leaves homes as they are."""
    for handle, transform in zip(handles, transforms):
        if not only_new:
            handle.property_unset('home_matrix')
            handle.property_unset('home_curve')
            handle.property_unset('mirror_space')
        if not (only_new and has_rest(handle)):
            set_rest(handle, transform)


def set_rest(handle, transform):
    handle.rest_matrix = np.asarray(transform).ravel().tolist()
    if handle.target:
        handle.rest_euler, handle.rest_order = euler_angles.local_euler(handle.target)


def reset_rests_to_homes(settings):
    """Makes the home of every handle its rest again. A handle that mirrors another loses its stored rest, which is the
    identity at home."""
    for handle in settings.handles:
        if handle.mirrors:
            handle.property_unset('rest_matrix')
        elif any(handle.home_matrix):
            handle.rest_matrix, handle.rest_euler, handle.rest_order, handle.rest_curve = home_to_store(handle)
            handle.property_unset('home_matrix')
            handle.property_unset('home_curve')
