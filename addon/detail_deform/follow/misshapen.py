# SPDX-License-Identifier: GPL-3.0-or-later
"""Detects examples that are no poses of a mesh: collapsed to a point, a line or a plane, or its mirror image."""

import numpy as np

# Extents below it are collapsed: the largest as a fraction of that at rest, the others of the largest.
_FLAT = 1e-3
# |Σ area vectors| / Σ areas, 0 for a closed surface: from this value on the surface counts as open.
_OPEN = 0.3
# Cosine between the vectors of signed ridges at rest and in the pose: below its negative the pose is mirrored.
_MIRRORED = 0.8
# Root mean square of signed ridges (in [-1, 1]). Safety: a flat surface has only rounding errors, of any sign.
_ROUNDING = 1e-5
_MOST_HINGES, _BLOCK = 20_000, 64  # triangles that are sampled at most, to bound the time, and those of a block


class Flaws:
    """Detects flaws of examples of a mesh. region: (n,) bool, the vertices that count."""

    def __init__(self, rest, triangles, region):
        triangles = triangles[region[triangles].all(axis=1)].astype(np.int64)
        self._region, self._extents = region, _extents(rest[region])
        # An open surface may bend to either side: a dome that is pushed in is no mirror image.
        self._hinges = _hinges(triangles) if _encloses(rest, triangles) else np.empty((0, 4), int)
        self._ridges = _ridges(rest[self._hinges])

    def of(self, pose):
        """The flaw of a pose, (n, 3), as the end of a sentence; or ''. Bind refuses poses that are not finite."""
        if not np.isfinite(pose[self._region]).all():
            return ""
        flaw = _pressed(self._extents, _extents(pose[self._region]))
        if not flaw and _are_opposite(self._ridges, _ridges(pose[self._hinges])):
            flaw = "is the mirror image of the rest, inside out"
        return flaw


def _extents(p):
    """(3,) along the principal axes, largest first: singular values of the centred points."""
    p = p - p.mean(axis=0, dtype=float)
    return np.linalg.svd(p.T @ p, compute_uv=False) ** 0.5


def _pressed(before, after):
    """How an example has collapsed, as the end of a sentence; or ''. before, after: of _extents()."""
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
    """(k, 4), for a sample of the edges: their two ends, and the opposite corners of their two triangles."""
    blocks = np.arange(len(triangles)) // _BLOCK  # consecutive triangles mostly share edges
    triangles = triangles[blocks % -(-len(triangles) // _MOST_HINGES) == 0]
    a, b, other = np.concatenate([np.roll(triangles, k, axis=1) for k in range(3)]).T
    one, back, count = a < b, a > b, triangles.max() + 1
    _, i, j = np.intersect1d(a[one] * count + b[one], b[back] * count + a[back], return_indices=True)
    return np.stack([a[one][i], b[one][i], other[one][i], other[back][j]], axis=1)


def _ridges(hinges):
    """(k,) signed volumes of hinges over the product of three of their edges: of opposite signs for ridges and valleys.
    hinges: (k, 4, 3) positions."""
    sides = hinges[:, 1:].astype(float) - hinges[:, :1]
    return np.linalg.det(sides) / np.maximum(np.linalg.norm(sides, axis=2).prod(axis=1), 1e-300)


def _are_opposite(before, after):
    """Whether ridges have become valleys, and valleys ridges."""
    return before @ after < -_MIRRORED * max(np.linalg.norm(before) * np.linalg.norm(after),
                                             _ROUNDING ** 2 * max(len(before), 1))
