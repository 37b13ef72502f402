# SPDX-License-Identifier: GPL-3.0-or-later
"""The stretch from a mesh's local space to its shape in the scene, without rotation: the object's scale, and the shear
of a rotated child of a non-uniformly scaled parent."""

from typing import NamedTuple

import numpy as np

from . import mesh_data

# Fraction of the largest scale; safety: a smaller one counts as zero, as the stretch then has no usable inverse. Its
# cube bounds the determinant of a stored stretch.
_FLAT = 1e-6
_NOISE_DIGITS = 5  # decimals of the stretch that count: further ones change with the rotation of a float32 matrix


def of(ob):
    """(3, 3) float32, symmetric: the stretch P of the polar decomposition Q P of the object's world matrix, with Q a
    rotation or reflection, divided by its largest scale, as uniform scale changes no shape. A row vector p of the mesh
    is p P in the scene's proportions. The identity if P is so up to rounding."""
    linear, one = np.array(ob.matrix_world, np.float64)[:3, :3], np.eye(3, dtype=np.float32)
    if not np.isfinite(linear).all():
        return one
    _, scales, axes = np.linalg.svd(linear)
    if not scales[0] > 0:
        return one
    scales = np.where(scales > _FLAT * scales[0], scales / scales[0], 1.0)
    found = axes.T * scales @ axes
    return found.astype(np.float32) if np.round(found - one, _NOISE_DIGITS).any() else one


class ProportionalSpace(NamedTuple):
    """An affine map from an object's local space to one with the scene's proportions."""
    linear: np.ndarray  # (3, 3), float32 where shift is zero
    shift: np.ndarray = np.zeros(3, np.float32)  # (3,)

    def is_identity(self):
        """Whether the map is the identity."""
        return not self.shift.any() and (self.linear == np.eye(3)).all()

    def to(self, points):
        """(n, 3) float32"""
        if self.is_identity():  # saves time in each frame
            return points
        return (points @ self.linear.T + self.shift).astype(np.float32, copy=False)

    def back(self, points):
        """(n, 3) float32"""
        if self.is_identity():
            return points
        return ((points - self.shift) @ np.linalg.inv(self.linear).T).astype(np.float32, copy=False)

    def motions(self, motions):
        """(k, 3, 4) or (k, 4, 4) float64: motions of the object's local space, conjugated to this space."""
        if self.is_identity():
            return motions
        into = np.eye(4)
        into[:3, :3], into[:3, 3] = self.linear, self.shift
        return into[:motions.shape[1], :motions.shape[1]] @ motions @ np.linalg.inv(into)


def bound(settings):
    """The ProportionalSpace in which an object's surface is bound: its proportions at Bind."""
    linear = np.array(settings.proportions, np.float32).reshape(3, 3)
    if not linear.any() or not np.isfinite(linear).all() or abs(np.linalg.det(linear)) < _FLAT**3:
        linear = np.eye(3, dtype=np.float32)  # modified by something else
    return ProportionalSpace(linear)


def changed_since(ob):
    """Anisotropy of the change of the object's stretch since Bind: its largest singular value over its smallest, 1 if
    the shape is unchanged."""
    sizes = np.linalg.svd(of(ob).astype(np.float64) @ np.linalg.inv(bound(ob.detail_deform).linear), compute_uv=False)
    return float(sizes[0] / sizes[2])


def relative_transform(source, target):
    """(3, 4) float64: the similarity from the source's space to the target's, both in the scene's proportions; it
    includes a reflection where one of them is mirrored. None where one is flat or not finite."""
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
    """A hash of the rounded proportions as short text."""
    return mesh_data.signature(np.round(of(ob), _NOISE_DIGITS) + np.float32(0))  # turns -0 into 0


def shape(ob):
    """(n, 3) float32: the mesh at rest in the scene's proportions."""
    return mesh_data.rest_positions(ob.data) @ of(ob)
