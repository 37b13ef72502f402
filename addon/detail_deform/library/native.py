# SPDX-License-Identifier: GPL-3.0-or-later
"""The C library: found, loaded, checked. Only this file and native_transfer.py know it."""

import ctypes
import os
import sys
import threading

import numpy as np

ABI_VERSION = 2
ROLE_FREE = -1
ROLE_FIXED = -2
METRICS = {'SURFACE': 0, 'BASE': 1}
PRECISIONS = {'SINGLE': 0, 'DOUBLE': 1}
METHODS = {'TRANSFER': 0, 'VARIATIONAL': 1, 'NORMAL': 2, 'GRADIENT': 3, 'VOLUMES': 4,
           'EXAMPLES': 5}
SHOWN = {'RESULT': 0, 'BASE': 1}
PAIRS_OF = {'TRIANGLES': 0, 'VERTICES': 1}
ANCHORS = {'SOURCE': 0, 'CENTROID': 1, 'VERTICES': 2, 'PINNED': 3}
FORMULATIONS = {'SURFACE': 0, 'FOURTH_POINTS': 1, 'FOURTH_POINTS_UNWEIGHTED': 2}

_ERROR_CANCELLED = 6
_BIND_RUNNING = 0
_OUTPUT_OFFSETS = 1


class NativeError(Exception):
    """A sentence for the user. cancelled: the user asked for it."""

    def __init__(self, sentence, cancelled=False):
        super().__init__(sentence)
        self.cancelled = cancelled


class _BindOptions(ctypes.Structure):
    _fields_ = [('struct_size', ctypes.c_uint32), ('base_metric', ctypes.c_int32),
                ('metric_smoothing', ctypes.c_double), ('smoothness', ctypes.c_int32),
                ('base', ctypes.c_void_p), ('base_count', ctypes.c_size_t),
                ('precision', ctypes.c_int32), ('threads', ctypes.c_int32),
                ('examples', ctypes.c_void_p), ('example_value_count', ctypes.c_size_t),
                ('example_count', ctypes.c_int32)]


class _UpdateOptions(ctypes.Structure):
    _fields_ = [('struct_size', ctypes.c_uint32), ('rotation_only', ctypes.c_int32),
                ('output', ctypes.c_int32), ('method', ctypes.c_int32), ('refine', ctypes.c_int32),
                ('shown', ctypes.c_int32), ('levels', ctypes.c_int32), ('base', ctypes.c_void_p),
                ('base_count', ctypes.c_size_t), ('volume_tolerance', ctypes.c_double),
                ('volume_iterations', ctypes.c_int32), ('formulation', ctypes.c_int32),
                ('example_weights', ctypes.c_void_p), ('example_weight_count', ctypes.c_size_t),
                ('example_stiffness', ctypes.c_double)]


class _BindProgress(ctypes.Structure):
    _fields_ = [('struct_size', ctypes.c_uint32), ('state', ctypes.c_int32),
                ('fraction', ctypes.c_double), ('stage', ctypes.c_char_p)]


class SplitInfo(ctypes.Structure):
    """Facts about a finished split: dd_split_info."""
    _fields_ = [('struct_size', ctypes.c_uint32), ('volumes_settled', ctypes.c_int32),
                ('volume_error', ctypes.c_double)]


class Measures(ctypes.Structure):
    """How a deformed surface compares with the one at rest: dd_measures."""
    _fields_ = [('struct_size', ctypes.c_uint32)] + [
        (name, ctypes.c_int32) for name in (
            'intersecting_pairs', 'new_intersecting_pairs', 'intersecting_triangles')] + [
        (name, ctypes.c_double) for name in ('stretch', 'normal_error', 'area_ratio', 'volume_ratio')]


class Info(ctypes.Structure):
    """Facts about a bound surface: dd_deformer_info."""
    _fields_ = [('struct_size', ctypes.c_uint32)] + [
        (name, ctypes.c_int32) for name in (
            'vertex_count', 'triangle_count', 'handle_count', 'free_count', 'resting_count',
            'resting_part_count', 'resting_example', 'loose_count', 'loose_example',
            'degenerate_count', 'degenerate_example', 'borrowed_count', 'unrepresented_count',
            'unrepresented_example')] + [
        ('bind_seconds', ctypes.c_double), ('bytes', ctypes.c_double),
        ('idle_handle_count', ctypes.c_int32), ('idle_handle_example', ctypes.c_int32)]


class _TransferOptions(ctypes.Structure):
    _fields_ = [('struct_size', ctypes.c_uint32), ('pairs_of', ctypes.c_int32), ('formulation', ctypes.c_int32),
                ('anchor', ctypes.c_int32), ('anchors', ctypes.c_void_p), ('anchor_count', ctypes.c_size_t),
                ('placement', ctypes.c_void_p), ('precision', ctypes.c_int32), ('threads', ctypes.c_int32)]


