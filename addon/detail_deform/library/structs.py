# SPDX-License-Identifier: GPL-3.0-or-later
"""What detail_deform.h declares, as tables: enums, structs and functions. tests/abi holds them against the
header, so that neither can change alone."""

import ctypes

import numpy as np

from . import options

ABI_VERSION = 3

# Enums, by the prefix of their values' names in the header.
STATUS = {'OK': 0, 'ERROR_ARGUMENT': 1, 'ERROR_MESH': 2, 'ERROR_REGION': 3, 'ERROR_NUMERIC': 4, 'ERROR_MEMORY': 5,
          'ERROR_CANCELLED': 6, 'ERROR_BUSY': 7, 'ERROR_INTERNAL': 8}
COUNTS = {'NONE': -1}
ROLES = {'FREE': -1, 'FIXED': -2}
GRADIENTS = {'ROTATIONS': 0, 'WHOLE': 1}
VALUES = {'POSITIONS': 0, 'OFFSETS': 1}
FORMULATIONS = options.numbers_of(options.FORMULATIONS)
PRECISIONS = {'SINGLE': 0, 'DOUBLE': 1}
JOB_STATES = {'RUNNING': 0, 'DONE': 1, 'FAILED': 2}
METRICS = options.numbers_of(options.METRICS)
SMOOTHNESSES = {'DEFAULT': 0, 'MEMBRANE': 1, 'THIN_PLATE': 2, 'CURVATURE_VARIATION': 3}
TRIANGULATIONS = {'DELAUNAY': 0, 'GIVEN': 1}
METHODS = options.numbers_of(options.METHODS)
HANDLE_TURNS = options.numbers_of(options.HANDLE_TURNS)
BASE_DEFORMERS = options.numbers_of(options.BASE_DEFORMERS)
OUTPUTS = options.numbers_of(options.OUTPUTS)
PAIRS_OF = options.numbers_of((*options.PAIRS_OF, (options.NEAREST,)))
ANCHORS = options.numbers_of(options.ANCHORS)
PLACINGS = options.numbers_of(options.PLACINGS)
FINDINGS = {'RESTING': 0, 'LOOSE': 1, 'DEGENERATE': 2, 'UNREPRESENTED': 3, 'FAR': 4, 'TORN': 5}
TET_OPERATORS = {'GRADIENT': 0, 'DEFORMATION_GRADIENT': 1, 'LAPLACIAN': 2}
ENUMS = {
    'dd_status': ('DD_', STATUS), 'dd_count': ('DD_', COUNTS), 'dd_role': ('DD_ROLE_', ROLES),
    'dd_gradients': ('DD_GRADIENTS_', GRADIENTS), 'dd_values': ('DD_VALUES_', VALUES),
    'dd_formulation': ('DD_FORMULATION_', FORMULATIONS), 'dd_precision': ('DD_PRECISION_', PRECISIONS),
    'dd_job_state': ('DD_JOB_', JOB_STATES), 'dd_base_metric': ('DD_METRIC_', METRICS),
    'dd_smoothness': ('DD_SMOOTHNESS_', SMOOTHNESSES), 'dd_triangulation': ('DD_TRIANGULATION_', TRIANGULATIONS),
    'dd_method': ('DD_METHOD_', METHODS),
    'dd_output': ('DD_OUTPUT_', OUTPUTS), 'dd_base_deformer': ('DD_BASE_DEFORMER_', BASE_DEFORMERS),
    'dd_handle_turns': ('DD_HANDLE_TURNS_', HANDLE_TURNS), 'dd_finding': ('DD_FINDING_', FINDINGS),
    'dd_pairs_of': ('DD_PAIRS_OF_', PAIRS_OF),
    'dd_anchor': ('DD_ANCHOR_', ANCHORS), 'dd_placing': ('DD_PLACING_', PLACINGS),
    'dd_tet_operator': ('DD_TETS_', TET_OPERATORS)}


class NativeError(Exception):
    """A sentence for the user. cancelled: the user asked for it. busy: it may be tried again later. vertices: all that
    the sentence is about, where it names one of them."""

    def __init__(self, sentence, status=None, vertices=()):
        super().__init__(sentence)
        self.status = status
        self.vertices = vertices
        self.cancelled = status == STATUS['ERROR_CANCELLED']
        self.busy = status == STATUS['ERROR_BUSY']


