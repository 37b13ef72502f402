# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds the point of a surface that a ray hits, without a search structure: one pass over all triangles, which for a
single ray is faster than building a tree."""

from typing import Any, NamedTuple

import numpy as np

from . import mesh_data


class Hit(NamedTuple):
    triangle: int
    vertex: int  # the triangle's corner that has the largest barycentric weight
    point: Any  # (3,) float64


def hit(points, triangles, origin, direction, both_ways=False):
    """The first Hit of a ray, or None. points: (n, 3); triangles: (m, 3). both_ways: the ray is a line, and the first
    hit the one farthest against its direction."""
    along = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    across = np.linalg.svd(along[None])[2][1:]  # two unit vectors at right angles to it and to each other
    origin = np.asarray(origin, np.float64)
    flat = (points - origin.astype(points.dtype)) @ across.T.astype(points.dtype)
    # Candidates: the box of the triangle's projection has the ray in it.
    inside = np.ones(len(triangles), bool)
    for values in flat.T:
        inside &= mesh_data.touching(triangles, values <= 0) & mesh_data.touching(triangles, values >= 0)
    found = np.flatnonzero(inside)
    corners = points[triangles[found]].astype(np.float64) - origin
    flat = corners @ across.T
    # Barycentric weights, times twice the area of the projection: cross products of the other two corners.
    weights = np.stack([_cross(flat[:, (k + 1) % 3], flat[:, (k + 2) % 3]) for k in range(3)], axis=1)
    areas = weights.sum(axis=1)
    hits = (areas != 0) & ((weights >= 0).all(axis=1) | (weights <= 0).all(axis=1))
    weights = weights[hits] / areas[hits, None]
    depths = np.einsum('ij,ijk,k->i', weights, corners[hits], along)
    usable = np.flatnonzero(np.isfinite(depths) & (both_ways | (depths > 0)))
    if not len(usable):
        return None
    first = usable[depths[usable].argmin()]
    triangle, weights = int(found[hits][first]), weights[first]
    return Hit(triangle, int(triangles[triangle][weights.argmax()]), weights @ corners[hits][first] + origin)


def _cross(a, b):
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
