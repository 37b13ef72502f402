# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles with reaches of their own, bound and updated as one surface.

The handles of each reach are a part of the binding, bound by themselves to the mesh around what they reach; those
without a reach are the first part, bound to the region. Each part deforms what the parts before it have made of the
surface: its own displacements d are turned along with that, p' = p + F d. F are the deformation gradients of what was
made so far, without its details: d is large beside these, and would show them twice. What its handles are asked for is
relative to where the surface has their vertices by then, so that their places and turns are those of their empties. A
handle so moves nothing beyond its reach, and what is not moved costs nothing.
"""

import contextlib
import copy
import re
import threading

import numpy as np
from mathutils import Matrix

from ..library import native
from ..scene import soft_border

# Rings of constrained vertices beside those that may move: K of the highest order reads three of them, refinement two.
_RINGS = 3
_REST = np.eye(4)[:3]
# How far a motion is from none where its empty didn't move: rounding of double precision, of the part's size.
_STILL = 1e-12
# The least determinant of F at a handle: a surface that is flattened further tells no motion, and nothing is turned.
_FLATTEST = 1e-3
# Radians of a rotation vector: up to there a surface that goes along has turned the shortest way.
_HALF = 0.75 * np.pi
# Of how much places vary along one direction, in squares, beside how much they do along another.
_LEAST_VARIATION = 1e-4
# Of the method Examples alone; what has a reach of its own goes by detail transfer then.
_OF_EXAMPLES = ('example_weights', 'example_limits', 'gradients')
# An array with a row for each handle.
_OF_HANDLES = ('turns', 'handle_turns', 'pivots')


class Part:
    """What the handles of one reach are bound to."""

    def __init__(self, numbers, positions, triangles, roles, vertices=None, triangle_numbers=None):
        """numbers: (h,) of its handles among all. positions, triangles, roles: as of native.Bind, of the mesh that it
        is bound to, with its handles counted from 0. vertices, triangle_numbers: of that in the whole mesh; None: it is
        the whole, by whose region these handles go."""
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
        return told if self.is_whole else {name: value for name, value in told.items() if name != 'examples'}

    def asked(self, of_all):
        """Of its update; of_all: that of the whole."""
        found = {name: value[self.numbers] if name in _OF_HANDLES and value is not None else value
                 for name, value in of_all.items()}
        if not self.is_whole and found.get('method') == 'EXAMPLES':
            found = {name: value for name, value in found.items() if name not in _OF_EXAMPLES}
            found['method'] = 'TRANSFER'
        return found

    def of(self, offsets):
        """Its vertices' rows of the mesh's (n, 3)."""
        return offsets if self.vertices is None else offsets[self.vertices]

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


def rotation_vector(gradient):
    """(3,): of the rotation of a gradient, the shortest."""
    left, _, right = np.linalg.svd(gradient)
    left[:, 2] *= np.linalg.det(left @ right)
    turn = Matrix((left @ right).tolist()).to_quaternion()
    axis, angle = turn.to_axis_angle()
    return np.array(axis) * (angle - 2 * np.pi * (angle > np.pi))


def nearest_turn(shortest, to):
    """(3,): of the rotation vectors that turn as the shortest one does, the nearest to another vector."""
    angle = np.linalg.norm(shortest)
    axis = shortest / angle if angle > 1e-6 else to / max(np.linalg.norm(to), 1e-300)
    return axis * (angle + 2 * np.pi * np.round((to @ axis - angle) / (2 * np.pi)))


class Surface:
    """A mesh of which parts are made."""

    def __init__(self, positions, triangles):
        self._positions, self._triangles = positions, triangles
        self._around = self._begin = None  # triangles around each vertex, one after the other, and where they begin

    def part(self, numbers, vertices, roles):
        """The Part around these vertices, (m,) in their order, which have roles; all others are fixed."""
        near, chosen = vertices, np.zeros(0, np.intp)
        for _ in range(_RINGS):
            chosen = self._triangles_of(near)
            near = np.union1d(near, self._triangles[chosen])
        of_part = np.full(len(near), native.ROLE_FIXED, np.int32)
        of_part[np.searchsorted(near, vertices)] = roles
        triangles = np.searchsorted(near, self._triangles[chosen]).astype(np.int32)
        return Part(numbers, self._positions[near], triangles, of_part, near, chosen)

    def _triangles_of(self, vertices):
        """Their numbers, in order."""
        if self._begin is None:
            corners = self._triangles.ravel()
            self._around = np.argsort(corners, kind='stable') // 3
            self._begin = np.concatenate([[0], np.cumsum(np.bincount(corners, minlength=len(self._positions)))])
        counts = self._begin[vertices + 1] - self._begin[vertices]
        places = np.arange(counts.sum()) + np.repeat(self._begin[vertices] - (np.cumsum(counts) - counts), counts)
        return np.unique(self._around[places])


class _Composition:
    """A surface as it is deformed part by part."""

    def __init__(self, vertex_count, matrices, asked, width, arriving):
        """matrices: (h, 3, 4), of all handles. asked: of the update. width: of the soft border. arriving: of
        Deformer.arriving."""
        self.offsets = np.zeros((vertex_count, 3), np.float32)
        self._matrices, self._asked, self._width = matrices, asked, width
        self._shows_base = asked.get('output') == 'BASE'  # whose parts are summed: what is carried are details
        self._gradients, self._is_changed = None, False
        turns = asked.get('turns')
        self._turns = np.zeros((len(matrices), 3)) if turns is None else turns.copy()  # beside what is turned before
        self._turn, self._arriving = self._turns.any(axis=1), arriving

    def asks(self, part):
        """(matrices, options) of the part's update; None where nothing moves it."""
        matrices, before = np.ascontiguousarray(self._matrices[part.numbers]), None
        self._gradients = None
        if self._is_changed and not self._shows_base:
            before = part.of(self.offsets)
            self._gradients = part.gradients(before)
        matrices = part.relative(matrices, before, self._gradients)
        told = part.asked(self._asked)
        if self._gradients is not None and self._turn.any():
            told['turns'] = self._relative_turns(part, told['turns'])
            self._turns[part.numbers] = told['turns']
        # By examples the shape has more to go by than handles, and their weights are read afterwards.
        moves = (self._shows_base or part.is_moved(matrices) or self._turn[part.numbers].any()
                 or part.is_whole and told['method'] == 'EXAMPLES')
        return (matrices, told) if moves else None

    def _relative_turns(self, part, turns):
        """(h, 3) rotation vectors: how far its handles turn beside the surface, whose own turn is told by gradients but
        for whole turns; these are told by the handles that have turned it, and by how much of each arrives there."""
        result = turns.copy()
        far = np.flatnonzero(np.linalg.norm(self._turns, axis=1) > _HALF)
        arrives = self._arriving(part, far) if len(far) else np.zeros((len(turns), 0))
        for number, share in enumerate(arrives):
            turned = rotation_vector(self._gradients[part.held[number]].mean(axis=0, dtype=np.float64))
            result[number] -= nearest_turn(turned, share @ self._turns[far])
        return result

    def add(self, part, offsets):
        """offsets: (3 k,), what the part's update gave."""
        offsets = part.faded(offsets, self._width)
        if self._gradients is not None:
            offsets = np.einsum('nij,nj->ni', self._gradients, offsets)
        self.offsets[slice(None) if part.vertices is None else part.vertices] += offsets
        self._is_changed = True


