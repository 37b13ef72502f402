# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles with a reach of their own: the binding consists of a part for each reach.

The handles of a reach are bound by themselves, to the part of the mesh around its vertices. Handles without a reach
form the first part, which is bound to the region. composed_deformer.py combines the parts into one surface.
"""

import contextlib

import numpy as np

from ..library import native
from ..scene import soft_border

# Rings of constrained vertices that a part contains around its free ones: the system K of order 3 involves three of
# them, refinement two.
_RINGS = 3
_REST = np.eye(4)[:3]
# The motion of a handle counts as none up to this difference from the identity: rounding in double precision; of
# translations as a fraction of the part's size.
_STILL = 1e-12
# Least det F at a handle. Safety: a flatter surface tells no rotation, and F, which relative() inverts, is nearly
# singular: F = I is used then.
_FLATTEST = 1e-3
# The fit of F has no slope along directions in which the squared extent of the part is less than this fraction of the
# largest, as across a flat part.
_LEAST_VARIATION = 1e-4
# Options of the method Examples. Parts with a reach use detail transfer instead of it.
_OF_EXAMPLES = ('example_weights', 'example_limits', 'gradients')
# Options with a row for each handle.
_OF_HANDLES = ('turns', 'handle_turns', 'pivots')


class Part:
    """The handles of one reach, and the mesh that they are bound to."""

    def __init__(self, numbers, positions, triangles, roles, vertices=None, triangle_numbers=None, smoothness=0):
        """numbers: (h,) indices of its handles among all. positions, triangles, roles: as for native.Bind, of the
        part's own mesh, with its handles counted from 0. vertices, triangle_numbers: indices of these in the whole
        mesh; None for the part of the region, whose mesh is the whole one. smoothness: the order of its base energy; 0:
        the object's."""
        self.smoothness = smoothness
        self.numbers, self.vertices, self.triangle_numbers = numbers, vertices, triangle_numbers
        self.positions, self.triangles, self.roles = positions, triangles, roles
        self.size = float(np.abs(positions).max(initial=0))
        order = np.argsort(roles, kind='stable')
        self.held = np.split(order, np.searchsorted(roles[order], np.arange(len(numbers) + 1)))[1:-1]
        self._ways = self._smooth = None

    @property
    def is_whole(self):
        return self.vertices is None

    def bind_arguments(self):
        """The positional arguments of native.Bind."""
        return self.positions, self.triangles, self.roles, len(self.numbers)

    def bind_options(self, of_all):
        """The options of its native.Bind. of_all: those of the object."""
        if self.is_whole:
            return of_all
        own = {'smoothness': self.smoothness} if self.smoothness else {}
        if 'stiffness' in of_all:
            own['stiffness'] = of_all['stiffness'][self.vertices]
        return {name: value for name, value in of_all.items() if name != 'examples'} | own

    def update_arguments(self, of_all):
        """The options of its update. of_all: those of the object."""
        found = {name: value[self.numbers] if name in _OF_HANDLES and value is not None else value
                 for name, value in of_all.items()}
        if not self.is_whole and found.get('method') == 'EXAMPLES':
            found = {name: value for name, value in found.items() if name not in _OF_EXAMPLES}
            found['method'] = 'DETAIL'
        return found

    @property
    def rows(self):
        """The index of its vertices in arrays with a row for each vertex of the whole mesh."""
        return slice(None) if self.vertices is None else self.vertices

    def gradients(self, before):
        """(k, 3, 3): the deformation gradients F of the surface that earlier parts have deformed, smoothed to a linear
        function of position. before: (k, 3), the offsets by those parts. None if these are zero."""
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
        """(k, 4) and (4, k): the values of 1, x, y, z at the vertices, and the matrix that takes values at the vertices
        to the coefficients of the weighted least squares fit. Weights: a vertex' area, and the square of its share of
        the way from the border to the handles."""
        places = self.positions.astype(np.float64)
        a, b, c = np.moveaxis(places[self.triangles], 1, 0)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        weights = self.shares_of_way() ** 2 * sum(
            np.bincount(self.triangles[:, k], areas, minlength=len(places)) for k in range(3))
        if not weights.any():  # no triangle has an area
            weights = np.ones(len(places))
        weights /= weights.sum()
        middle = weights @ places
        size = max(np.abs(places - middle).max(initial=0), 1e-300)
        functions = np.concatenate([np.ones((len(places), 1)), (places - middle) / size], axis=1)
        weighted = functions.T * weights
        # The pseudoinverse gives no slope across a plane, where no value varies.
        return functions, np.linalg.pinv(weighted @ functions, rcond=_LEAST_VARIATION, hermitian=True) @ weighted

    def shares_of_way(self):
        """(k,): as soft_border.border_fractions."""
        if self._ways is None:
            self._ways = soft_border.border_fractions(self.roles, lambda chosen: native.distances(
                self.positions, self.triangles, chosen))
        return self._ways

    def relative(self, matrices, before, gradients):
        """(h, 3, 4): the motions of its handles relative to the surface that earlier parts have deformed."""
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
        """Whether any of its handles moves it. matrices: (h, 3, 4), their motions."""
        change = np.abs(matrices - _REST)
        return change[..., :3].max() > _STILL or change[..., 3].max() > _STILL * self.size

    def faded(self, offsets, width):
        """(k, 3): its offsets, (3 k,), faded towards its border. width: of the soft border."""
        offsets = offsets.reshape(-1, 3)
        if not width:
            return offsets
        return offsets * soft_border.fade_weights(self.shares_of_way(), width)[:, None]

    def vertex(self, number):
        """The index in the whole mesh of a vertex of the part."""
        return number if self.vertices is None else int(self.vertices[number])

    def triangle(self, number):
        """The index in the whole mesh of a triangle of the part."""
        return number if self.triangle_numbers is None else int(self.triangle_numbers[number])

    @contextlib.contextmanager
    def in_numbers_of_all(self):
        """Errors of the library that are raised meanwhile are about handles, vertices and triangles of the whole
        mesh."""
        numbers = {'HANDLE': lambda number: int(self.numbers[number]), 'VERTEX': self.vertex, 'TRIANGLE': self.triangle}
        try:
            yield
        except native.NativeError as error:
            index = numbers[error.subject](error.index) if error.subject in numbers else error.index
            raise error.about(index, [self.vertex(number) for number in error.vertices]) from error