def numbers(name, values, dtype, *of_each):
    """A contiguous array of things that are so many numbers each, of any number of dimensions before these."""
    values = np.asarray(values)
    if values.ndim <= len(of_each) or values.shape[values.ndim - len(of_each):] != of_each:
        each = ' × '.join(map(str, of_each)) or 'one number'
        raise NativeError(f"{name} has the shape {values.shape}, which is not {each} for each.")
    return np.ascontiguousarray(values, dtype)


class Array:
    """A field that points to numbers: so many to each of the things that the sizes after it count."""

    def __init__(self, dtype, *of_each):
        self.dtype, self.of_each = np.dtype(dtype), of_each


_SIZE, _INT, _DOUBLE = ctypes.c_size_t, ctypes.c_int32, ctypes.c_double
_POSITIONS = Array(np.float32, 3)


class Struct(ctypes.Structure):
    """A struct of the header, its size set and all else zero, filled by the names of its fields: enums by the names
    of their values, arrays as arrays, which it keeps alive. None stands for the default."""

    def __init__(self, **values):
        super().__init__()
        if 'struct_size' in self.kinds:
            self.struct_size = ctypes.sizeof(self)
        self._alive = []
        for name, value in values.items():
            if value is not None:
                self._set(name, value)

    def _set(self, name, value):
        kind = self.kinds[name]
        if isinstance(kind, Array):
            self._point_to(name, value)
        elif kind in ENUMS and isinstance(value, str):
            if value not in ENUMS[kind][1]:  # Blender gives '' for a number that it doesn't know
                raise NativeError(f"The file has a value of '{name.replace('_', ' ')}' that is not known here: choose "
                                  "another one.")
            setattr(self, name, ENUMS[kind][1][value])
        else:
            setattr(self, name, value)

    def _point_to(self, name, value):
        sizes = self.sizes_after[name]
        array = numbers(name, value if sizes else [value], self.kinds[name].dtype, *self.kinds[name].of_each)
        self._alive.append(array)
        setattr(self, name, array.ctypes.data)
        for size, count in zip(sizes, array.shape):
            setattr(self, size, count)


def _option(c_name, field):
    kind = options.kind_of(c_name, field)
    return {int: _INT, float: _DOUBLE}.get(kind, kind), field


def _struct(c_name, doc, *fields):
    """fields: (kind, names...), a kind being a ctypes type, an Array, or the name of an enum; or the name alone where
    the table of options says which."""
    each = (_option(c_name, field) if isinstance(field, str) else field for field in fields)
    kinds = {name: kind for kind, *names in each for name in names}
    types = {name: ctypes.c_void_p if isinstance(kind, Array) else _INT if isinstance(kind, str) else kind
             for name, kind in kinds.items()}
    names, sizes_after = list(kinds), {}
    for at, name in enumerate(names):
        if isinstance(kinds[name], Array):
            end = next((i for i in range(at + 1, len(names)) if kinds[names[i]] is not _SIZE), len(names))
            sizes_after[name] = names[at + 1:end]
    return type(c_name, (Struct,), {'__doc__': f"{doc}: {c_name}.", '_fields_': list(types.items()), 'kinds': kinds,
                                    'sizes_after': sizes_after})


def _sized(c_name, doc, *fields):
    return _struct(c_name, doc, (ctypes.c_uint32, 'struct_size'), *fields)


Mesh = _struct('dd_mesh', "A triangle mesh", (_POSITIONS, 'positions'), (_SIZE, 'vertex_count'),
               (Array(np.int32, 3), 'triangles'), (_SIZE, 'triangle_count'))
TetMesh = _struct('dd_tet_mesh', "A tetrahedral mesh", (Array(np.float64, 3), 'positions'), (_SIZE, 'vertex_count'),
                  (Array(np.int32, 4), 'tets'), (_SIZE, 'tet_count'))
Progress = _sized('dd_progress', "How far a job is", ('dd_job_state', 'state'), (_DOUBLE, 'fraction'),
                  (ctypes.c_char_p, 'stage'))
BindOptions = _sized(
    'dd_bind_options', "What a binding depends on beside mesh and roles",
    'base_metric', 'metric_smoothing', 'smoothness', ('dd_precision', 'precision'), (_INT, 'threads'),
    (_POSITIONS, 'base'), (_SIZE, 'base_count'), (_POSITIONS, 'examples'),
    (_SIZE, 'example_count', 'example_vertex_count'), (Array(np.int32, 3), 'base_triangles'),
    (_SIZE, 'base_triangle_count'), ('dd_triangulation', 'triangulation'), (_INT, 'draft'))