class Bind:
    """The binds of all parts, as one job like those of native."""

    def __init__(self, parts, jobs, vertex_count):
        self._parts, self._jobs, self._vertex_count = parts, jobs, vertex_count
        self._made = [None] * len(parts)
        self._drafts = [None] * len(parts)
        self._lock = threading.Lock()  # a render may finish it while the window looks at its progress
        self.cancelled = self._was_drafted = False
        self._failed = None

    def progress(self):
        """(running, fraction, stage)"""
        with self._lock:
            states = [(False, 1.0, "Done") if made else job.progress() for job, made in zip(self._jobs, self._made)]
        sizes = [len(part.positions) for part in self._parts]
        fraction = sum(size * state[1] for size, state in zip(sizes, states)) / sum(sizes)
        running = [state for state in states if state[0]]
        return bool(running), fraction, (running or states)[0][2]

    def draft(self):
        """As of native.Bind: there once each part has one, or is done."""
        with self._lock:
            if self._was_drafted or self._failed:
                return None
            for number, job in enumerate(self._jobs):
                if self._made[number] or self._drafts[number]:
                    continue
                self._drafts[number] = job.draft()
                if self._drafts[number] is None:
                    if job.progress()[0]:
                        return None
                    try:
                        self._finish(number)
                    except native.NativeError as error:
                        self._failed = error  # who waits for all will be told
                        self._cancel()
                        return None
            made = [draft or made for draft, made in zip(self._drafts, self._made)]
            self._was_drafted, self._drafts = True, [None] * len(made)
            return Deformer(self._parts, made, self._vertex_count)

    def _finish(self, number):
        with self._parts[number].in_numbers_of_all():
            self._made[number] = self._made[number] or self._jobs[number].finish()

    def cancel(self):
        with self._lock:
            self.cancelled = True
            self._cancel()

    def _cancel(self):
        for job in self._jobs:
            job.cancel()

    def finish(self):
        """The Deformer, or native.NativeError."""
        with self._lock:
            try:
                if self._failed:
                    raise self._failed
                for number in range(len(self._parts)):
                    self._finish(number)
            except native.NativeError:
                self._close()
                raise
            return Deformer(self._parts, self._made, self._vertex_count)

    def close(self):
        with self._lock:
            self._close()

    def _close(self):
        for job in self._jobs:
            job.close()


