# SPDX-License-Identifier: GPL-3.0-or-later
"""What detail_deform.h declares, as tables: enums, structs and functions. tests/abi holds them against the
header, so that neither can change alone."""

import ctypes

import numpy as np

from . import options

ABI_VERSION = 4

# Enums, by the prefix of their values' names in the header.
STATUS = {'OK': 0, 'ERROR_ARGUMENT': 1, 'ERROR_MESH': 2, 'ERROR_REGION': 3, 'ERROR_NUMERIC': 4, 'ERROR_MEMORY': 5,
          'ERROR_CANCELLED': 6, 'ERROR_BUSY': 7, 'ERROR_INTERNAL': 8}
SUBJECTS = {name: number for number, name in enumerate((
    'NONE', 'VERTEX', 'TRIANGLE', 'HANDLE', 'EXAMPLE', 'PAIR', 'SOURCE_VERTEX', 'SOURCE_TRIANGLE', 'TARGET_VERTEX',
    'TARGET_TRIANGLE', 'BASE_VERTEX', 'BASE_TRIANGLE'))}
REMEDIES = {name: number for number, name in enumerate((
    'NONE', 'CALL', 'WAIT', 'FREE_RESOURCES', 'VALIDATE_MESH', 'MOVE_VERTEX', 'ADD_FACES', 'DISSOLVE_FACES',
    'ADD_HANDLE', 'ASSIGN_VERTICES', 'HANDLE_ON_PART', 'FREE_VERTICES', 'FIX_VERTICES', 'MOVE_LESS',
    'SMOOTH_METRIC_LESS', 'SURFACE_METRIC', 'PIN_FEWER', 'WHOLE_GRADIENTS', 'MATCH_MESHES', 'MOVE_TARGET',
    'CORRECT_MARKERS', 'SAME_VERTICES'))}
ROLES = {'FREE': -1, 'FIXED': -2}
GRADIENTS = {'ROTATIONS': 0, 'WHOLE': 1}
VALUES = {'POSITIONS': 0, 'OFFSETS': 1}
FORMULATIONS = options.enum_numbers(options.FORMULATIONS)
PRECISIONS = {'SINGLE': 0, 'DOUBLE': 1}
JOB_STATES = {'RUNNING': 0, 'DONE': 1, 'FAILED': 2}
STAGES = {name: number for number, name in enumerate((
    'STARTING', 'OPERATORS', 'POISSON', 'ENERGY', 'BASE', 'HANDLES', 'ENERGY_ON_BASE', 'DEFORMING', 'VOLUMES',
    'RESTORING', 'MESHES', 'FUNCTIONS', 'PLACEMENTS', 'MAP', 'SIDES', 'PLACING', 'FITTING', 'CORRESPONDENCE', 'DONE'))}
