# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes motions invariant under reflection, for handles on a plane of symmetry, as Edit Mode's symmetry keeps a vertex
on its plane. The result is the mean of a motion and its mirror image: of rotations the part about the plane's normal
remains, of translations the part in the plane."""

import numpy as np

from .rotations import nearest_rotations


def motion(given, flips, pivot):
    """(4, 4): the mean of an affine motion and its mirror images. flips: (4, 4) reflections. pivot: (3,); its
    projection to the planes moves to the mean of its images."""
    result, point = given, np.append(pivot, 1.0)
    for flip in flips:
        point = (point + flip @ point) / 2
        other = flip @ result @ flip
        image = (result @ point + other @ point) / 2
        linear = _mean_linear(result[:3, :3], other[:3, :3])
        result = np.eye(4)
        result[:3, :3] = linear
        result[:3, 3] = image[:3] - linear @ point[:3]
    return result


def _mean_linear(one, other):
    """(3, 3): the mean rotation of two linear maps times their mean stretch, by polar decomposition."""
    if np.array_equal(one, other):
        return one
    rotations, stretches = zip(*map(_polar, (one, other)))
    rotation = nearest_rotations(rotations[0] + rotations[1])
    return rotation @ (stretches[0] + stretches[1]) / 2


def _polar(linear):
    rotation = nearest_rotations(linear)
    return rotation, rotation.T @ linear


def turn_vector(given, flips):
    """(3,): the mean of a rotation vector, with whole turns, and its mirror images. flips: (3, 3) reflections."""
    for flip in flips:
        given = (given - flip @ given) / 2  # axial vectors are reflected to -flip @ v
    return given


def point(given, flips):
    """(3,): the projection of a point to the planes. flips: (4, 4) reflections."""
    result = np.append(given, 1.0)
    for flip in flips:
        result = (result + flip @ result) / 2
    return result[:3]
