# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape that a mesh has in the scene, however it is turned: its object's scale, and the shear that a turned object
has of a parent whose scale differs from axis to axis."""

from typing import NamedTuple

import numpy as np

from . import mesh_data

_FLAT = 1e-6  # of the largest scale: less is none, which has no inverse
_NOISE_DIGITS = 5  # of a matrix in single precision that is turned; more change no shape


def of(ob):
    """(3, 3) float32, symmetric: P of the object's world matrix Q P with a rotation or reflection Q, the largest scale
    as 1: alike along all axes, it changes no shape. A place p of the mesh, as a row, is p P in the scene's proportions.
    """
    linear, one = np.array(ob.matrix_world, np.float64)[:3, :3], np.eye(3, dtype=np.float32)
    if not np.isfinite(linear).all():
        return one
    _, scales, axes = np.linalg.svd(linear)
    if not scales[0] > 0:
        return one
    scales = np.where(scales > _FLAT * scales[0], scales / scales[0], 1.0)
    found = axes.T * scales @ axes
    return found.astype(np.float32) if np.round(found - one, _NOISE_DIGITS).any() else one


class Space(NamedTuple):
    """From an object's own space to one that is proportioned as the scene is."""
    linear: np.ndarray  # (3, 3), in single precision where nothing is shifted
    shift: np.ndarray = np.zeros(3, np.float32)  # (3,)

    def is_own(self):
        """Whether it is the object's own."""
        return not self.shift.any() and (self.linear == np.eye(3)).all()

    def to(self, points):
        """(n, 3) float32"""
        if self.is_own():  # a frame's time
            return points
        return (points @ self.linear.T + self.shift).astype(np.float32, copy=False)

    def back(self, points):
        """(n, 3) float32"""
        if self.is_own():
            return points
        return ((points - self.shift) @ np.linalg.inv(self.linear).T).astype(np.float32, copy=False)

    def motions(self, motions):
        """(k, 3, 4) or (k, 4, 4) float64 motions of the object's own space, told in this one."""
        if self.is_own():
            return motions
        into = np.eye(4)
        into[:3, :3], into[:3, 3] = self.linear, self.shift
        return into[:motions.shape[1], :motions.shape[1]] @ motions @ np.linalg.inv(into)


def bound(settings):
    """The Space in which an object's surface is bound: as it was proportioned then."""
    linear = np.array(settings.proportions, np.float32).reshape(3, 3)
    if not linear.any() or not np.isfinite(linear).all() or abs(np.linalg.det(linear)) < _FLAT**3:
        linear = np.eye(3, dtype=np.float32)  # of an earlier version, or in a file that something has written to
    return Space(linear)


def changed_since(ob):
    """How much more the object has come to be scaled along one direction than along another since it was bound: 1 where
    it keeps its shape."""
    sizes = np.linalg.svd(of(ob).astype(np.float64) @ np.linalg.inv(bound(ob.detail_deform).linear), compute_uv=False)
    return float(sizes[0] / sizes[2])


def stance(source, target):
    """(3, 4) float64: how the source stands to the target in the scene, both as they are proportioned: a rotation,
    scale and shift, with a reflection where one of them is mirrored. None where one is flat."""
    worlds = [np.array(ob.matrix_world, np.float64) for ob in (source, target)]
    for world in worlds:
        if not np.isfinite(world).all():
            return None
        turn, scales, back = np.linalg.svd(world[:3, :3])
        if not scales[2] > _FLAT * scales[0]:
            return None
        world[:3, :3] = scales[0] * turn @ back
    found = (np.linalg.inv(worlds[1]) @ worlds[0])[:3]
    return found if np.isfinite(found).all() else None


def signature(ob):
    """A short text: equal texts, equal proportions."""
    return mesh_data.signature(np.round(of(ob), _NOISE_DIGITS) + np.float32(0))  # which has no negative zero


def shape(ob):
    """(n, 3) float32: the mesh at rest, as it is proportioned in the scene."""
    return mesh_data.rest(ob.data) @ of(ob)
