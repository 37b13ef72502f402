# SPDX-License-Identifier: GPL-3.0-or-later
"""Loose parts that ride along: plates, rivets, horns, eyes, hair cards and single vertices that lie on a surface or
stick in it, and that no handle holds. They go with the surface beneath them: small ones rigidly, large ones, as
clothes, bend with it."""

import numpy as np

from .loose_parts import LooseParts
from .rotations import cross, nearest_rotations

# A part moves by the mean motion of what is beneath, or where that moves apart by its median: what is off by more than
# this fraction of the part's size counts by how many it is, not by how far. So an eye stays in its socket while a lid
# closes. Tuned: it moves by an eighth of the lid; with means, or up to 0.1, by a third.
_AGREES = 0.02
_AGREE_WELL = 0.01  # squares of such distances, as fractions: up to this all count as they are
_ROUNDS = 4  # of reweighting; with 20 the eye moves by 2% less
_LEAST_FOR_MEDIAN = 4  # triangles; hair cards ride on fewer, which takes half the time


class RidingParts:
    """The parts of a mesh that ride along."""

    def __init__(self, rest, triangles, faces, edges, roles, copies, how):
        """rest: (n, 3); triangles: (m, 3); faces: the function that reads the face of each, (m,); edges: (e, 2); roles:
        (n,), as for native.Bind. copies: (n,) bool, vertices that are welded with another one, and in no face here.
        how: 'AUTO', 'RIGID' or 'BEND'."""
        self._rest = rest.astype(np.float64)
        parts = LooseParts(self._rest, triangles, faces, edges, roles, copies)
        parts.find(how)
        self.counts = parts.counts
        size = np.ptp(self._rest, axis=0).max(initial=0) or 1.0
        self._stages = [_Groups(self._rest, triangles, riders, size)
                        for riders in (parts.bending, parts.rigid) if riders is not None]

    def __bool__(self):
        return bool(self._stages)

    @property
    def vertices(self):
        """Those that ride."""
        return np.concatenate([np.zeros(0, np.intp), *(groups.vertices for groups in self._stages)])

    def placed(self, offsets):
        """(3 n,): offsets, with those of the parts that ride filled in."""
        result = offsets.reshape(-1, 3)
        for groups in self._stages:  # rigid parts may ride on those that bend
            result = groups.placed(result)
        return result.ravel()


class _Groups:
    """Groups of vertices, each of which moves rigidly with the triangles on which it rides."""

    def __init__(self, rest, triangles, riders, size):
        """riders: loose_parts.Riders. size: of the mesh, the unit of their sizes."""
        self.vertices, self._rest = riders.vertices, rest
        pairs = np.unique(riders.contacts, axis=0)
        numbers, self._begin = np.unique(pairs[:, 0], return_index=True)
        self._group, self._pair_group = (np.searchsorted(numbers, of) for of in (riders.groups, pairs[:, 0]))
        used, self._of_pair = np.unique(pairs[:, 1], return_inverse=True)
        self._corners = triangles[used]
        a, b, c = np.moveaxis(rest[self._corners], 1, 0)
        frames, areas = _frames(a, b, c)
        self._inverse = np.linalg.inv(frames)
        self._weights = np.maximum(areas, 1e-12 * areas.max())[self._of_pair]
        self._centroids = ((a + b + c) / 3)[self._of_pair]
        self._centres = _means(self._weights, self._centroids, self._begin)
        self._arms = rest[self.vertices] - self._centres[self._group]
        self._sizes = size * np.array([riders.sizes[number] if riders.sizes else np.inf for number in numbers])
        few = np.diff(np.append(self._begin, len(pairs))) < _LEAST_FOR_MEDIAN
        self._sizes[few | (self._sizes == 0)] = np.inf  # these move by means

    def placed(self, offsets):
        """(n, 3): offsets, with those of the groups filled in."""
        if not offsets[self._corners].any():
            return offsets
        a, b, c = np.moveaxis(self._rest[self._corners] + offsets[self._corners], 1, 0)
        gradients = (_frames(a, b, c)[0] @ self._inverse)[self._of_pair].reshape(-1, 9)
        now = ((a + b + c) / 3)[self._of_pair]
        rotations = nearest_rotations(_means(self._weights, gradients, self._begin).reshape(-1, 3, 3))
        centres = _means(self._weights, now, self._begin)
        self._let_agree(gradients, now, rotations, centres)
        result = offsets.copy()
        result[self.vertices] = (centres[self._group] - self._rest[self.vertices]
                                  + np.einsum('kij,kj->ki', rotations[self._group], self._arms))
        return result

    def _let_agree(self, gradients, now, rotations, centres):
        """Changes the motions, rotations and centres, of the groups beneath which places move apart, towards their
        medians."""
        group, chosen = self._pair_group, np.flatnonzero(np.isfinite(self._sizes)[self._pair_group])
        if not len(chosen):
            return
        groups, begin = np.unique(group[chosen], return_index=True)
        gradients, now, rest = gradients[chosen], now[chosen], self._centroids[chosen]
        apart = self._apart(chosen, now, rotations, centres)
        if apart.max() < _AGREE_WELL:
            return
        for _ in range(_ROUNDS):
            weights = self._weights[chosen] / np.sqrt(1 + np.maximum(apart - _AGREE_WELL, 0))
            of_groups = [_means(weights, values, begin) for values in (gradients, rest, now)]
            rotations[groups] = nearest_rotations(of_groups[0].reshape(-1, 3, 3))
            # The motion takes the weighted centre at rest to the present one; self._centres are of all alike.
            arms = self._centres[groups] - of_groups[1]
            centres[groups] = of_groups[2] + np.einsum('kij,kj->ki', rotations[groups], arms)
            apart = self._apart(chosen, now, rotations, centres)

    def _apart(self, pairs, now, rotations, centres):
        """(p,): squared distances of places from where the group's motion takes them, over those of _AGREES."""
        group = self._pair_group[pairs]
        moved = np.einsum('kij,kj->ki', rotations[group], self._centroids[pairs] - self._centres[group])
        apart = now - centres[group] - moved
        return np.einsum('ki,ki->k', apart, apart) / (_AGREES * self._sizes[group]) ** 2


def _means(weights, values, begin):
    """(g, c): weighted means over groups. values: (pairs, c). begin: (g,) of the first pair of each group."""
    return np.add.reduceat(weights[:, None] * values, begin) / np.add.reduceat(weights, begin)[:, None]


def _frames(a, b, c):
    """((k, 3, 3), (k,)): two edges and the unit normal of triangles, as columns, and twice their areas. A triangle
    without an area has the identity."""
    one, other = b - a, c - a
    normals = cross(one, other)
    areas = np.sqrt(np.einsum('ki,ki->k', normals, normals))
    frames = np.stack([one, other, normals / np.maximum(areas, 1e-300)[:, None]], axis=2)
    if not areas.all():
        frames[areas == 0] = np.eye(3)
    return frames, areas