class TransferInfo(ctypes.Structure):
    """Facts about a source and a target that correspond: dd_transfer_info."""
    _fields_ = [('struct_size', ctypes.c_uint32)] + [
        (name, ctypes.c_int32) for name in (
            'unmatched_count', 'unmatched_example', 'unmatched_part_count', 'unmatched_part_example',
            'loose_count', 'degenerate_count', 'degenerate_example', 'mirrored', 'unknowns')] + [
        ('nonzeros', ctypes.c_double), ('placement', ctypes.c_double * 12)]


class _MatchOptions(ctypes.Structure):
    _fields_ = [('struct_size', ctypes.c_uint32)] + [
        (name, ctypes.c_int32) for name in ('stages', 'rounds', 'threads')] + [
        (name, ctypes.c_double) for name in ('smoothness', 'identity', 'reach')]


def library_path():
    """Where the library is looked for: beside the add-on unless the environment says otherwise."""
    override = os.environ.get('DETAIL_DEFORM_LIBRARY')
    if override:
        return override
    name = {'win32': 'detail_deform.dll', 'darwin': 'libdetail_deform.dylib'}.get(
        sys.platform, 'libdetail_deform.so')
    return os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), 'lib', name)


_FLOATS = np.ctypeslib.ndpointer(np.float32, flags='C_CONTIGUOUS')
_DOUBLES = np.ctypeslib.ndpointer(np.float64, flags='C_CONTIGUOUS')
_INTS = np.ctypeslib.ndpointer(np.int32, flags='C_CONTIGUOUS')
_library = None
_loading = threading.Lock()


def library():
    """The loaded library. Raises NativeError with what is missing or does not fit."""
    global _library
    with _loading:
        if _library is None:
            _library = _load(library_path())
    return _library


def _load(path):
    if not os.path.exists(path):
        raise NativeError(f"The Detail Deform library is missing: there is no file {path}. "
                          "Install the add-on's zip for this operating system, or build the project.")
    try:
        lib = ctypes.CDLL(path)
        lib.dd_abi_version.restype = ctypes.c_int32
        version = lib.dd_abi_version()
    except (OSError, AttributeError) as error:
        raise NativeError(f"The Detail Deform library can't be loaded: {error}. "
                          "Install the add-on's zip for this operating system.") from error
    if version != ABI_VERSION:
        raise NativeError(f"The Detail Deform library {path} is of another version (interface "
                          f"{version}, the add-on needs {ABI_VERSION}). Install the add-on's zip "
                          "again and restart Blender.")
    for name in ('dd_version', 'dd_instruction_set', 'dd_last_message'):
        getattr(lib, name).restype = ctypes.c_char_p
        getattr(lib, name).argtypes = []
    size, handle = ctypes.c_size_t, ctypes.c_void_p
    signatures = {
        'dd_bind_start': [_FLOATS, size, _INTS, size, _INTS, size, ctypes.c_int32,
                          ctypes.POINTER(_BindOptions), ctypes.POINTER(handle)],
        'dd_bind_poll': [handle, ctypes.POINTER(_BindProgress)],
        'dd_bind_cancel': [handle],
        'dd_bind_finish': [handle, ctypes.POINTER(handle)],
        'dd_bind_free': [handle],
        'dd_deformer_update': [handle, _DOUBLES, size, ctypes.POINTER(_UpdateOptions), _FLOATS, size],
        'dd_deformer_get_info': [handle, ctypes.POINTER(Info)],
        'dd_deformer_get_example_weights': [handle, _DOUBLES, size],
        'dd_deformer_free': [handle],
        'dd_measure': [_FLOATS, _FLOATS, size, _INTS, size, _INTS, size, handle, handle,
                       ctypes.POINTER(Measures)],
        'dd_distances': [_FLOATS, size, _INTS, size, _INTS, size, _FLOATS, size],
        'dd_split_start': [_FLOATS, size, _INTS, size, _INTS, size, ctypes.c_int32,
                           ctypes.POINTER(_BindOptions), _DOUBLES, size, _DOUBLES, size,
                           ctypes.c_int32, ctypes.POINTER(_UpdateOptions), ctypes.POINTER(handle)],
        'dd_split_poll': [handle, ctypes.POINTER(_BindProgress)],
        'dd_split_cancel': [handle],
        'dd_split_finish': [handle, _FLOATS, size],
        'dd_split_get_info': [handle, ctypes.POINTER(SplitInfo)],
        'dd_split_free': [handle],
        'dd_transfer_create': [*[_FLOATS, size, _INTS, size] * 2, handle, size,
                               ctypes.POINTER(_TransferOptions), ctypes.POINTER(handle)],
        'dd_transfer_apply': [handle, _FLOATS, size, ctypes.c_int32, handle, size, _FLOATS, size],
        'dd_transfer_get_info': [handle, ctypes.POINTER(TransferInfo)],
        'dd_transfer_free': [handle],
        'dd_match_start': [*[_FLOATS, size, _INTS, size] * 2, _INTS, size,
                           ctypes.POINTER(_MatchOptions), ctypes.POINTER(handle)],
        'dd_match_poll': [handle, ctypes.POINTER(_BindProgress)],
        'dd_match_cancel': [handle],
        'dd_match_finish': [handle],
        'dd_match_get_positions': [handle, _FLOATS, size],
        'dd_match_get_pairs': [handle, handle, size, ctypes.POINTER(size)],
        'dd_match_get_confidence': [handle, _FLOATS, size],
        'dd_match_free': [handle],
    }
    for name, argtypes in signatures.items():
        function = getattr(lib, name)
        function.argtypes = argtypes
        function.restype = None if name.endswith('_free') else ctypes.c_int32
    return lib


