# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles with reaches of their own, bound and updated as one surface.

The handles of each reach are bound by themselves, to the part of the mesh that they reach, where the vertices of all
other handles are fixed; the displacements of the parts are summed. So a handle moves nothing beyond its reach, the
vertices of each handle go exactly where its empty takes them, and a part whose handles are at rest costs nothing.
"""

import contextlib
import copy
import re
import threading

import numpy as np

from ..library import native
from ..scene import soft_border

# Rings of constrained vertices beside those that may move: K of the highest order reads three of them, refinement two.
_RINGS = 3
_REST = np.eye(4)[:3]
# How far a motion is from none where its empty didn't move: rounding of double precision, of the part's size.
_STILL = 1e-12
# Of the deforming examples' method alone; what doesn't go by examples goes by detail transfer.
_OF_EXAMPLES = ('example_weights', 'example_limits', 'gradients')
# An array with a row for each handle.
_OF_HANDLES = ('turns', 'handle_turns', 'pivots')


class Part:
    """What the handles of one reach are bound to."""

    def __init__(self, numbers, positions, triangles, roles, is_whole):
        """numbers: (k,) of its handles among all. roles: (n,) with its handles counted from 0. is_whole: the mesh as
        a whole, by whose region it goes; else what is around the reach."""
        self.numbers, self.is_whole = numbers, is_whole
        self.vertices = self.triangle_numbers = None  # of the mesh; None: all
        if not is_whole:
            self.vertices, self.triangle_numbers = _around(roles != native.ROLE_FIXED, triangles)
            place_of = np.full(len(positions), -1, np.int32)
            place_of[self.vertices] = np.arange(len(self.vertices), dtype=np.int32)
            positions, roles = positions[self.vertices], roles[self.vertices]
            triangles = place_of[triangles[self.triangle_numbers]]
        self.positions, self.triangles, self.roles = positions, triangles, roles
        self._ways, self._size = None, float(np.abs(positions).max(initial=0))

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

    def is_moved(self, matrices):
        """By any of its handles. matrices: theirs, (k, 3, 4)."""
        change = np.abs(matrices - _REST)
        return change[..., :3].max() > _STILL or change[..., 3].max() > _STILL * self._size

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

    def add(self, offsets, width, result):
        """Adds the offsets, (3 k,), to those of the mesh, (n, 3), fading towards the reach's border by that width."""
        offsets = offsets.reshape(-1, 3)
        if width:
            if self._ways is None:
                self._ways = soft_border.ways(self.roles, self._distances)
            offsets = offsets * soft_border.shares(self._ways, width)[:, None]
        result[slice(None) if self.vertices is None else self.vertices] += offsets

    def _distances(self, chosen):
        return native.distances(self.positions, self.triangles, chosen)


def _around(moves, triangles):
    """Of what may move, with its rings: (k,) vertices and (l,) numbers of triangles."""
    near, chosen = moves.copy(), np.zeros(0, np.intp)
    for _ in range(_RINGS):
        chosen = np.flatnonzero(near[triangles].any(axis=1))
        near[triangles[chosen]] = True
    return np.flatnonzero(near), chosen