UpdateOptions = _sized(
    'dd_update_options', "What an update depends on beside the handles",
    'method', 'gradients', 'refine', 'output', ('dd_values', 'values'), 'levels', 'formulation',
    (_POSITIONS, 'base'), (_SIZE, 'base_count'), 'volume_tolerance', 'volume_iterations', 'steps',
    (Array(np.float64, 3), 'turns'), (_SIZE, 'turn_count'), (Array(np.float64), 'example_weights'),
    (_SIZE, 'example_weight_count'), 'example_stiffness', 'rim_smoothing', 'rotation_smoothing', 'base_deformer',
    (Array(np.int32), 'handle_turns'), (_SIZE, 'handle_turn_count'), (Array(np.float64, 3), 'pivots'),
    (_SIZE, 'pivot_count'), (Array(np.float64, 2), 'example_limits'), (_SIZE, 'example_limit_count'))
UpdateInfo = _sized('dd_update_info', "Facts about an update that was a job", (_INT, 'volumes_converged'),
                    (_DOUBLE, 'volume_error'))
Info = _sized(
    'dd_deformer_info', "Facts about a bound surface",
    (_INT, 'vertex_count', 'triangle_count', 'handle_count', 'free_count', 'resting_count', 'resting_component_count',
     'resting_example', 'loose_count', 'loose_example', 'degenerate_count', 'degenerate_example',
     'idle_handle_count', 'idle_handle_example', 'stand_in_count', 'unrepresented_count', 'unrepresented_example'),
    (_DOUBLE, 'bind_seconds', 'bytes'), (_INT, 'far_count', 'far_example', 'torn_count', 'torn_example',
                                          'proxy_vertex_count', 'coarse_vertex_count'))
TransferOptions = _sized(
    'dd_transfer_options', "What a transfer depends on beside meshes and pairs",
    'pairs_of', 'formulation', 'anchor', (Array(np.int32), 'anchors'), (_SIZE, 'anchor_count'),
    (Array(np.float64, 3, 4), 'placement'), ('dd_precision', 'precision'), (_INT, 'threads'), ('dd_placing', 'placing'),
    (_DOUBLE, 'gap'), (Array(np.int32), 'point_triangles'), (_SIZE, 'point_triangle_count'),
    (Array(np.float32, 3), 'point_weights'), (_SIZE, 'point_weight_count'))
ApplyOptions = _sized('dd_apply_options', "What a transferred pose depends on beside the source's",
                      'gradients', ('dd_values', 'values'), (_POSITIONS, 'places'), (_SIZE, 'place_count'))
TransferInfo = _sized(
    'dd_transfer_info', "Facts about a source and a target that correspond",
    (_INT, 'unmatched_count', 'unmatched_example', 'unmatched_component_count', 'unmatched_component_example',
     'loose_count', 'degenerate_count', 'degenerate_example', 'mirrored', 'unknowns'), (_DOUBLE, 'nonzeros'),
    (_DOUBLE * 12, 'placement'), (_INT, 'overstretched_count', 'overstretched_example', 'through_count',
                                  'through_example'), (_DOUBLE, 'worn_distance'))
MatchOptions = _sized('dd_match_options', "How correspondences are searched for", (_INT, 'stages', 'rounds', 'threads'),
                      (_DOUBLE, 'smoothness', 'identity', 'reach'), (Array(np.float64, 3, 4), 'stance'))
MatchInfo = _sized('dd_match_info', "Facts about a correspondence that was found", (_INT, 'ambiguous'),
                   (_DOUBLE, 'confidence'), (_INT, 'mirrored'))
MeasureOptions = _sized('dd_measure_options', "The base that normals are measured against", (_POSITIONS, 'base'),
                        (_SIZE, 'base_count'), (_POSITIONS, 'deformed_base'), (_SIZE, 'deformed_base_count'))
Measures = _sized('dd_measures', "How a deformed surface compares with the one at rest",
                  (_INT, 'intersecting_pairs', 'new_intersecting_pairs', 'intersecting_triangles'),
                  (_DOUBLE, 'stretch', 'normal_error', 'area_ratio', 'volume_ratio'))
STRUCTS = {kind.__name__: kind for kind in (
    Mesh, TetMesh, Progress, BindOptions, UpdateOptions, UpdateInfo, Info, TransferOptions, ApplyOptions,
    TransferInfo, MatchOptions, MatchInfo, MeasureOptions, Measures)}


def _array_parameter(dtype):
    """A parameter that takes a contiguous array of these numbers, or None."""
    class Parameter:
        @staticmethod
        def from_param(value):
            if value is None:
                return None
            if value.dtype != dtype or not value.flags.c_contiguous:
                raise TypeError(f"a contiguous array of {np.dtype(dtype)} was expected")
            return value.ctypes

    return Parameter


