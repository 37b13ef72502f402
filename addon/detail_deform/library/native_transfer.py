# SPDX-License-Identifier: GPL-3.0-or-later
"""Deformation transfer between meshes, and the search for what corresponds, in the C library."""

import ctypes
import threading

import numpy as np

from . import native


def _mesh(positions, triangles):
    """As the library takes it. positions: (n, 3); triangles: (m, 3)."""
    positions = np.ascontiguousarray(positions, np.float32)
    triangles = np.ascontiguousarray(triangles, np.int32)
    return [positions, positions.size, triangles, triangles.size]


class Transfer:
    """A source and a target that correspond, factored: dd_transfer. One pose at a time."""

    def __init__(self, source, target, pairs=None, pairs_of='TRIANGLES', anchor='SOURCE', anchors=(),
                 placement=None, formulation='SURFACE', precision='DOUBLE', threads=0):
        """source, target: (positions (n, 3), triangles (m, 3)). pairs: (k, 2), or None for the same topology.
        anchors: vertices of the target. placement: (3, 4), or None: as the pairs say. The others by their
        names in native.PAIRS_OF, ANCHORS, FORMULATIONS and PRECISIONS. All are copied."""
        pairs = None if pairs is None else np.ascontiguousarray(pairs, np.int32)
        anchors = np.ascontiguousarray(anchors, np.int32)
        placement = None if placement is None else np.ascontiguousarray(placement, np.float64)
        options = native._TransferOptions(
            ctypes.sizeof(native._TransferOptions), native.PAIRS_OF[pairs_of], native.FORMULATIONS[formulation],
            native.ANCHORS[anchor], anchors.ctypes.data, anchors.size,
            None if placement is None else placement.ctypes.data, native.PRECISIONS[precision], threads)
        self._handle = None
        handle = ctypes.c_void_p()
        native._check(native.library().dd_transfer_create(
            *_mesh(*source), *_mesh(*target), *native._pointer(pairs), options, handle))
        self._handle = handle
        self._lock = threading.Lock()
        self._size = np.asarray(target[0]).size
        self.info = native.TransferInfo(ctypes.sizeof(native.TransferInfo))
        native._check(native.library().dd_transfer_get_info(self._handle, self.info))

    def apply(self, pose, rotation_only=False, places=None):
        """pose: (n, 3) of the source. places: (anchors, 3), where they go. Returns (n, 3) float32 of the target."""
        pose = np.ascontiguousarray(pose, np.float32)
        places = None if places is None else np.ascontiguousarray(places, np.float32)
        found = np.empty(self._size, np.float32)
        with self._lock:
            native._check(native.library().dd_transfer_apply(
                self._handle, pose, pose.size, rotation_only, *native._pointer(places), found, found.size))
        return found.reshape(-1, 3)

    def __del__(self):
        if getattr(self, '_handle', None):
            handle, self._handle = self._handle, None
            native.library().dd_transfer_free(handle)


class Match(native._Job):
    """A search for correspondences under way: dd_match."""

    def __init__(self, source, target, markers, stages=0, rounds=0, smoothness=0.0, identity=0.0, reach=0.0,
                 threads=0):
        """source, target: as for Transfer. markers: (k, 2) vertices that fall on one another. The others as in
        dd_match_options; 0 is their default."""
        markers = np.ascontiguousarray(markers, np.int32)
        self._source_size, self._target_count = np.asarray(source[0]).size, len(target[1])
        options = native._MatchOptions(ctypes.sizeof(native._MatchOptions), stages, rounds, threads, smoothness,
                                       identity, reach)
        super().__init__('match', *_mesh(*source), *_mesh(*target), markers, markers.size, options)

    def finish(self):
        """Waits. (pairs (k, 2) int32, confidence (m,) float32 of the target's triangles, (n, 3) float32 the source on
        the target), or NativeError. The search is over either way."""
        try:
            self._call('finish', self._handle)
            count = ctypes.c_size_t()
            self._call('get_pairs', self._handle, None, 0, count)
            pairs = np.empty(count.value, np.int32)
            self._call('get_pairs', self._handle, pairs.ctypes.data, pairs.size, count)
            confidence = np.empty(self._target_count, np.float32)
            self._call('get_confidence', self._handle, confidence, confidence.size)
            fitted = np.empty(self._source_size, np.float32)
            self._call('get_positions', self._handle, fitted, fitted.size)
        finally:
            self.close()
        return pairs.reshape(-1, 2), confidence, fitted.reshape(-1, 3)
