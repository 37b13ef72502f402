# SPDX-License-Identifier: GPL-3.0-or-later
"""A deformer that consists of several parts (reaches.py).

The parts deform the surface one after the other: p' = p + F d, where p are the positions that the earlier parts have
produced, F their deformation gradients and d the displacements of the part. F is smoothed, as gradients of details
would add these details a second time. The motion of a part's handles is taken relative to the surface at that point, so
that their vertices end where the empties are. So a handle moves nothing outside of its reach, and a part whose handles
haven't moved costs nothing.
"""

import copy
import threading

import numpy as np
from mathutils import Matrix

from ..library import native
from ..scene.rotations import nearest_rotations

# Radians: only handles that have turned farther count in the estimate of the surface's whole turns. Safety: a margin
# below π, at which the shortest rotation vector flips.
_FAR_TURN = 0.75 * np.pi


def rotation_vector(gradient):
    """(3,): the shortest rotation vector of the rotation in a gradient (by polar decomposition)."""
    turn = Matrix(nearest_rotations(gradient).tolist()).to_quaternion()
    axis, angle = turn.to_axis_angle()
    return np.array(axis) * (angle - 2 * np.pi * (angle > np.pi))


def nearest_turn(shortest, to):
    """(3,): of all rotation vectors with the same rotation as the shortest one, the nearest to another vector."""
    angle = np.linalg.norm(shortest)
    axis = shortest / angle if angle > 1e-6 else to / max(np.linalg.norm(to), 1e-300)
    return axis * (angle + 2 * np.pi * np.round((to @ axis - angle) / (2 * np.pi)))


class _Composition:
    """The surface during an update, with the offsets of the parts so far."""

    def __init__(self, vertex_count, matrices, arguments, width, arriving):
        """matrices: (h, 3, 4), of all handles. arguments: the options of the update. width: of the soft border.
        arriving: Deformer.arriving."""
        self.offsets = np.zeros((vertex_count, 3), np.float32)
        self._matrices, self._arguments, self._width = matrices, arguments, width
        self._shows_base = arguments.get('output') == 'BASE'  # then base displacements are added up without F
        self._gradients, self._is_changed = None, False
        turns = arguments.get('turns')
        # (h, 3) rotation vectors. Those of a part that was updated: relative to the surface before its update.
        self._turns = np.zeros((len(matrices), 3)) if turns is None else turns.copy()
        self._turn, self._arriving = self._turns.any(axis=1), arriving

    def call_for(self, part):
        """(matrices, options) for the part's update; None if its handles don't move it."""
        matrices, before = np.ascontiguousarray(self._matrices[part.numbers]), None
        self._gradients = None
        if self._is_changed and not self._shows_base:
            before = self.offsets[part.rows]
            self._gradients = part.gradients(before)
        matrices = part.relative(matrices, before, self._gradients)
        arguments = part.update_arguments(self._arguments)
        if self._gradients is not None and self._turn.any():
            arguments['turns'] = self._relative_turns(part, arguments['turns'])
            self._turns[part.numbers] = arguments['turns']
        # With examples also sliders move the surface, and their weights are read after the update.
        moves = (self._shows_base or part.is_moved(matrices) or self._turn[part.numbers].any()
                 or part.is_whole and arguments.get('method') == 'EXAMPLES')
        return (matrices, arguments) if moves else None

    def _relative_turns(self, part, turns):
        """(h, 3) rotation vectors: how far its handles turn relative to the surface. The surface's own rotation is
        known from F up to whole turns. The whole turns are estimated from the handles that have turned it, each times
        the share of its motion that arrives at the handle."""
        result = turns.copy()
        far = np.flatnonzero(np.linalg.norm(self._turns, axis=1) > _FAR_TURN)
        arrives = self._arriving(part, far) if len(far) else np.zeros((len(turns), 0))
        for number, share in enumerate(arrives):
            turned = rotation_vector(self._gradients[part.held[number]].mean(axis=0, dtype=np.float64))
            result[number] -= nearest_turn(turned, share @ self._turns[far])
        return result

    def add(self, part, offsets):
        """offsets: (3 k,), the result of the part's update."""
        offsets = part.faded(offsets, self._width)
        if self._gradients is not None:
            offsets = np.einsum('nij,nj->ni', self._gradients, offsets)
        self.offsets[part.rows] += offsets
        self._is_changed = True


