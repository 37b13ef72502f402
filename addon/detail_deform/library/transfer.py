# SPDX-License-Identifier: GPL-3.0-or-later
"""Deformation transfer between meshes, and the search for what corresponds."""

import ctypes
import threading

import numpy as np

from .jobs import Job, JobResult
from .loading import call, call_when_free, count, filled
from .structs import (ApplyOptions, MatchInfo, MatchOptions, TransferInfo, TransferOptions, contiguous, mesh, points,
                      points_out)


def _pairs(values):
    return None if values is None else contiguous('pairs', values, np.int32, 2)


class TransferJob(Job):
    """A transfer that is being factored; finish() gives it."""

    def __init__(self, source, target, pairs=None, **options):
        """source, target: (positions (n, 3), triangles (m, 3)). pairs: (k, 2), or None for the same topology.
        options: by the names of dd_transfer_options' fields. All are copied."""
        pairs = _pairs(pairs)
        super().__init__('dd_transfer_start', mesh(*source), mesh(*target), pairs, count(pairs),
                         filled(TransferOptions, **options))
        self.vertex_count = len(target[0])

    def finish(self):
        return Transfer(job=self)


class Transfer(JobResult):
    """A source and a target that correspond, factored: dd_transfer. One pose at a time."""

    take_function, free = 'dd_job_take_transfer', 'dd_transfer_free'

    def __init__(self, *meshes_and_pairs, job=None, **options):
        """Waits for a job, or for one of these arguments."""
        job = job or TransferJob(*meshes_and_pairs, **options)
        super().__init__(job)
        self._lock = threading.Lock()
        self._vertex_count = job.vertex_count
        self.info = TransferInfo()
        call('dd_transfer_get_info', self, self.info)

    def apply(self, pose, gradients=None, places=None):
        """pose: (n, 3) of the source. places: (anchors, 3), where they go. Returns (n, 3) float32 of the target."""
        pose = points('pose', pose)
        how = filled(ApplyOptions, gradients=gradients, places=places)
        found = np.empty((self._vertex_count, 3), np.float32)
        with self._lock:
            call_when_free('dd_transfer_apply', self, pose, how, points_out(found))
        return found


class _Found(JobResult):
    take_function, free = 'dd_job_take_match', 'dd_match_free'


class Match(Job):
    """A search for correspondences under way: dd_match."""

    def __init__(self, source, target, markers=(), **options):
        """source, target: as for TransferJob. markers: (k, 2) vertices that fall on one another, or none. options: by
        the names of dd_match_options' fields."""
        # finish() sets both. info: facts about the match. points: for each vertex of the target the triangle of the
        # source that corresponds with it, or -1, (n,), and the barycentric weights in that triangle, (n, 3).
        self.info, self.points = MatchInfo(), None
        markers = _pairs(np.reshape(markers, (-1, 2)))
        self._vertex_count, self._target_counts = len(source[0]), tuple(map(len, target))
        super().__init__('dd_match_start', mesh(*source), mesh(*target), markers, len(markers),
                         filled(MatchOptions, **options))

    def finish(self):
        """Waits. (pairs (k, 2) int32, confidence (m,) float32 of the target's triangles, (n, 3) float32 the source on
        the target), or NativeError. The search is over either way."""
        found, pair_count = _Found(self), ctypes.c_size_t()
        call('dd_match_get_pairs', found, None, 0, pair_count)
        pairs = np.empty((pair_count.value, 2), np.int32)
        call('dd_match_get_pairs', found, pairs, len(pairs), pair_count)
        vertex_count, triangle_count = self._target_counts
        confidence = np.empty(triangle_count, np.float32)
        call('dd_match_get_confidence', found, confidence, len(confidence))
        fitted = np.empty((self._vertex_count, 3), np.float32)
        call('dd_match_get_positions', found, points_out(fitted))
        call('dd_match_get_info', found, self.info)
        self.points = np.empty(vertex_count, np.int32), np.empty((vertex_count, 3), np.float32)
        call('dd_match_get_points', found, *self.points, vertex_count)
        return pairs, confidence, fitted