class Deformer:
    """As native.Deformer, or native.Draft where any part is one, of several parts."""

    fades = True  # by an option of its updates: each part has a border of its own

    def __init__(self, parts, made, vertex_count):
        self._parts, self._made, self.vertex_count = parts, made, vertex_count
        self.is_draft = any(each.is_draft for each in made)
        free = np.zeros(vertex_count, bool)
        for part in parts:
            follows = np.flatnonzero(part.roles == native.ROLE_FREE)
            free[follows if part.vertices is None else part.vertices[follows]] = True
        self._free_count = int(free.sum())
        self._shares = {}  # by part and handle: of arriving()

    def arriving(self, part, handles):
        """(h, k): at the handles of a part, how much arrives there of what each of these handles, by their numbers
        among all, moves: what the base surface makes of a unit step."""
        place, result = self._parts.index(part), np.zeros((len(part.numbers), len(handles)))
        for column, handle in enumerate(handles):
            if (place, handle) not in self._shares:
                self._shares[place, handle] = self._arriving(part, place, handle)
            result[:, column] = self._shares[place, handle]
        return result

    def _arriving(self, part, place, handle):
        for other, made in zip(self._parts[:place], self._made):
            if handle not in other.numbers:
                continue
            at_rest = np.repeat(_REST[None], len(other.numbers), axis=0)
            stepped = at_rest.copy()
            stepped[np.flatnonzero(other.numbers == handle)[0], 0, 3] = other.size
            before, after = (made.offsets(matrices, output='BASE', method='TRANSFER', base_deformer='LINEAR', refine=0)
                             for matrices in (at_rest, stepped))
            steps = np.zeros(self.vertex_count)
            steps[slice(None) if other.is_whole else other.vertices] = (after - before)[::3] / other.size
            return [part.of(steps)[held].mean() for held in part.held]
        return np.zeros(len(part.numbers))

    def offsets(self, matrices, base=None, soft_border=0.0, **asked):
        """As of native.Deformer. soft_border: as of the setting."""
        surface = _Composition(self.vertex_count, matrices, asked, soft_border, self.arriving)
        for part, made in zip(self._parts, self._made):
            asks = surface.asks(part)
            if asks:
                with part.in_numbers_of_all():
                    surface.add(part, self._offsets(part, made, *asks))
        return surface.offsets.ravel()

    def _offsets(self, part, made, matrices, told):
        found = made.offsets(matrices, **told)
        if told.get('output') == 'BASE' and part is not self._parts[0]:
            # The base of the first is shown, and how the others move theirs.
            found = found - made.offsets(np.repeat(_REST[None], len(matrices), axis=0), **told)
        return found

    def update(self, matrices, wait=False, base=None, soft_border=0.0, **asked):
        """As of native.Deformer."""
        surface = _Composition(self.vertex_count, matrices, asked, soft_border, self.arriving)
        return _Update(self._parts, self._made, surface, wait)

    def example_weights(self):
        return self._made[0].example_weights()

    def vertices(self, finding):
        """(k,) int32: each once."""
        found = [made.vertices(finding) if part.vertices is None else part.vertices[made.vertices(finding)]
                 for part, made in zip(self._parts, self._made)]
        return np.unique(np.concatenate(found)).astype(np.int32)

    @property
    def info(self):
        """As of native.Deformer; not of a draft. That of the first part, which is the largest, with what others have
        found and it hasn't."""
        info = copy.copy(self._made[0].info)
        info.vertex_count = self.vertex_count
        info.handle_count = sum(len(part.numbers) for part in self._parts)
        info.free_count = self._free_count
        for part, made in zip(self._parts, self._made):
            of_part = made.info
            if of_part.idle_handle_count and (part is self._parts[0] or not info.idle_handle_count):
                info.idle_handle_count = of_part.idle_handle_count
                info.idle_handle_example = int(part.numbers[of_part.idle_handle_example])
            if part is self._parts[0] and part.is_whole:
                continue
            # What of a reach no handle of it leads to only stays as it is.
            for name in ('loose', 'unrepresented'):
                _take_over(info, of_part, name, part.vertex, part is self._parts[0])
            _take_over(info, of_part, 'degenerate', part.triangle, part is self._parts[0])
        for name in ('bind_seconds', 'bytes'):
            setattr(info, name, sum(getattr(made.info, name) for made in self._made))
        return info


