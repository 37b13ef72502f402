# SPDX-License-Identifier: GPL-3.0-or-later
"""Bound surfaces: made, updated, and updated slowly."""

import threading

import numpy as np

from .jobs import Job, JobResult
from . import structs
from .loading import Owned, call, call_when_free, count, filled, vertices
from .structs import FINDINGS, ROLES, BindOptions, Info, UpdateInfo, UpdateOptions, contiguous, points_out

ROLE_FREE, ROLE_FIXED = ROLES['FREE'], ROLES['FIXED']


def update_options(**options):
    """dd_update_options for offsets, by the names of its fields and of its enums' values; for single methods' settings
    by the keywords of structs.METHOD_FIELDS. None stands for the default."""
    of_methods = {}
    for keyword, (field, name) in structs.METHOD_FIELDS.items():
        value = options.pop(keyword, None)
        if value is not None:
            of_methods.setdefault(field, {})[name] = value
    nested = {field: filled(UpdateOptions.kinds[field].struct, **values) for field, values in of_methods.items()}
    return filled(UpdateOptions, values='OFFSETS', **options, **nested)


def at_rest(handle_count):
    """(h, 3, 4): the matrices of handles that don't move."""
    return np.repeat(np.eye(4)[None, :3], handle_count, axis=0)


class Bind(Job):
    """A bind under way; finish() gives the Deformer."""

    def __init__(self, positions, triangles, roles, handle_count, **options):
        """positions: (n, 3) float32; triangles: (m, 3) int32; roles: (n,) int32, ROLE_FREE, ROLE_FIXED or a handle
        number below handle_count. options: by the names of dd_bind_options' fields; base (n, 3), examples
        (count, n, 3). All are copied."""
        roles = contiguous('roles', roles, np.int32)
        super().__init__('dd_deformer_bind_start', structs.mesh(positions, triangles), roles, len(roles), handle_count,
                         filled(BindOptions, **options))
        self._vertex_count, self._example_count = len(roles), count(options.get('examples'))

    def draft(self):
        """The Draft, once it is there and was not asked for before; else None."""
        draft = Draft(self, self._vertex_count)
        return draft if draft.is_there else None

    def finish(self):
        return Deformer(self, self._example_count)


class Draft(Owned):
    """What a bind shows before it is done, where it was told so by its option draft."""

    free = 'dd_draft_free'
    is_draft, fades = True, False

    def __init__(self, bind, vertex_count):
        self.vertex_count = vertex_count
        self._lock = threading.Lock()
        self._make('dd_job_take_draft', bind)
        self.is_there = bool(self._handle)

    def offsets(self, matrices, base=None, **options):
        """As of Deformer."""
        matrices = contiguous('matrices', matrices, np.float64, 3, 4)
        found = np.empty(3 * self.vertex_count, np.float32)
        with self._lock:
            call('dd_draft_update', self, matrices, len(matrices), update_options(base=base, **options),
                 points_out(found))
        return found


class Deformer(JobResult):
    """A bound surface. One update at a time: renders come from another thread than the window."""

    take_function, free = 'dd_job_take_deformer', 'dd_deformer_free'
    is_draft, fades = False, False

    def __init__(self, job, example_count=0):
        super().__init__(job)
        self._example_count = example_count
        self._lock = threading.Lock()
        self.info = self._read_info()

    @property
    def vertex_count(self):
        return self.info.vertex_count

    def _read_info(self):
        info = Info()
        call_when_free('dd_deformer_get_info', self, info)
        return info

    def offsets(self, matrices, base=None, example_weights=None, **options):
        """matrices: (h, 3, 4) float64, rest to present, object space. base: (n, 3) where the bind was given one.
        example_weights: by method EXAMPLES, the pose of these weights, handles let go; None: those that fit the
        handles. options: as of update_options. Calls are serialized, and wait for an Update's first step.
        Returns (3 n,) float32 of its own, deformed minus rest. info is brought up to date: methods are prepared when
        they are first used."""
        matrices = contiguous('matrices', matrices, np.float64, 3, 4)
        how = update_options(base=base, example_weights=example_weights, **options)
        found = np.empty(3 * self.info.vertex_count, np.float32)
        with self._lock:
            call_when_free('dd_deformer_update', self, matrices, len(matrices), how, points_out(found))
            self.info = self._read_info()
        return found

    def update(self, matrices, wait=False, **options):
        """Starts an update with these handles and options in the background, and returns it."""
        return Update(self, matrices, wait, **options)

    def example_weights(self):
        """(count,) float64: of the last update by method EXAMPLES."""
        weights = np.zeros(self._example_count)
        with self._lock:
            call_when_free('dd_deformer_get_example_weights', self, weights, len(weights))
        return weights

    def vertices(self, finding):
        """(k,) int32: all vertices with this finding, a value of dd_finding; info has their number and one of them."""
        with self._lock:
            return vertices('dd_deformer_get_vertices', self, FINDINGS[finding], call=call_when_free)

    def close(self):
        with getattr(self, '_lock', None) or threading.Lock():
            super().close()


class Update(Job):
    """A slow update under way: in steps, or by a slow method."""

    def __init__(self, deformer, matrices, wait=False, **options):
        """As for Deformer.offsets; steps, and turns (h, 3), rotation vectors, among the options. wait: for a deformer
        that is in use, where NativeError says so otherwise."""
        matrices = contiguous('matrices', matrices, np.float64, 3, 4)
        self._vertex_count = deformer.info.vertex_count
        super().__init__('dd_deformer_update_start', deformer, matrices, len(matrices), update_options(**options),
                         call=call_when_free if wait else call)

    def finish(self):
        """Waits; (3 n,) float32 offsets and UpdateInfo, or NativeError. The work is over either way."""
        offsets, info = np.empty(3 * self._vertex_count, np.float32), UpdateInfo()
        try:
            call('dd_job_get_update', self, points_out(offsets))
            call('dd_job_get_update_info', self, info)
        finally:
            self.close()
        return offsets, info
