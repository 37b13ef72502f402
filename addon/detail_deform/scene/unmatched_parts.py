# SPDX-License-Identifier: GPL-3.0-or-later
"""Loose parts of a transfer's target that correspond to nothing in the source ride on those that do."""

import numpy as np

from ..library import native
from . import loose_parts, mesh_data, riding, split


class UnmatchedParts:
    """These parts of a target. counts: loose_parts.Counts; None where there are no such parts."""

    def __init__(self, target, surface, matched, pinned, how):
        """surface: (positions at rest (n, 3), triangles (m, 3), edges (e, 2)) of the target. matched:
        correspondence.Correspondence. pinned: vertices that are given their places. how: as for riding.RidingParts."""
        shape, triangles, edges = surface
        self.counts, self._rest, self._riding = None, shape, None
        if matched.pairs is None:  # by topology, or by nearest points: all faces correspond to something
            return
        welded = split.WeldedMesh(target)
        triangles = welded.representatives(triangles)
        firsts = welded.representatives(np.arange(len(shape), dtype=np.int32))
        found = matched.pairs[:, 1]
        if matched.pairs_of == 'TRIANGLES':
            found = matched.target_triangles[_within(found, len(matched.target_triangles))].ravel()
        roles = np.full(len(shape), native.ROLE_FREE, np.int32)
        roles[firsts[_within(found, len(shape))]] = 0
        roles[firsts[pinned]] = 0
        in_no_face = np.ones(len(shape), bool)
        in_no_face[triangles] = False
        if not (roles[~in_no_face] < 0).any():
            return
        found = riding.RidingParts(shape, triangles, lambda: mesh_data.faces_of_triangles(target.data),
                                   welded.representatives(edges), roles, in_no_face, how)
        if found.counts != loose_parts.Counts():
            self.counts = found.counts
        if found:
            self._riding, self._vertices = found, np.flatnonzero(np.isin(firsts, found.vertices))
            self._firsts = firsts[self._vertices]

    def placed(self, positions):
        """(n, 3) float32: positions, with those of the parts that ride filled in."""
        if not self._riding:
            return positions
        offsets = self._riding.placed((positions - self._rest).ravel()).reshape(-1, 3)
        result = positions.copy()
        result[self._vertices] = self._rest[self._vertices] + offsets[self._firsts]
        return result


def _within(indices, count):
    """Those that are indices of count things: the library refuses all others, with a sentence."""
    return indices[(indices >= 0) & (indices < count)]