def version():
    return library().dd_version().decode()


def instruction_set():
    """'avx2' or 'baseline': what the per-frame kernels use on this machine."""
    return library().dd_instruction_set().decode()


def _pointer(array):
    """Address and number of elements of a contiguous array, which must stay alive; or of None."""
    return (None, 0) if array is None else (array.ctypes.data, array.size)


def _check(status):
    if status != 0:
        raise NativeError(library().dd_last_message().decode('utf-8', 'replace'),
                          cancelled=status == _ERROR_CANCELLED)


def _bind_arguments(positions, triangles, roles, handle_count, base_metric='SURFACE',
                    metric_smoothing=0.0, smoothness=2, base=None, precision='SINGLE', threads=0,
                    examples=None):
    """What Bind and Split take, as the library does, and what must stay alive during the call.

    positions: (n, 3) float32; triangles: (m, 3) int32; roles: (n,) int32, ROLE_FREE, ROLE_FIXED or a
    handle number below handle_count. All are copied. Options as in dd_bind_options, base_metric and
    precision by their names in METRICS and PRECISIONS, base (n, 3) float32 or None, examples
    (count, n, 3) float32 or None."""
    examples = None if examples is None else np.ascontiguousarray(examples, np.float32)
    base = None if base is None else np.ascontiguousarray(base, np.float32)
    options = _BindOptions(ctypes.sizeof(_BindOptions), METRICS[base_metric], metric_smoothing,
                           smoothness, *_pointer(base), PRECISIONS[precision], threads,
                           *_pointer(examples), 0 if examples is None else len(examples))
    positions = np.ascontiguousarray(positions, np.float32)
    triangles = np.ascontiguousarray(triangles, np.int32)
    roles = np.ascontiguousarray(roles, np.int32)
    return [positions, positions.size, triangles, triangles.size, roles, roles.size, handle_count,
            options], (base, examples)


def _update_options(rotation_only=True, method='TRANSFER', refine=4, shown='RESULT', levels=1,
                    base=None, volume_tolerance=0.0, volume_iterations=0,
                    formulation='SURFACE', example_weights=None, example_stiffness=0.0):
    """dd_update_options by the names in METHODS, SHOWN and FORMULATIONS, for offsets. base and
    example_weights, (count,) float64, must be contiguous and stay alive."""
    return _UpdateOptions(ctypes.sizeof(_UpdateOptions), rotation_only, _OUTPUT_OFFSETS,
                          METHODS[method], refine, SHOWN[shown], levels, *_pointer(base), volume_tolerance,
                          volume_iterations,
                          FORMULATIONS[formulation], *_pointer(example_weights), example_stiffness)


class _Job:
    """Work under way in a thread of the library. kind: 'bind', 'split' or 'match', as in its functions' names."""

    def __init__(self, kind, *arguments):
        self.cancelled = False
        self._kind = kind
        self._handle = ctypes.c_void_p()
        self._call('start', *arguments, self._handle)

    def _function(self, name):
        return getattr(library(), f'dd_{self._kind}_{name}')

    def _call(self, name, *arguments):
        _check(self._function(name)(*arguments))

    def progress(self):
        """(running, fraction, stage)"""
        progress = _BindProgress(ctypes.sizeof(_BindProgress))
        self._call('poll', self._handle, progress)
        return progress.state == _BIND_RUNNING, progress.fraction, progress.stage.decode()

    def cancel(self):
        """Takes effect at the work's next stage."""
        self.cancelled = True
        self._call('cancel', self._handle)

    def close(self):
        """Ends the work without a result: cancels it when it still runs."""
        handle, self._handle = self._handle, None
        if handle:
            self._function('free')(handle)

    def __del__(self):
        if getattr(self, '_handle', None):
            self.close()


