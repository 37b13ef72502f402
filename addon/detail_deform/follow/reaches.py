# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles with reaches of their own: a part of the binding for each reach.

The handles of each reach are bound by themselves to the mesh around what they reach, those without a reach, the first
part, to the region. How the parts become one surface: composed.py.
"""

import contextlib
import re

import numpy as np

from ..library import native
from ..scene import soft_border

# Rings of constrained vertices beside those that may move: K of the highest order reads three of them, refinement two.
_RINGS = 3
_REST = np.eye(4)[:3]
# How far a motion is from none where its empty didn't move: rounding of double precision, of the part's size.
_STILL = 1e-12
# The least determinant of F at a handle: a surface that is flattened further tells no motion, and nothing is turned.
_FLATTEST = 1e-3
# Of how much places vary along one direction, in squares, beside how much they do along another.
_LEAST_VARIATION = 1e-4
# Of the method Examples alone; what has a reach of its own goes by detail transfer then.
_OF_EXAMPLES = ('example_weights', 'example_limits', 'gradients')
# An array with a row for each handle.
_OF_HANDLES = ('turns', 'handle_turns', 'pivots')


class Part:
    """What the handles of one reach are bound to."""

    def __init__(self, numbers, positions, triangles, roles, vertices=None, triangle_numbers=None, smoothness=0):
        """numbers: (h,) of its handles among all. positions, triangles, roles: as of native.Bind, of the mesh that it
        is bound to, with its handles counted from 0. vertices, triangle_numbers: of that in the whole mesh; None: it is
        the whole, by whose region these handles go. smoothness: the order of its base energy; 0: as the whole's."""
        self.smoothness = smoothness
        self.numbers, self.vertices, self.triangle_numbers = numbers, vertices, triangle_numbers
        self.positions, self.triangles, self.roles = positions, triangles, roles
        self.size = float(np.abs(positions).max(initial=0))
        self.held = [np.flatnonzero(roles == number) for number in range(len(numbers))]
        self._ways = self._smooth = None

    @property
    def is_whole(self):
        return self.vertices is None

    def bind_arguments(self):
        """Of native.Bind, without its options."""
        return self.positions, self.triangles, self.roles, len(self.numbers)

    def options(self, told):
        """Of its native.Bind; told: those of the whole."""
        own = {'smoothness': self.smoothness} if self.smoothness else {}
        return told if self.is_whole else {name: value for name, value in told.items() if name != 'examples'} | own

    def asked(self, of_all):
        """Of its update; of_all: that of the whole."""
        found = {name: value[self.numbers] if name in _OF_HANDLES and value is not None else value
                 for name, value in of_all.items()}
        if not self.is_whole and found.get('method') == 'EXAMPLES':
            found = {name: value for name, value in found.items() if name not in _OF_EXAMPLES}
            found['method'] = 'TRANSFER'
        return found

    @property
    def rows(self):
        """Of its vertices in what the whole mesh has a row for each of."""
        return slice(None) if self.vertices is None else self.vertices

    def gradients(self, before):
        """(k, 3, 3): F, where its vertices' offsets are before, (k, 3); None where they are none."""
        if not before.any():
            return None
        found = native.vertex_gradients(self.positions, self.positions + before, self.triangles)
        if self._smooth is None:
            self._smooth = self._fit()
        functions, fit = self._smooth
        result = (functions @ (fit @ found.reshape(-1, 9))).reshape(-1, 3, 3)
        if min(np.linalg.det(result[held].mean(axis=0)) for held in self.held) > _FLATTEST:
            return result
        return np.broadcast_to(np.eye(3), result.shape)

    def _fit(self):
        """(k, 4) and (4, k): the linear functions of a place, and what finds those that are nearest to values at the
        vertices in the least squares sense, weighted by their areas and most at the handles."""
        places = self.positions.astype(np.float64)
        a, b, c = np.moveaxis(places[self.triangles], 1, 0)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        weights = self.shares_of_way() ** 2 * sum(
            np.bincount(self.triangles[:, k], areas, minlength=len(places)) for k in range(3))
        if not weights.any():  # handles that nothing is beside
            weights = np.ones(len(places))
        weights /= weights.sum()
        middle = weights @ places
        size = max(np.abs(places - middle).max(initial=0), 1e-300)
        functions = np.concatenate([np.ones((len(places), 1)), (places - middle) / size], axis=1)
        weighted = functions.T * weights
        # Across a plane nothing varies: there the least slope is none.
        return functions, np.linalg.pinv(weighted @ functions, rcond=_LEAST_VARIATION, hermitian=True) @ weighted

    def shares_of_way(self):
        """As of soft_border.ways."""
        if self._ways is None:
            self._ways = soft_border.ways(self.roles, lambda chosen: native.distances(
                self.positions, self.triangles, chosen))
        return self._ways

    def relative(self, matrices, before, gradients):
        """(h, 3, 4): what its handles are asked for, from where their vertices are before it."""
        if gradients is None:
            return matrices
        result = np.empty_like(matrices)
        for number, (matrix, held) in enumerate(zip(matrices, self.held)):
            F = gradients[held].mean(axis=0, dtype=np.float64)
            centre = self.positions[held].mean(axis=0, dtype=np.float64)
            there, back = centre + before[held].mean(axis=0, dtype=np.float64), np.linalg.inv(F)
            result[number, :, :3] = back @ matrix[:, :3]
            result[number, :, 3] = back @ (matrix[:, 3] - there) + centre
        return result

    def is_moved(self, matrices):
        """By any of its handles. matrices: theirs, (h, 3, 4)."""
        change = np.abs(matrices - _REST)
        return change[..., :3].max() > _STILL or change[..., 3].max() > _STILL * self.size

    def faded(self, offsets, width):
        """(k, 3): its offsets, (3 k,), fading towards its border by that width."""
        offsets = offsets.reshape(-1, 3)
        if not width:
            return offsets
        return offsets * soft_border.shares(self.shares_of_way(), width)[:, None]

    def vertex(self, number):
        """By its number in the mesh."""
        return number if self.vertices is None else int(self.vertices[number])

    def triangle(self, number):
        """The same of a triangle."""
        return number if self.triangle_numbers is None else int(self.triangle_numbers[number])

    @contextlib.contextmanager
    def in_numbers_of_all(self):
        """What the library says of the part's handles, vertices and triangles, it says of those of the mesh."""
        numbers = {'handle': lambda number: int(self.numbers[number]), 'vertex': self.vertex, 'triangle': self.triangle}
        try:
            yield
        except native.NativeError as error:
            said = re.sub(r"\b(handle|vertex|triangle) (\d+)\b",
                          lambda found: f"{found[1]} {numbers[found[1].lower()](int(found[2]))}", str(error),
                          flags=re.IGNORECASE)
            raise native.NativeError(said, error.status, [self.vertex(number) for number in error.vertices]) from error