class Bind:
    """The binds of all parts, as one job like those of native."""

    def __init__(self, parts, jobs, vertex_count):
        self._parts, self._jobs, self._vertex_count = parts, jobs, vertex_count
        self._made = [None] * len(parts)
        self._drafts = [None] * len(parts)
        self._lock = threading.Lock()  # a render may finish it while the window looks at its progress
        self.cancelled = self._was_drafted = False

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
            if self._was_drafted:
                return None
            for number, job in enumerate(self._jobs):
                if self._made[number] or self._drafts[number]:
                    continue
                self._drafts[number] = job.draft()
                if self._drafts[number] is None:
                    if job.progress()[0]:
                        return None
                    self._finish(number)
            made = [draft or made for draft, made in zip(self._drafts, self._made)]
            self._was_drafted, self._drafts = True, [None] * len(made)
            return Deformer(self._parts, made, self._vertex_count)

    def _finish(self, number):
        with self._parts[number].in_numbers_of_all():
            self._made[number] = self._made[number] or self._jobs[number].finish()

    def cancel(self):
        with self._lock:
            self.cancelled = True
            for job in self._jobs:
                job.cancel()

    def finish(self):
        """The Deformer, or native.NativeError."""
        with self._lock:
            try:
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
        self.info = None if self.is_draft else self._read_info()

    def _moved(self, matrices, asked):
        """(part, what was made for it, its matrices, its options) of the parts whose handles move, and of those that
        show their base."""
        shows_base = asked.get('output') == 'BASE'
        for part, made in zip(self._parts, self._made):
            of_part, told = np.ascontiguousarray(matrices[part.numbers]), part.asked(asked)
            turns = told.get('turns')
            if shows_base or part.is_moved(of_part) or (turns is not None and turns.any()):
                yield part, made, of_part, told

    def offsets(self, matrices, base=None, soft_border=0.0, **asked):
        """As of native.Deformer. soft_border: as of the setting."""
        result = np.zeros((self.vertex_count, 3), np.float32)
        for part, made, of_part, told in self._moved(matrices, asked):
            with part.in_numbers_of_all():
                found = made.offsets(of_part, **told)
                if told.get('output') == 'BASE' and part is not self._parts[0]:
                    # The base of the first is shown, and how the others move theirs.
                    found = found - made.offsets(np.repeat(_REST[None], len(of_part), axis=0), **told)
            part.add(found, soft_border, result)
        if self.info is not None:
            self.info = self._read_info()
        return result.ravel()

    def update(self, matrices, wait=False, base=None, soft_border=0.0, **asked):
        """As of native.Deformer."""
        return _Update(list(self._moved(matrices, asked)), self.vertex_count, soft_border, wait)

    def example_weights(self):
        return self._made[0].example_weights()

    def vertices(self, finding):
        """(k,) int32: each once."""
        found = [made.vertices(finding) if part.vertices is None else part.vertices[made.vertices(finding)]
                 for part, made in zip(self._parts, self._made)]
        return np.unique(np.concatenate(found)).astype(np.int32)

    def _read_info(self):
        """That of the first part, which is the largest, with what others have found that it hasn't."""
        info = copy.copy(self._made[0].info)
        info.vertex_count = self.vertex_count
        info.handle_count = sum(len(part.numbers) for part in self._parts)
        free = np.zeros(self.vertex_count, bool)
        for part in self._parts:
            follows = np.flatnonzero(part.roles == native.ROLE_FREE)
            free[follows if part.vertices is None else part.vertices[follows]] = True
        info.free_count = int(free.sum())
        for part, made in zip(self._parts, self._made):
            of_part = made.info
            if of_part.idle_handle_count and (part is self._parts[0] or not info.idle_handle_count):
                info.idle_handle_count = of_part.idle_handle_count
                info.idle_handle_example = int(part.numbers[of_part.idle_handle_example])
            if part is self._parts[0] and part.is_whole:
                continue
            for name in ('resting', 'loose', 'unrepresented'):
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
    """As native.Update, of the parts that move."""

    def __init__(self, moved, vertex_count, width, wait):
        self._parts, self._jobs = [part for part, _, _, _ in moved], []
        self._vertex_count, self._width, self.cancelled = vertex_count, width, False
        try:
            for part, made, matrices, told in moved:
                with part.in_numbers_of_all():
                    self._jobs.append(made.update(matrices, wait=wait, **told))
        except native.NativeError:
            self.close()
            raise

    def progress(self):
        """(running, fraction, stage)"""
        states = [job.progress() for job in self._jobs] or [(False, 1.0, "Done")]
        running = [state for state in states if state[0]]
        return bool(running), sum(state[1] for state in states) / len(states), (running or states)[0][2]

    def cancel(self):
        self.cancelled = True
        for job in self._jobs:
            job.cancel()

    def close(self):
        for job in self._jobs:
            job.close()

    def finish(self):
        """Waits; (3 n,) float32 offsets and what is known of the part that is worst, or native.NativeError."""
        result, infos = np.zeros((self._vertex_count, 3), np.float32), []
        try:
            for part, job in zip(self._parts, self._jobs):
                with part.in_numbers_of_all():
                    offsets, info = job.finish()
                part.add(offsets, self._width, result)
                infos.append(info)
        finally:
            self.close()
        return result.ravel(), max(infos, key=lambda info: (not info.volumes_converged, info.volume_error),
                                   default=native.UpdateInfo())