class Deformer:
    """The interface of native.Deformer, or of native.Draft if a part is a draft, for several parts."""

    fades = True  # its updates apply the soft border themselves, as each part has a border of its own

    def __init__(self, parts, made, vertex_count):
        self._parts, self._made, self.vertex_count = parts, made, vertex_count
        self.is_draft = any(each.is_draft for each in made)
        free = np.zeros(vertex_count, bool)
        for part in parts:
            free[part.rows] |= part.roles == native.ROLE_FREE
        self._free_count = int(free.sum())
        self._shares = {}  # {(index of a part, handle): column of arriving()}

    def arriving(self, part, handles):
        """(h, k): the share of the motions of k handles, indices among all, that arrives at the h handles of a part:
        the mean displacement of the base there for a unit translation."""
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
            at_rest = native.at_rest(len(other.numbers))
            stepped = at_rest.copy()
            stepped[np.flatnonzero(other.numbers == handle)[0], 0, 3] = other.size
            before, after = (made.offsets(matrices, output='BASE', method='DETAIL', base_deformer='LINEAR', refine=0)
                             for matrices in (at_rest, stepped))
            steps = np.zeros(self.vertex_count)
            steps[other.rows] = (after - before)[::3] / other.size
            return [steps[part.rows][held].mean() for held in part.held]
        return np.zeros(len(part.numbers))

    def offsets(self, matrices, base=None, soft_border=0.0, **arguments):
        """As native.Deformer.offsets. soft_border: the setting."""
        surface = _Composition(self.vertex_count, matrices, arguments, soft_border, self.arriving)
        for part, made in zip(self._parts, self._made):
            call = surface.call_for(part)
            if call:
                with part.in_numbers_of_all():
                    surface.add(part, self._offsets(part, made, *call))
        return surface.offsets.ravel()

    def _offsets(self, part, made, matrices, arguments):
        found = made.offsets(matrices, **arguments)
        if arguments.get('output') == 'BASE' and part is not self._parts[0]:
            # The base of the first part is shown, with the base displacements of the others.
            found = found - made.offsets(native.at_rest(len(matrices)), **arguments)
        return found

    def update(self, matrices, wait=False, base=None, soft_border=0.0, **arguments):
        """As native.Deformer.update."""
        surface = _Composition(self.vertex_count, matrices, arguments, soft_border, self.arriving)
        return _Update(self._parts, self._made, surface, wait)

    def example_weights(self):
        return self._made[0].example_weights()

    def vertices(self, finding):
        """(k,) int32: the vertices with this finding in any part, ascending."""
        found = [made.vertices(finding) if part.vertices is None else part.vertices[made.vertices(finding)]
                 for part, made in zip(self._parts, self._made)]
        return np.unique(np.concatenate(found)).astype(np.int32)

    @property
    def info(self):
        """As native.Deformer.info; a draft has none. Figures are sums or those of the first part, the largest; findings
        are of any part."""
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
            # 'resting' is left out on purpose: vertices of a reach that no edges connect with its handle stay in place,
            # which users expect.
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
    """The interface of native.Update. The parts are updated one after the other, as each starts from the surface that
    the earlier ones have produced."""

    def __init__(self, parts, made, surface, wait):
        self._left, self._count = list(zip(parts, made)), len(parts)
        self._surface, self._wait, self._infos = surface, wait, []
        self._part = self._job = None
        self._lock = threading.Lock()
        self.cancelled, self._failed = False, None
        self._go_on()

    def _go_on(self):
        """Starts the update of the next part that is moved, if there is one. Raises native.NativeError."""
        while self._left and not self._job:
            part, made = self._left[0]
            call = self._surface.call_for(part)
            if call:
                matrices, arguments = call
                with part.in_numbers_of_all():
                    self._part, self._job = part, made.update(matrices, wait=self._wait, **arguments)
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
            running, fraction, stage = self._job.progress() if self._job else (False, 0.0, 'DONE')
            if not running and self._left and not self.cancelled:
                try:
                    if self._job:
                        self._take()
                    self._go_on()
                except native.NativeError as error:
                    if not error.busy:
                        self._left.clear()
                        self._failed = error
                # If the deformer is busy with another object's update, the next call tries again.
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
        """Waits for the result: (3 n,) float32 offsets, and the UpdateInfo of the part with the largest volume error.
        Or raises native.NativeError."""
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
