# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations told by Euler angles, which know whole turns, where a matrix doesn't."""

import numpy as np
from mathutils import Euler, Quaternion


_ORDERS = {'XYZ', 'XZY', 'YXZ', 'YZX', 'ZXY', 'ZYX'}


def told(target):
    """(Euler angles, their order) of the empty's own rotation."""
    if target.rotation_mode == 'QUATERNION':
        return target.rotation_quaternion.to_euler()[:], 'XYZ'
    if target.rotation_mode == 'AXIS_ANGLE':
        angle, *axis = target.rotation_axis_angle
        return Quaternion(axis, angle).to_euler()[:], 'XYZ'
    return target.rotation_euler[:], target.rotation_mode


def in_order(euler, own, order):
    """The same rotation by Euler angles of another order. own: '' where it was not kept, as in old files."""
    if own == order or own not in _ORDERS:
        return tuple(euler)
    return Euler(euler, own).to_matrix().to_euler(order)[:]


def _principal(angles):
    """The same angles in [-π, π]."""
    return angles - 2 * np.pi * np.round(angles / (2 * np.pi))


def channel_turns(euler, rest, order, animated=True):
    """(3,) float64: how far each channel of an Euler rotation of this order has turned since rest, with whole turns.

    Two triples of angles give the same rotation: (x, y, z), and (x + π, π - y, z + π) where Y is the middle channel.
    What sets an empty by a matrix, as Blender's Keep Transform does, may change from one to the other. So the other
    triple for rest counts where the present angles, whole turns aside, are at most half as far from it. (Where it
    counts as soon as it is nearer, empties that turn on by two channels at once jump on their way.)

    animated: False where the angles were set once, so that the other triple as it stands in the formula, where a matrix
    gives one in [-π, π], has not turned either.
    """
    euler, rest = np.asarray(euler, np.float64), np.asarray(rest, np.float64)
    middle = 'XYZ'.index(order[1])
    other = rest + np.pi
    other[middle] = np.pi - rest[middle]
    if np.linalg.norm(_principal(euler - rest)) <= 2 * np.linalg.norm(_principal(euler - other)):
        return euler - rest
    if not animated and np.abs(euler - other).max() < 1e-4:
        return np.zeros(3)
    # Angles that a matrix gave are in [-π, π] and know no whole turns; what lies beyond was turned on to, from there.
    other = _principal(other)
    at_the_end = np.abs(other) > np.pi - 1e-4  # π and -π are the same angle: the sign of the present one
    change = euler - np.where(at_the_end, np.copysign(np.pi, euler), other)
    return np.where(np.abs(euler) <= np.pi + 1e-4, _principal(change), change)


def channel_axes(euler, order):
    """(3, 3): in the columns the axes about which the channels X, Y and Z of such a rotation turn, as the later ones
    have turned them."""
    axes, later = np.empty((3, 3)), np.eye(3)
    for letter in reversed(order):
        channel = 'XYZ'.index(letter)
        axes[:, channel] = later[:, channel]
        turn = np.eye(3)
        one, other = (channel + 1) % 3, (channel + 2) % 3
        cosine, sine = np.cos(euler[channel]), np.sin(euler[channel])
        turn[one, one] = turn[other, other] = cosine
        turn[other, one], turn[one, other] = sine, -sine
        later = later @ turn
    return axes