def _take_over(info, of_part, name, number_of, is_first):
    count, example = f'{name}_count', f'{name}_example'
    if getattr(of_part, count) and (is_first or not getattr(info, count)):
        setattr(info, count, getattr(of_part, count))
        setattr(info, example, number_of(getattr(of_part, example)))


class _Update:
    """As native.Update: of one part after the other, as each starts from what those before it have made."""

    def __init__(self, parts, made, surface, wait):
        self._left, self._count = list(zip(parts, made)), len(parts)
        self._surface, self._wait, self._infos = surface, wait, []
        self._part = self._job = None
        self._lock = threading.Lock()
        self.cancelled, self._failed = False, None
        self._go_on()

    def _go_on(self):
        """Begins the next that is moved, if there is one. Raises native.NativeError."""
        while self._left and not self._job:
            part, made = self._left[0]
            asks = self._surface.asks(part)
            if asks:
                matrices, told = asks
                with part.in_numbers_of_all():
                    self._part, self._job = part, made.update(matrices, wait=self._wait, **told)
            self._left.pop(0)

    def _take(self):
        job, self._job = self._job, None
        with self._part.in_numbers_of_all():
            offsets, info = job.finish()
        self._surface.add(self._part, offsets)
        self._infos.append(info)

    def progress(self):
        """(running, fraction, stage)"""
        with self._lock:
            running, fraction, stage = self._job.progress() if self._job else (False, 0.0, "Done")
            if not running and self._left and not self.cancelled:
                try:
                    if self._job:
                        self._take()
                    self._go_on()
                except native.NativeError as error:
                    if not error.busy:
                        self._left.clear()
                        self._failed = error
                # Where another object's update is under way, it is tried again.
                running, fraction = bool(self._job or self._left), 0.0
            return running, 1 - (len(self._left) + (1 - fraction) * bool(self._job)) / self._count, stage

    def cancel(self):
        with self._lock:
            self.cancelled = True
            if self._job:
                self._job.cancel()

    def close(self):
        with self._lock:
            self._left.clear()
            if self._job:
                self._job.close()

    def finish(self):
        """Waits; (3 n,) float32 offsets and what is known of the part that is worst, or native.NativeError."""
        with self._lock:
            self._wait = True
            while self._job or (self._left and not self.cancelled):
                if self._job:
                    self._take()
                self._go_on()
            if self._failed:
                raise self._failed
            if self.cancelled:
                raise native.NativeError("It was cancelled.")
        worst = max(self._infos, key=lambda info: (not info.volumes_converged, info.volume_error),
                    default=native.UpdateInfo(volumes_converged=1))
        return self._surface.offsets.ravel(), worst