METRICS = options.enum_numbers(options.METRICS)
SMOOTHNESSES = {'MEMBRANE': 1, 'THIN_PLATE': 2, 'CURVATURE_VARIATION': 3}
TRIANGULATIONS = {'DELAUNAY': 0, 'GIVEN': 1}
METHODS = options.enum_numbers([(options.library_method(name),) for name, *_ in options.METHODS])
HANDLE_TURNS = options.enum_numbers(options.HANDLE_TURNS)
BASE_DEFORMERS = options.enum_numbers(options.BASE_DEFORMERS)
OUTPUTS = options.enum_numbers(options.OUTPUTS)
PAIRS_OF = options.enum_numbers((*options.PAIRS_OF, (options.NEAREST,)))
ANCHORS = options.enum_numbers(options.ANCHORS)
PLACINGS = options.enum_numbers(options.PLACINGS)
FINDINGS = {'RESTING': 0, 'LOOSE': 1, 'DEGENERATE': 2, 'UNREPRESENTED': 3, 'FAR': 4, 'TORN': 5}
ENUMS = {
    'dd_status': ('DD_', STATUS), 'dd_subject': ('DD_SUBJECT_', SUBJECTS), 'dd_remedy': ('DD_REMEDY_', REMEDIES),
    'dd_role': ('DD_ROLE_', ROLES),
    'dd_gradients': ('DD_GRADIENTS_', GRADIENTS), 'dd_values': ('DD_VALUES_', VALUES),
    'dd_formulation': ('DD_FORMULATION_', FORMULATIONS), 'dd_precision': ('DD_PRECISION_', PRECISIONS),
    'dd_job_state': ('DD_JOB_', JOB_STATES), 'dd_stage': ('DD_STAGE_', STAGES),
    'dd_base_metric': ('DD_METRIC_', METRICS),
    'dd_smoothness': ('DD_SMOOTHNESS_', SMOOTHNESSES), 'dd_triangulation': ('DD_TRIANGULATION_', TRIANGULATIONS),
    'dd_method': ('DD_METHOD_', METHODS),
    'dd_output': ('DD_OUTPUT_', OUTPUTS), 'dd_base_deformer': ('DD_BASE_DEFORMER_', BASE_DEFORMERS),
    'dd_handle_turns': ('DD_HANDLE_TURNS_', HANDLE_TURNS), 'dd_finding': ('DD_FINDING_', FINDINGS),
    'dd_pairs_of': ('DD_PAIRS_OF_', PAIRS_OF),
    'dd_anchor': ('DD_ANCHOR_', ANCHORS), 'dd_placing': ('DD_PLACING_', PLACINGS)}


def name_of(enum, number):
    """The name of an enum's value, or 'NONE' of one that isn't known."""
    return next((name for name, its_number in ENUMS[enum][1].items() if its_number == number), 'NONE')


class NativeError(Exception):
    """A refusal of the library. str(): one sentence. To build other sentences: message, what it is about (subject, a
    name of SUBJECTS, and its index) and what can be done (remedy, a name of REMEDIES). cancelled: the user asked for
    it. busy: it may be tried again later. vertices: all that it is about, where it names one of them."""

    def __init__(self, sentence, status=None, vertices=(), message="", subject='NONE', index=-1, remedy='NONE'):
        super().__init__(sentence)
        self.status = status
        self.vertices = vertices
        self.message, self.subject, self.index, self.remedy = message, subject, index, remedy
        self.cancelled = status == STATUS['ERROR_CANCELLED']
        self.busy = status == STATUS['ERROR_BUSY']

    def about(self, index, vertices):
        """A copy of this error with another index and other vertices, as where a part's are numbered in the whole
        mesh."""
        return NativeError(str(self), self.status, vertices, self.message, self.subject, index, self.remedy)


def contiguous(name, values, dtype, *of_each):
    """values as a contiguous array whose last dimensions are of_each. Raises NativeError if they aren't, or if numbers
    that count something aren't whole or too large."""
    values, dtype = np.asarray(values), np.dtype(dtype)
    if values.ndim <= len(of_each) or values.shape[values.ndim - len(of_each):] != of_each:
        each = ' × '.join(map(str, of_each)) or 'one number'
        raise NativeError(f"{name} has the shape {values.shape}, which is not {each} for each.")
    if dtype.kind == 'i' and values.dtype != dtype and values.size:
        if values.dtype.kind not in 'iub':
            raise NativeError(f"{name} has numbers of the type {values.dtype}, where whole ones are needed.")
        limits = np.iinfo(dtype)
        if values.min() < limits.min or values.max() > limits.max:
            raise NativeError(f"{name} has a number that doesn't fit into {limits.bits} bits.")
    return np.ascontiguousarray(values, dtype)


class Array:
    """A pointer to numbers; item_shape: the shape of each item. The size fields after it get the other dimensions."""

    def __init__(self, dtype, *of_each):
        self.dtype, self.item_shape = np.dtype(dtype), of_each


class PointTo:
    """A pointer to a struct. Its value is a Struct, or for dd_points an array. many: a list of these; the size
    field after it gets their number."""

    def __init__(self, struct, many=False):
        self.struct, self.many = struct, many


_SIZE, _INT, _DOUBLE = ctypes.c_size_t, ctypes.c_int32, ctypes.c_double


