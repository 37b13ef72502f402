# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations as Euler angles, which preserve whole turns, unlike matrices."""

import numpy as np
from mathutils import Euler, Quaternion


_ORDERS = {'XYZ', 'XZY', 'YXZ', 'YZX', 'ZXY', 'ZYX'}


def local_euler(target):
    """(Euler angles in radians, their order) of the empty's local rotation, converted from its rotation mode."""
    if target.rotation_mode == 'QUATERNION':
        return target.rotation_quaternion.to_euler()[:], 'XYZ'
    if target.rotation_mode == 'AXIS_ANGLE':
        angle, *axis = target.rotation_axis_angle
        return Quaternion(axis, angle).to_euler()[:], 'XYZ'
    return target.rotation_euler[:], target.rotation_mode


def in_order(euler, own, order):
    """The same rotation as Euler angles of another order. own: the angles' present order. If that is unknown, '', as in
    old files, or the other one isn't an order, they are returned unchanged."""
    if own == order or not {own, order} <= _ORDERS:
        return tuple(euler)
    return Euler(euler, own).to_matrix().to_euler(order)[:]


def _principal(angles):
    """The angles modulo 2π, in [-π, π]."""
    return angles - 2 * np.pi * np.round(angles / (2 * np.pi))


def channel_turns(euler, rest, order, animated=True):
    """(3,) float64: the change of each Euler channel since rest, in radians and with whole turns.

    Two triples of angles give the same rotation: (x, y, z), and (x + π, π - y, z + π) where Y is the middle channel.
    Setting an empty's matrix, as Blender's Keep Transform does, may switch from one to the other. So the change is
    taken from the second triple of rest where the present angles, modulo 2π, are less than half as far from it as from
    the first. (With the nearer of the two instead, empties that turn about two channels at once jump on their way.)

    animated: False where the angles were set once: then the second triple exactly as in the formula, not reduced to
    [-π, π], counts as no change, too.
    """
    euler, rest = np.asarray(euler, np.float64), np.asarray(rest, np.float64)
    middle = 'XYZ'.index(order[1])
    other = rest + np.pi
    other[middle] = np.pi - rest[middle]
    if np.linalg.norm(_principal(euler - rest)) <= 2 * np.linalg.norm(_principal(euler - other)):
        return euler - rest
    if not animated and np.abs(euler - other).max() < 1e-4:
        return np.zeros(3)
    # Angles in [-π, π] may come from a matrix, which carries no whole turns: the change is taken modulo 2π. Angles
    # beyond were reached by turning on from there: the full change counts.
    other = _principal(other)
    at_the_end = np.abs(other) > np.pi - 1e-4  # π and -π are the same angle: take the sign of the present one
    change = euler - np.where(at_the_end, np.copysign(np.pi, euler), other)
    return np.where(np.abs(euler) <= np.pi + 1e-4, _principal(change), change)


def channel_axes(euler, order):
    """(3, 3): the columns are the axes about which the channels X, Y and Z turn, each rotated by the channels that are
    applied after it."""
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
