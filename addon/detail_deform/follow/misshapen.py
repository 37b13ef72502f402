# SPDX-License-Identifier: GPL-3.0-or-later
"""Examples that are no poses of a mesh: a point, a line, flat, its mirror image."""

import numpy as np

_FLAT = 1e-3  # how thin, of its length
_OPEN = 0.3  # what its borders lack of enclosing a volume
_MIRRORED = 0.8  # how alike ridges and valleys are
_ROUNDING = 1e-5  # of a ridge
_MOST_HINGES, _BLOCK = 20_000, 64  # triangles looked at


class Flaws:
    """Of examples of some vertices (bool) of a mesh."""

    def __init__(self, rest, triangles, region):
        triangles = triangles[region[triangles].all(axis=1)].astype(np.int64)
        self._region, self._extents = region, _extents(rest[region])
        # What is open may bend to either side: a dome that is pushed in is no mirror image.
        self._hinges = _hinges(triangles) if _encloses(rest, triangles) else np.empty((0, 4), int)
        self._ridges = _ridges(rest[self._hinges])

    def of(self, pose):
        """What is wrong with a shape of the mesh; or ''. Of one that isn't finite Bind says so."""
        if not np.isfinite(pose[self._region]).all():
            return ""
        flaw = _pressed(self._extents, _extents(pose[self._region]))
        if not flaw and _are_opposite(self._ridges, _ridges(pose[self._hinges])):
            flaw = "is the mirror image of the rest, inside out"
        return flaw


def _extents(p):
    """(3,) largest first"""
    p = p - p.mean(axis=0, dtype=float)
    return np.linalg.svd(p.T @ p, compute_uv=False) ** 0.5


def _pressed(before, after):
    """What an example lacks of the extents at rest; or ''."""
    if after[0] < _FLAT * before[0]:
        return "is a single point"
    for k, shape in ((1, "into a line"), (2, "flat")):
        if after[k] < _FLAT * after[0] and before[k] > 10 * _FLAT * before[0]:
            return f"is pressed {shape}"
    return ""


def _encloses(rest, triangles):
    a, b, c = (rest[triangles[:, k]].astype(float) for k in range(3))
    areas = np.cross(b - a, c - a)
    return np.linalg.norm(areas.sum(axis=0)) < _OPEN * np.linalg.norm(areas, axis=1).sum()


def _hinges(triangles):
    """(k, 4): the two ends of edges and the corners that their two triangles have besides, of some."""
    blocks = np.arange(len(triangles)) // _BLOCK  # what comes one after the other mostly lies together
    triangles = triangles[blocks % -(-len(triangles) // _MOST_HINGES) == 0]
    a, b, other = np.concatenate([np.roll(triangles, k, axis=1) for k in range(3)]).T
    one, back, count = a < b, a > b, triangles.max() + 1
    _, i, j = np.intersect1d(a[one] * count + b[one], b[back] * count + a[back], return_indices=True)
    return np.stack([a[one][i], b[one][i], other[one][i], other[back][j]], axis=1)


def _ridges(hinges):
    """(k,) positive or negative as the two triangles of a hinge make a ridge or a valley. hinges: (k, 4, 3) places."""
    sides = hinges[:, 1:].astype(float) - hinges[:, :1]
    return np.linalg.det(sides) / np.maximum(np.linalg.norm(sides, axis=2).prod(axis=1), 1e-300)


def _are_opposite(before, after):
    """Whether what was a ridge is a valley."""
    return before @ after < -_MIRRORED * max(np.linalg.norm(before) * np.linalg.norm(after),
                                             _ROUNDING ** 2 * max(len(before), 1))