class Struct(ctypes.Structure):
    """A struct of the header, its size set and all else zero, filled by the names of its fields: enums by the names
    of their values, arrays as arrays, which it keeps alive. None leaves a field as it is. loading.filled() makes one
    with the library's defaults in place of zeros."""

    def __init__(self, **values):
        super().__init__()
        if 'struct_size' in self.kinds:
            self.struct_size = ctypes.sizeof(self)
        self.fill(**values)

    def fill(self, **values):
        self._alive = []
        for name, value in values.items():
            if name not in self.kinds:
                raise TypeError(f"{type(self).__name__} has no field '{name}'")
            if value is not None:
                self._set(name, value)
        return self

    def __repr__(self):
        fields = ', '.join(f'{name}={getattr(self, name)}' for name, _ in self._fields_ if name != 'struct_size')
        return f'{type(self).__name__}({fields})'

    def _set(self, name, value):
        kind = self.kinds[name]
        if isinstance(kind, Array):
            self._point_to(name, value)
        elif isinstance(kind, PointTo):
            self._point_to_struct(name, kind, value)
        elif kind in ENUMS and isinstance(value, str):
            if value not in ENUMS[kind][1]:  # Blender gives '' for a number that it doesn't know
                raise NativeError(f"The file has a value of '{name.replace('_', ' ')}' that is not known here: choose "
                                  "another one.")
            setattr(self, name, ENUMS[kind][1][value])
        else:
            setattr(self, name, value)
            self._alive.append(value)

    def _point_to(self, name, value):
        sizes = self.sizes_after[name]
        array = contiguous(name, value if sizes else [value], self.kinds[name].dtype, *self.kinds[name].item_shape)
        self._alive.append(array)
        setattr(self, name, array.ctypes.data)
        for size, count in zip(sizes, array.shape):
            setattr(self, size, count)

    def _point_to_struct(self, name, kind, value):
        each = [one if isinstance(one, Struct) else points(name, one)
                for one in (value if kind.many else [value])]
        array = (kind.struct * len(each))(*each)
        self._alive += [array, each]
        setattr(self, name, ctypes.addressof(array))
        for size in self.sizes_after[name]:
            setattr(self, size, len(each))


def _option(c_name, field):
    kind = options.kind_of(c_name, field)
    return {int: _INT, float: _DOUBLE}.get(kind, kind), field


def _struct_class(c_name, doc, *fields):
    """A subclass of Struct for the header's struct c_name. fields: (kind, names...), where kind is a ctypes type, an
    Array, a PointTo, or the name of an enum. A field that a row of options.py fills is given by its name alone, and has
    the row's kind."""
    each = (_option(c_name, field) if isinstance(field, str) else field for field in fields)
    kinds = {name: kind for kind, *names in each for name in names}
    types = {name: ctypes.c_void_p if isinstance(kind, (Array, PointTo)) else _INT if isinstance(kind, str) else kind
             for name, kind in kinds.items()}
    names, sizes_after = list(kinds), {}
    for at, name in enumerate(names):
        if isinstance(kinds[name], (Array, PointTo)):
            end = next((i for i in range(at + 1, len(names)) if kinds[names[i]] is not _SIZE), len(names))
            sizes_after[name] = names[at + 1:end]
    return type(c_name, (Struct,), {'__doc__': f"{doc}: {c_name}.", '_fields_': list(types.items()), 'kinds': kinds,
                                    'sizes_after': sizes_after})


def _sized_struct_class(c_name, doc, *fields):
    return _struct_class(c_name, doc, (ctypes.c_uint32, 'struct_size'), *fields)


_FLOAT = np.dtype(np.float32)


Points = _struct_class('dd_points', "Points to read", (ctypes.c_void_p, 'first'), (_SIZE, 'count', 'stride'))
PointsOut = _struct_class('dd_points_out', "Points to write", (ctypes.c_void_p, 'first'), (_SIZE, 'count', 'stride'))