class Bind(_Job):
    """A bind under way; arguments as of _bind_arguments."""

    def __init__(self, *mesh, **options):
        arguments, _alive = _bind_arguments(*mesh, **options)
        self._example_count = arguments[-1].example_count
        super().__init__('bind', *arguments)

    def finish(self):
        """Waits; the Deformer, or NativeError. The bind is over either way."""
        deformer = ctypes.c_void_p()
        try:
            self._call('finish', self._handle, deformer)
        finally:
            self.close()
        return Deformer(deformer, self._example_count)


class Split(_Job):
    """A large motion in steps, under way: dd_split_start."""

    def __init__(self, mesh, matrices, turns, steps, look):
        """mesh: arguments of _bind_arguments as (positional, by name). matrices: (h, 3, 4) float64.
        turns: (h, 3) float64, rotation vectors. look: as of _update_options, base contiguous float32."""
        arguments, _alive = _bind_arguments(*mesh[0], **mesh[1])
        self._size = arguments[1]
        matrices = np.ascontiguousarray(matrices, np.float64)
        turns = np.ascontiguousarray(turns, np.float64)
        super().__init__('split', *arguments, matrices, matrices.size, turns, turns.size, steps,
                         _update_options(**look))

    def finish(self):
        """Waits; (3 n,) float32 offsets and SplitInfo, or NativeError. The work is over either way."""
        offsets, info = np.empty(self._size, np.float32), SplitInfo(ctypes.sizeof(SplitInfo))
        try:
            self._call('finish', self._handle, offsets, offsets.size)
            self._call('get_info', self._handle, info)
        finally:
            self.close()
        return offsets, info


def measure(rest, deformed, triangles, roles, base=None, deformed_base=None):
    """Measures of a deformation; arrays as for _bind_arguments, all positions float32 and contiguous."""
    found = Measures(ctypes.sizeof(Measures))
    _check(library().dd_measure(rest, deformed, rest.size, triangles, triangles.size, roles, roles.size,
                                _pointer(base)[0], _pointer(deformed_base)[0], found))
    return found


def distances(positions, triangles, sources):
    """(n,) float32: over the surface, from the nearest source; infinite where no triangles lead.
    positions: (n, 3) float32; triangles: (m, 3) int32; sources: (n,) bool."""
    sources = np.ascontiguousarray(sources, np.int32)
    found = np.empty(sources.size, np.float32)
    _check(library().dd_distances(positions, positions.size, triangles, triangles.size, sources,
                                  sources.size, found, found.size))
    return found


class Deformer:
    """A bound surface. One update at a time: renders come from another thread than the window."""

    def __init__(self, handle, example_count=0):
        self._handle = handle
        self._example_count = example_count
        self._lock = threading.Lock()
        self.info = self._read_info()
        self._offsets = np.zeros(3 * self.info.vertex_count, np.float32)

    def _read_info(self):
        info = Info(ctypes.sizeof(Info))
        _check(library().dd_deformer_get_info(self._handle, info))
        return info

    def offsets(self, matrices, base=None, example_weights=None, **look):
        """matrices: (h, 3, 4) float64, rest to present, object space. look: as of _update_options.
        base: (n, 3) float32 where the bind was given one. example_weights: by method EXAMPLES, the
        pose of these weights, handles let go; None: those that fit the handles. Calls are serialized.
        Returns (3 n,) float32, deformed minus rest; the array is reused by the next call. info is
        brought up to date: methods are prepared when they are first used."""
        matrices = np.ascontiguousarray(matrices, np.float64)
        base = None if base is None else np.ascontiguousarray(base, np.float32)
        if example_weights is not None:
            example_weights = np.ascontiguousarray(example_weights, np.float64)
        options = _update_options(base=base, example_weights=example_weights, **look)
        with self._lock:
            _check(library().dd_deformer_update(self._handle, matrices, matrices.size, options,
                                                self._offsets, self._offsets.size))
            self.info = self._read_info()
        return self._offsets

    def example_weights(self):
        """(count,) float64: of the last update by method EXAMPLES."""
        weights = np.zeros(self._example_count)
        with self._lock:
            _check(library().dd_deformer_get_example_weights(self._handle, weights, weights.size))
        return weights

    def close(self):
        with self._lock:
            handle, self._handle = self._handle, None
            if handle:
                library().dd_deformer_free(handle)

    def __del__(self):
        if getattr(self, '_handle', None):
            self.close()
