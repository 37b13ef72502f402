# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions that are their own mirror image, of handles on a plane of symmetry: as Edit Mode's symmetry keeps a vertex on
its plane. Of a motion and its mirror image it is the middle: turns about axes at right angles to the plane are left of
its turns, moves along the plane of its moves."""

import numpy as np


def motion(given, flips, pivot):
    """(4, 4): the middle of an affine motion and its mirror images. flips: (4, 4) reflections. pivot: (3,), of which
    the place on the planes goes to the middle of where it is taken."""
    result, point = given, np.append(pivot, 1.0)
    for flip in flips:
        point = (point + flip @ point) / 2
        other = flip @ result @ flip
        there = (result @ point + other @ point) / 2
        linear = _middle(result[:3, :3], other[:3, :3])
        result = np.eye(4)
        result[:3, :3] = linear
        result[:3, 3] = there[:3] - linear @ point[:3]
    return result


def _middle(one, other):
    """(3, 3): the rotation in the middle of two motions, and the mean of how they stretch."""
    if np.array_equal(one, other):
        return one
    rotations, stretches = zip(*map(_polar, (one, other)))
    left, _, right = np.linalg.svd(rotations[0] + rotations[1])
    turn = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    return turn @ (stretches[0] + stretches[1]) / 2


def _polar(linear):
    left, _, right = np.linalg.svd(linear)
    left[:, 2] *= np.linalg.det(left @ right)
    rotation = left @ right
    return rotation, rotation.T @ linear


def turn(given, flips):
    """(3,): the same of a rotation vector, whole turns among it. flips: (3, 3)"""
    for flip in flips:
        given = (given - flip @ given) / 2  # as axes of rotation are reflected
    return given


def point(given, flips):
    """(3,): the nearest point on the planes. flips: (4, 4)"""
    result = np.append(given, 1.0)
    for flip in flips:
        result = (result + flip @ result) / 2
    return result[:3]