def points(name, array):
    """dd_points: to an (n, 3) float32 array without copying it, or to a copy if rows aren't three adjacent floats."""
    if not (isinstance(array, np.ndarray) and array.dtype == _FLOAT and array.ndim == 2 and array.shape[1] == 3
            and array.strides[1] == 4 and array.strides[0] >= 12 and array.strides[0] % 4 == 0):
        array = contiguous(name, array, np.float32, 3)
    made = Points(first=array.ctypes.data, count=len(array), stride=array.strides[0] if len(array) else 12)
    made._alive.append(array)
    return made


def points_out(array):
    """dd_points_out of a contiguous array of 3 n single-precision numbers, written in place."""
    made = PointsOut(first=array.ctypes.data, count=array.size // 3, stride=12)
    made._alive.append(array)
    return made


Mesh = _struct_class('dd_mesh', "A triangle mesh", (Points, 'vertices'), (Array(np.int32, 3), 'triangles'),
                     (_SIZE, 'triangle_count'))
_POINTS = PointTo(Points)


def mesh(positions, triangles):
    """dd_mesh of (n, 3) and (m, 3)."""
    return Mesh(vertices=points('positions', positions), triangles=triangles)


Failure = _sized_struct_class('dd_error', "What went wrong", ('dd_status', 'status'), ('dd_subject', 'subject'),
                              ('dd_remedy', 'remedy'), (ctypes.c_int64, 'index'), (ctypes.c_char_p, 'message'))
Progress = _sized_struct_class('dd_progress', "How far a job is", ('dd_job_state', 'state'), ('dd_stage', 'stage'),
                               (_DOUBLE, 'fraction'))
BindOptions = _sized_struct_class(
    'dd_bind_options', "What a binding depends on beside mesh and roles",
    'base_metric', 'metric_smoothing', 'smoothness', ('dd_triangulation', 'triangulation'),
    ('dd_precision', 'precision'), (_INT, 'threads', 'draft'), (_POINTS, 'base'),
    (Array(np.int32, 3), 'base_triangles'), (_SIZE, 'base_triangle_count'),
    (PointTo(Points, many=True), 'examples'), (_SIZE, 'example_count'), (Array(np.float32), 'stiffness'),
    (_SIZE, 'stiffness_count'))
RefinementOptions = _sized_struct_class('dd_refinement_options', "How rotations are found iteratively", 'iterations',
                                        'rotation_smoothing', 'rim_smoothing', 'solidity')
NormalOptions = _sized_struct_class('dd_normal_options', "Of normal displacements", 'levels')
VolumesOptions = _sized_struct_class('dd_volumes_options', "Of displacement volumes", 'iterations', 'tolerance')
ExamplesOptions = _sized_struct_class('dd_examples_options', "Of posing by example", (Array(np.float64), 'weights'),
                                      (_SIZE, 'weight_count'), 'stiffness', (Array(np.float64, 2), 'limits'),
                                      (_SIZE, 'limit_count'))
UpdateOptions = _sized_struct_class(
    'dd_update_options', "What an update depends on beside the handles",
    'method', 'gradients', 'formulation', 'base_deformer', 'output', ('dd_values', 'values'), 'steps',
    (_POINTS, 'base'), (Array(np.int32), 'handle_turns'), (_SIZE, 'handle_turn_count'),
    (Array(np.float64, 3), 'turns'), (_SIZE, 'turn_count'), (Array(np.float64, 3), 'pivots'), (_SIZE, 'pivot_count'),
    (PointTo(RefinementOptions), 'refinement'), (PointTo(NormalOptions), 'normal'),
    (PointTo(VolumesOptions), 'volumes'), (PointTo(ExamplesOptions), 'examples'))
UpdateInfo = _sized_struct_class('dd_update_info', "Facts about an update that was a job", (_INT, 'volumes_converged'),
                                 (_DOUBLE, 'volume_error'))
Info = _sized_struct_class(
    'dd_deformer_info', "Facts about a bound surface",
    (_INT, 'vertex_count', 'triangle_count', 'handle_count', 'free_count', 'resting_count', 'resting_component_count',
     'resting_example', 'loose_count', 'loose_example', 'degenerate_count', 'degenerate_example',
     'idle_handle_count', 'idle_handle_example', 'stand_in_count', 'unrepresented_count', 'unrepresented_example',
     'far_count', 'far_example', 'torn_count', 'torn_example', 'proxy_vertex_count', 'coarse_vertex_count'),
    (_DOUBLE, 'bind_seconds', 'bytes'))
TransferOptions = _sized_struct_class(
    'dd_transfer_options', "What a transfer depends on beside meshes and pairs",
    'pairs_of', 'formulation', 'anchor', 'placing', ('dd_precision', 'precision'), (_INT, 'threads'), 'gap',
    (Array(np.int32), 'anchors'), (_SIZE, 'anchor_count'), (Array(np.float64, 3, 4), 'placement'),
    (Array(np.int32), 'point_triangles'), (_SIZE, 'point_triangle_count'), (Array(np.float32, 3), 'point_weights'),
    (_SIZE, 'point_weight_count'))
ApplyOptions = _sized_struct_class('dd_apply_options', "What a transferred pose depends on beside the source's",
                                   'gradients', ('dd_values', 'values'), (_POINTS, 'places'))
TransferInfo = _sized_struct_class(
    'dd_transfer_info', "Facts about a source and a target that correspond",
    (_INT, 'unmatched_count', 'unmatched_example', 'unmatched_component_count', 'unmatched_component_example',
     'loose_count', 'degenerate_count', 'degenerate_example', 'overstretched_count', 'overstretched_example',
     'through_count', 'through_example', 'mirrored', 'unknowns'), (_DOUBLE, 'nonzeros', 'worn_distance'),
    (_DOUBLE * 12, 'placement'))
MatchOptions = _sized_struct_class('dd_match_options', "How correspondences are searched for",
                                   (_INT, 'stages', 'rounds', 'threads'),
                                   (_DOUBLE, 'smoothness'), (Array(np.float64, 3, 4), 'stance'))
MatchInfo = _sized_struct_class('dd_match_info', "Facts about a correspondence that was found",
                                (_INT, 'ambiguous', 'mirrored'),
                                (_DOUBLE, 'confidence'))
RidersOptions = _sized_struct_class(
    'dd_riders_options', "What rides on what", (_INT, 'threads'), (Array(np.int32, 2), 'riders'),
    (_SIZE, 'rider_count'), (Array(np.int32, 2), 'contacts'), (_SIZE, 'contact_count'), (Array(np.float64), 'sizes'),
    (_SIZE, 'group_count'))
MeasureOptions = _sized_struct_class('dd_measure_options', "The base that normals are measured against",
                                     (_POINTS, 'base', 'deformed_base'))
Measures = _sized_struct_class('dd_measures', "How a deformed surface compares with the one at rest",
                               (_INT, 'intersecting_pairs', 'new_intersecting_pairs', 'intersecting_triangles'),
                               (_DOUBLE, 'stretch', 'normal_error', 'area_ratio', 'volume_ratio'))
STRUCTS = {kind.__name__: kind for kind in (
    Points, PointsOut, Mesh, Failure, Progress, BindOptions, RefinementOptions, NormalOptions, VolumesOptions,
    ExamplesOptions, UpdateOptions, UpdateInfo, Info, TransferOptions, ApplyOptions, TransferInfo, MatchOptions,
    MatchInfo, RidersOptions, MeasureOptions, Measures)}
OPTIONS = {name: kind for name, kind in STRUCTS.items() if name.endswith('_options')}

# {keyword of an update: (field of dd_update_options, field of the struct that it points to)} for the settings of single
# methods: each method has a struct of its own, in which the names don't repeat the method's.
METHOD_FIELDS = {
    'refine': ('refinement', 'iterations'), 'rotation_smoothing': ('refinement', 'rotation_smoothing'),
    'rim_smoothing': ('refinement', 'rim_smoothing'), 'solidity': ('refinement', 'solidity'),
    'levels': ('normal', 'levels'),
    'volume_iterations': ('volumes', 'iterations'), 'volume_tolerance': ('volumes', 'tolerance'),
    'example_weights': ('examples', 'weights'), 'example_stiffness': ('examples', 'stiffness'),
    'example_limits': ('examples', 'limits')}


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

# Parameter types of each function. Functions return a status; TEXTS return a string, and *_free nothing.
SIGNATURES = {
    'dd_last_error': [_TO(Failure)],
    'dd_last_message': [],
    'dd_abi_version': [],
    'dd_version': [],
    'dd_instruction_set': [],
    'dd_job_poll': [OBJECT, _TO(Progress)],
    'dd_job_cancel': [OBJECT],
    'dd_job_finish': [OBJECT],
    'dd_job_take_deformer': [OBJECT, _TO(OBJECT)],
    'dd_job_take_transfer': [OBJECT, _TO(OBJECT)],
    'dd_job_take_match': [OBJECT, _TO(OBJECT)],
    'dd_job_get_vertices': [OBJECT, INTS, _SIZE, _TO(_SIZE)],
    'dd_job_free': [OBJECT],
    'dd_deformer_bind_start': [_TO(Mesh), INTS, _SIZE, _INT, _TO(BindOptions), _TO(OBJECT)],
    'dd_deformer_update': [OBJECT, DOUBLES, _SIZE, _TO(UpdateOptions), _TO(PointsOut)],
    'dd_deformer_update_start': [OBJECT, DOUBLES, _SIZE, _TO(UpdateOptions), _TO(OBJECT)],
    'dd_job_get_update': [OBJECT, _TO(PointsOut)],
    'dd_job_get_update_info': [OBJECT, _TO(UpdateInfo)],
    'dd_job_take_draft': [OBJECT, _TO(OBJECT)],
    'dd_draft_update': [OBJECT, DOUBLES, _SIZE, _TO(UpdateOptions), _TO(PointsOut)],
    'dd_draft_free': [OBJECT],
    'dd_deformer_get_info': [OBJECT, _TO(Info)],
    'dd_deformer_get_vertices': [OBJECT, _INT, INTS, _SIZE, _TO(_SIZE)],
    'dd_deformer_get_example_weights': [OBJECT, DOUBLES, _SIZE],
    'dd_deformer_free': [OBJECT],
    'dd_transfer_start': [_TO(Mesh), _TO(Mesh), INTS, _SIZE, _TO(TransferOptions), _TO(OBJECT)],
    'dd_transfer_apply': [OBJECT, _TO(Points), _TO(ApplyOptions), _TO(PointsOut)],
    'dd_transfer_get_info': [OBJECT, _TO(TransferInfo)],
    'dd_transfer_free': [OBJECT],
    'dd_match_start': [_TO(Mesh), _TO(Mesh), INTS, _SIZE, _TO(MatchOptions), _TO(OBJECT)],
    'dd_match_get_info': [OBJECT, _TO(MatchInfo)],
    'dd_match_get_positions': [OBJECT, _TO(PointsOut)],
    'dd_match_get_pairs': [OBJECT, INTS, _SIZE, _TO(_SIZE)],
    'dd_match_get_points': [OBJECT, INTS, FLOATS, _SIZE],
    'dd_match_get_confidence': [OBJECT, FLOATS, _SIZE],
    'dd_match_free': [OBJECT],
    'dd_riders_make': [_TO(Mesh), _TO(RidersOptions), _TO(OBJECT)],
    'dd_riders_place': [OBJECT, _TO(Points), _TO(PointsOut)],
    'dd_riders_free': [OBJECT],
    'dd_mesh_measure': [_TO(Mesh), INTS, _SIZE, _TO(Points), _TO(MeasureOptions), _TO(Measures)],
    'dd_mesh_distances': [_TO(Mesh), INTS, _SIZE, FLOATS, _SIZE],
    'dd_mesh_vertex_gradients': [_TO(Mesh), _TO(Points), FLOATS, _SIZE],
    **{f'{name}_init': [_TO(kind), _SIZE] for name, kind in OPTIONS.items()},
}
TEXTS = ('dd_version', 'dd_instruction_set', 'dd_last_message')


def result_type(function):
    return ctypes.c_char_p if function in TEXTS else None if function.endswith('_free') else _INT