FLOATS, DOUBLES, INTS = (_array_parameter(dtype) for dtype in (np.float32, np.float64, np.int32))
OBJECT = ctypes.c_void_p  # a dd_job, a dd_deformer, ...
_TO = ctypes.POINTER

# Parameters by function; all return a status but for those that are named after.
SIGNATURES = {
    'dd_abi_version': [],
    'dd_version': [],
    'dd_instruction_set': [],
    'dd_last_message': [],
    'dd_job_poll': [OBJECT, _TO(Progress)],
    'dd_job_cancel': [OBJECT],
    'dd_job_finish': [OBJECT],
    'dd_job_take_deformer': [OBJECT, _TO(OBJECT)],
    'dd_job_take_transfer': [OBJECT, _TO(OBJECT)],
    'dd_job_take_match': [OBJECT, _TO(OBJECT)],
    'dd_job_get_vertices': [OBJECT, INTS, _SIZE, _TO(_SIZE)],
    'dd_job_free': [OBJECT],
    'dd_bind_start': [_TO(Mesh), INTS, _SIZE, _INT, _TO(BindOptions), _TO(OBJECT)],
    'dd_job_take_draft': [OBJECT, _TO(OBJECT)],
    'dd_draft_update': [OBJECT, DOUBLES, _SIZE, _TO(UpdateOptions), FLOATS, _SIZE],
    'dd_draft_free': [OBJECT],
    'dd_deformer_update': [OBJECT, DOUBLES, _SIZE, _TO(UpdateOptions), FLOATS, _SIZE],
    'dd_update_start': [OBJECT, DOUBLES, _SIZE, _TO(UpdateOptions), _TO(OBJECT)],
    'dd_job_get_update': [OBJECT, FLOATS, _SIZE],
    'dd_job_get_update_info': [OBJECT, _TO(UpdateInfo)],
    'dd_deformer_get_info': [OBJECT, _TO(Info)],
    'dd_deformer_get_vertices': [OBJECT, _INT, INTS, _SIZE, _TO(_SIZE)],
    'dd_deformer_get_example_weights': [OBJECT, DOUBLES, _SIZE],
    'dd_deformer_free': [OBJECT],
    'dd_transfer_start': [_TO(Mesh), _TO(Mesh), INTS, _SIZE, _TO(TransferOptions), _TO(OBJECT)],
    'dd_transfer_apply': [OBJECT, FLOATS, _SIZE, _TO(ApplyOptions), FLOATS, _SIZE],
    'dd_transfer_get_info': [OBJECT, _TO(TransferInfo)],
    'dd_transfer_free': [OBJECT],
    'dd_match_start': [_TO(Mesh), _TO(Mesh), INTS, _SIZE, _TO(MatchOptions), _TO(OBJECT)],
    'dd_match_get_positions': [OBJECT, FLOATS, _SIZE],
    'dd_match_get_pairs': [OBJECT, INTS, _SIZE, _TO(_SIZE)],
    'dd_match_get_points': [OBJECT, INTS, FLOATS, _SIZE],
    'dd_match_get_confidence': [OBJECT, FLOATS, _SIZE],
    'dd_match_get_info': [OBJECT, _TO(MatchInfo)],
    'dd_match_free': [OBJECT],
    'dd_measure': [_TO(Mesh), INTS, _SIZE, FLOATS, _SIZE, _TO(MeasureOptions), _TO(Measures)],
    'dd_distances': [_TO(Mesh), INTS, _SIZE, FLOATS, _SIZE],
    'dd_vertex_gradients': [_TO(Mesh), FLOATS, _SIZE, FLOATS, _SIZE],
    'dd_tets_create': [_TO(TetMesh), INTS, _SIZE, _INT, _TO(OBJECT)],
    'dd_tets_get_operator': [OBJECT, _INT, INTS, INTS, DOUBLES, _SIZE, _TO(_SIZE)],
    'dd_tets_solve': [OBJECT, DOUBLES, _SIZE, DOUBLES, _SIZE, DOUBLES, _SIZE],
    'dd_tets_update': [OBJECT, DOUBLES, _SIZE, DOUBLES, _SIZE],
    'dd_tets_free': [OBJECT],
}
TEXTS = ('dd_version', 'dd_instruction_set', 'dd_last_message')


def result_type(function):
    return ctypes.c_char_p if function in TEXTS else None if function.endswith('_free') else _INT