class Surface:
    """A mesh of which parts are made."""

    def __init__(self, positions, triangles):
        self._positions, self._triangles = positions, triangles
        self._around = self._begin = None  # triangles around each vertex, one after the other, and where they begin

    def part(self, numbers, vertices, roles, smoothness=0):
        """The Part around these vertices, (m,) in their order, which have roles; all others are fixed."""
        near, chosen = vertices, np.zeros(0, np.intp)
        for _ in range(_RINGS):
            chosen = self._triangles_of(near)
            near = np.union1d(near, self._triangles[chosen])
        of_part = np.full(len(near), native.ROLE_FIXED, np.int32)
        of_part[np.searchsorted(near, vertices)] = roles
        triangles = np.searchsorted(near, self._triangles[chosen]).astype(np.int32)
        return Part(numbers, self._positions[near], triangles, of_part, near, chosen, smoothness)

    def _triangles_of(self, vertices):
        """Their numbers, in order."""
        if self._begin is None:
            corners = self._triangles.ravel()
            self._around = np.argsort(corners, kind='stable') // 3
            self._begin = np.concatenate([[0], np.cumsum(np.bincount(corners, minlength=len(self._positions)))])
        counts = self._begin[vertices + 1] - self._begin[vertices]
        places = np.arange(counts.sum()) + np.repeat(self._begin[vertices] - (np.cumsum(counts) - counts), counts)
        return np.unique(self._around[places])
