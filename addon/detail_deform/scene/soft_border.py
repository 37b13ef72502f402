# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights by which displacements fade out towards the region's border."""

import numpy as np

from ..library import native
from . import mesh_data, proportions, split, start


def border_fractions_of(ob, roles):
    """border_fractions() of an object. roles: (n,) of its binding."""
    positions = proportions.bound(ob.detail_deform).to(start.shape(ob))
    welded, triangles = split.WeldedMesh(ob), mesh_data.triangles(ob.data)
    return border_fractions(roles, lambda chosen: welded.distances(positions, triangles, chosen))


def border_fractions(roles, distances):
    """(n,) float32: d_fixed / (d_fixed + d_handle) by distances over the surface: 0 at the border, 1 at handles and
    where nothing is fixed. distances: function of (n,) bool that gives all vertices' distances from the chosen ones."""
    held = roles >= 0
    fixed = (roles == native.ROLE_FIXED) & ~held
    result = np.ones(len(roles), np.float32)
    if not (fixed.any() and held.any()):
        return result
    to_fixed, to_held = distances(fixed), distances(held)
    between = np.isfinite(to_fixed) & np.isfinite(to_held) & ~held
    result[between] = to_fixed[between] / np.maximum(to_fixed[between] + to_held[between], np.float32(1e-30))
    return result


def fade_weights(fractions, width):
    """(n,) float32: smoothstep of border_fractions() / width: 0 at the border, 1 from width on, with zero slope at both
    ends."""
    eased = np.minimum(fractions / np.float32(width), 1)
    return eased * eased * (3 - 2 * eased)