class Surface:
    """The whole mesh, for making parts of it."""

    def __init__(self, positions, triangles):
        self._positions, self._triangles = positions, triangles
        self._around = self._begin = None  # triangles at each vertex, consecutively, and the index of the first of each

    def part(self, numbers, vertices, roles, smoothness=0):
        """The Part around these vertices, (m,) ascending, with roles, (m,); vertices beside them are fixed."""
        near, chosen = vertices, np.zeros(0, np.intp)
        for _ in range(_RINGS):
            chosen = self._triangles_of(near)
            near = np.union1d(near, self._triangles[chosen])
        of_part = np.full(len(near), native.ROLE_FIXED, np.int32)
        of_part[np.searchsorted(near, vertices)] = roles
        triangles = np.searchsorted(near, self._triangles[chosen]).astype(np.int32)
        return Part(numbers, self._positions[near], triangles, of_part, near, chosen, smoothness)

    def _triangles_of(self, vertices):
        """The triangles at any of these vertices, ascending."""
        if self._begin is None:
            corners = self._triangles.ravel()
            self._around = np.argsort(corners, kind='stable') // 3
            self._begin = np.concatenate([[0], np.cumsum(np.bincount(corners, minlength=len(self._positions)))])
        counts = self._begin[vertices + 1] - self._begin[vertices]
        places = np.arange(counts.sum()) + np.repeat(self._begin[vertices] - (np.cumsum(counts) - counts), counts)
        return np.unique(self._around[places])
