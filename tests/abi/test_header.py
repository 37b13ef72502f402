# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of the add-on's ctypes layer against the header: neither can change alone."""

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from conftest import part, rotation

INCLUDE = Path(__file__).resolve().parents[2] / 'native' / 'include'
TEXT = (INCLUDE / 'detail_deform' / 'detail_deform.h').read_text(encoding='utf-8')
CODE = re.sub(r'/\*.*?\*/', ' ', TEXT, flags=re.S)
NUMBERS = {'int32_t': ctypes.c_int32, 'int64_t': ctypes.c_int64, 'uint32_t': ctypes.c_uint32, 'size_t': ctypes.c_size_t,
           'double': ctypes.c_double, 'float': ctypes.c_float}


def header_enums():
    found = {}
    for name, body in re.findall(r'DD_ENUM\((dd_\w+)\)\s*\{(.*?)\};', CODE, re.S):
        found[name] = {key: int(value) for key, value in re.findall(r'(\w+)\s*=\s*(-?\d+)', body)}
        written_out = body.count('=') == len(found[name]) == len(re.findall(r'DD_\w+', body))
        assert written_out, name
    return found


def header_structs():
    """{name: [(type, field, length, comment)]}"""
    found = {}
    for name, body in re.findall(r'typedef struct (dd_\w+) \{(.*?)\} \1;', TEXT, re.S):
        body = re.sub(r'^  /\*.*?\*/$', '', body, flags=re.S | re.M)  # comments on several fields
        found[name] = [(kind, field, int(length or 0), ' '.join(comment.split())) for kind, field, length, comment in
                       re.findall(r'((?:const )?\w+\*?)\s+(\w+)(?:\[(\d+)\])?;[ ]*(?:/\*(.*?)\*/)?', body, re.S)]
    return found


def header_functions():
    """{name: (result, [types of parameters])}"""
    found = {}
    for result, name, parameters in re.findall(r'^DD_API ([^;]*?)(dd_\w+)\((.*?)\);', CODE, re.S | re.M):
        names = [' '.join(one.split()) for one in parameters.split(',')]
        found[name] = (result.strip(), [] if names == ['void'] else [one[:one.rindex(' ')] for one in names])
    return found


def test_enums(structs):
    assert int(re.search(r'DD_ABI_VERSION (\d+)', CODE)[1]) == structs.ABI_VERSION
    ours = {name: {prefix + key: value for key, value in values.items()}
            for name, (prefix, values) in structs.ENUMS.items()}
    assert ours == header_enums()


def test_structs(structs):
    declared = header_structs()
    assert declared.keys() == structs.STRUCTS.keys()
    for name, fields in declared.items():
        ours = structs.STRUCTS[name]
        assert [field for _, field, _, _ in fields] == list(ours.kinds), name
        assert ('struct_size' in ours.kinds) == (name not in ('dd_points', 'dd_points_out', 'dd_mesh'))
        for kind, field, length, _ in fields:
            where, told = f'{name}.{field}', ours.kinds[field]
            base = kind.replace('const ', '').rstrip('*')
            if kind == 'const char*':
                assert told is ctypes.c_char_p, where
            elif kind.endswith('*') and base in structs.STRUCTS:
                assert isinstance(told, structs.PointTo) and told.struct is structs.STRUCTS[base], where
            elif kind.endswith('*') and field == 'first':
                assert told is ctypes.c_void_p and base == 'float', where
            elif kind.endswith('*'):
                assert isinstance(told, structs.Array) and told.dtype == np.dtype(NUMBERS[base]), where
            elif length:
                assert told is NUMBERS[kind] * length, where
            else:
                assert told == NUMBERS.get(kind, structs.STRUCTS.get(kind, kind)), where


def c_type(structs, declared):
    """The ctypes parameter that stands for a declared one."""
    base = declared.replace('const ', '')
    if base in NUMBERS:
        return NUMBERS[base]
    if base in structs.ENUMS:
        return ctypes.c_int32
    if base == 'size_t*':
        return ctypes.POINTER(ctypes.c_size_t)
    arrays = {'float*': structs.FLOATS, 'double*': structs.DOUBLES, 'int32_t*': structs.INTS}
    if base in arrays:
        return arrays[base]
    name = base.rstrip('*')
    if base.endswith('**'):
        return ctypes.POINTER(structs.OBJECT)
    return ctypes.POINTER(structs.STRUCTS[name]) if name in structs.STRUCTS else structs.OBJECT


def test_functions(structs):
    declared = header_functions()
    assert declared.keys() == structs.SIGNATURES.keys()
    results = {'int32_t': ctypes.c_int32, 'dd_status': ctypes.c_int32, 'const char*': ctypes.c_char_p, 'void': None}
    for name, (result, parameters) in declared.items():
        assert structs.result_type(name) == results[result], name
        assert structs.SIGNATURES[name] == [c_type(structs, kind) for kind in parameters], name
        assert len(parameters) <= 6, f"{name} is a call with too many parameters"


def test_layout_as_the_c_compiler_has_it(structs, tmp_path):
    compiler = shutil.which('cc')
    if not compiler:
        pytest.skip("no C compiler")
    lines = [f'P("{name}", sizeof({name}))\n' + '\n'.join(
        f'P("{name}.{field}", offsetof({name}, {field}))' for _, field, _, _ in fields)
        for name, fields in header_structs().items()]
    (tmp_path / 'layout.c').write_text(
        '#include "detail_deform/detail_deform.h"\n#include <stdio.h>\n'
        '#define P(name, value) printf("%s %d\\n", name, (int)(value));\n'
        'int main(void) {\n' + '\n'.join(lines) + '\nreturn 0;\n}\n')
    subprocess.run([compiler, '-std=c99', '-I', str(INCLUDE), '-o', tmp_path / 'layout', tmp_path / 'layout.c'],
                   check=True)
    compiled = dict(line.split() for line in subprocess.run(
        [tmp_path / 'layout'], check=True, capture_output=True, text=True).stdout.splitlines())
    ours = {}
    for name, kind in structs.STRUCTS.items():
        ours[name] = str(ctypes.sizeof(kind))
        ours |= {f'{name}.{field}': str(getattr(kind, field).offset) for field in kind.kinds}
    assert compiled == ours


# Defaults.

MOTION = rotation(0.8, (0.5, 0, 3))


def bind_of(native, structs, strip, options):
    lib, job, deformer = native.library(), ctypes.c_void_p(), ctypes.c_void_p()
    surface = structs.mesh(strip.positions, strip.triangles)
    assert lib.dd_deformer_bind_start(surface, strip.roles, len(strip.roles), 1, options, job) == 0
    assert lib.dd_job_take_deformer(job, deformer) == 0
    lib.dd_job_free(job)
    return deformer


def frame(native, structs, deformer, strip, options):
    out = np.empty_like(strip.positions)
    assert native.library().dd_deformer_update(deformer, MOTION, 1, options, structs.points_out(out)) == 0
    return out


def taken(native, kind, job):
    made = ctypes.c_void_p()
    assert getattr(native.library(), f'dd_job_take_{kind}')(job, made) == 0
    native.library().dd_job_free(job)
    return made


def by_default(native, structs, strip, given):
    """Results of each family of calls. given(struct): options to pass, or None."""
    lib, job, found = native.library(), ctypes.c_void_p(), {}
    deformer = bind_of(native, structs, strip, given(structs.BindOptions))
    found['update'] = frame(native, structs, deformer, strip, given(structs.UpdateOptions))
    lib.dd_deformer_free(deformer)
    surface, pose = structs.mesh(strip.positions, strip.triangles), (strip.positions ** 2 / 20).astype(np.float32)
    longer = (strip.positions * np.float32([1, 1, 1.4])).astype(np.float32)
    target = structs.mesh(longer, strip.triangles)
    assert lib.dd_transfer_start(surface, target, None, 0, given(structs.TransferOptions), job) == 0
    transfer, found['transfer'] = taken(native, 'transfer', job), np.empty_like(strip.positions)
    assert lib.dd_transfer_apply(transfer, structs.points('pose', pose), given(structs.ApplyOptions),
                                 structs.points_out(found['transfer'])) == 0
    lib.dd_transfer_free(transfer)
    markers = np.int32([[0, 0], [7, 7], [191, 191]])
    assert lib.dd_match_start(surface, surface, markers, 3, given(structs.MatchOptions), job) == 0
    match, found['match'] = taken(native, 'match', job), np.empty_like(strip.positions)
    assert lib.dd_match_get_positions(match, structs.points_out(found['match'])) == 0
    lib.dd_match_free(match)
    measures = structs.Measures()
    assert lib.dd_mesh_measure(surface, strip.roles, len(strip.roles), structs.points('pose', pose),
                               given(structs.MeasureOptions), measures) == 0
    found['measure'] = np.frombuffer(bytes(measures), np.uint8)
    return found


def test_a_null_pointer_stands_for_all_defaults(native, structs, strip):
    left_out = by_default(native, structs, strip, lambda kind: None)
    filled = by_default(native, structs, strip, native.filled)
    assert all((left_out[name] == filled[name]).all() for name in left_out)
    assert np.abs(left_out['update'] - strip.positions).max() > 1


def test_all_defaults_give_what_the_add_on_gives_by_default(native, structs, strip):
    """The defaults of the add-on's table of options, passed one by one."""
    options = part('library.options')

    def told(table, *structs_of):
        return {option.keyword if option.struct in options.OF_UPDATE else option.fills.name:
                option.fills.value(usual(option)) for option in table if option.struct in structs_of}

    found = by_default(native, structs, strip, lambda kind: None)
    deformer = native.Bind(strip.positions, strip.triangles, strip.roles, 1,
                           **told(options.SETTINGS, options.BIND)).finish()
    offsets = deformer.offsets(MOTION, **told(options.SETTINGS, *options.OF_UPDATE)).reshape(-1, 3)
    assert np.abs(strip.positions + offsets - found['update']).max() < 1e-5
    longer = (strip.positions * np.float32([1, 1, 1.4])).astype(np.float32)
    transfer = native.Transfer((strip.positions, strip.triangles), (longer, strip.triangles),
                               **told(options.TRANSFER_SETTINGS, options.TRANSFER))
    pose = (strip.positions ** 2 / 20).astype(np.float32)
    assert (transfer.apply(pose, **told(options.TRANSFER_SETTINGS, options.APPLY)) == found['transfer']).all()


def usual(option):
    """A setting's default: the table's own, or Blender's for its kind."""
    if option.default is not None:
        return option.default
    return option.kind[0][0] if isinstance(option.kind, tuple) else option.kind()


def told_defaults():
    """Defaults stated in the header's comments: (struct, field, number or name)."""
    return [(name, field, word.rstrip('.')) for name, fields in header_structs().items()
            for _, field, _, comment in fields for word in re.findall(r'[Bb]y default (DD_\w+|[\d.]+)', comment)]


@pytest.mark.parametrize('struct, field, word', told_defaults())
def test_defaults_are_what_the_header_says(native, structs, struct, field, word):
    found = getattr(native.filled(structs.STRUCTS[struct]), field)
    values = {name: number for enum in header_enums().values() for name, number in enum.items()}
    assert found == (values[word] if word in values else float(word))


def test_each_number_and_choice_has_its_default_told(structs):
    told = {(struct, field) for struct, field, _ in told_defaults()}
    untold = {(name, field) for name, kind in structs.OPTIONS.items() for field, of in kind.kinds.items()
              if (isinstance(of, str) or of in (ctypes.c_int32, ctypes.c_double)) and (name, field) not in told}
    assert {field for _, field in untold} == {'threads', 'formulation', 'base_metric'}  # stated in other words


def test_no_value_stands_for_another(native, structs, strip):
    """Zero means zero and not the default: no smoothing, no refinement, no stiffness."""
    def fresh():
        return native.Bind(strip.positions, strip.triangles, strip.roles, 1).finish()

    deformer = fresh()
    plain = deformer.offsets(MOTION)
    for field in ('refine', 'rim_smoothing', 'rotation_smoothing'):
        assert np.abs(fresh().offsets(MOTION, **{field: 0}) - plain).max() > 1e-5, field  # also as the first update
        assert np.abs(deformer.offsets(MOTION, **{field: 0}) - plain).max() > 1e-5, field
    still = deformer.offsets(MOTION, method='VOLUMES')
    assert np.abs(deformer.offsets(MOTION, method='VOLUMES', volume_iterations=0) - still).max() > 1e-5
    examples = native.Bind(strip.positions, strip.triangles, strip.roles, 1,
                           examples=strip.positions[None] * np.float32([1, 1, 2])).finish()
    weights = []
    for stiffness in (0.0, 1.0):
        assert np.isfinite(examples.offsets(MOTION, method='EXAMPLES', example_stiffness=stiffness)).all()
        weights.append(examples.example_weights()[0])
    assert weights[0] != weights[1]


def test_an_error_tells_what_it_is_about_and_what_to_do(native, structs, strip):
    def refused(call):
        with pytest.raises(native.NativeError) as caught:
            call()
        error = caught.value
        assert str(error).startswith({'HANDLE': 'Handle', 'VERTEX': 'Vertex', 'NONE': ''}[error.subject])
        assert error.message in str(error) and not error.message.endswith('.')
        return error.status, error.subject, error.index, error.remedy

    def bind(roles=strip.roles, handles=1, positions=strip.positions):
        return native.Bind(positions, strip.triangles, roles, handles).finish()

    broken = strip.positions.copy()
    broken[7] = np.nan
    status, nowhere = structs.STATUS, np.full((1, 3, 4), np.nan)
    assert refused(lambda: bind(handles=2)) == (status['ERROR_REGION'], 'HANDLE', 1, 'ASSIGN_VERTICES')
    assert refused(lambda: bind(positions=broken)) == (status['ERROR_MESH'], 'VERTEX', 7, 'MOVE_VERTEX')
    assert refused(lambda: bind(roles=strip.roles[1:])) == (status['ERROR_ARGUMENT'], 'NONE', -1, 'CALL')
    assert refused(lambda: bind().offsets(nowhere)) == (status['ERROR_ARGUMENT'], 'HANDLE', 0, 'CALL')
    assert refused(lambda: bind().offsets(np.full((1, 3, 4), 1e38)))[1:] == ('HANDLE', 0, 'MOVE_LESS')
    folded = strip.positions.copy()
    folded[strip.triangles[3]] = folded[strip.triangles[3][0]]
    with pytest.raises(native.NativeError) as caught:
        native.Transfer((strip.positions, strip.triangles), (folded, strip.triangles), formulation='FOURTH_POINTS')
    assert caught.value.subject == 'TARGET_TRIANGLE' and 'of the target has no area' in str(caught.value)


def test_points_may_lie_apart(native, structs, strip):
    """With a stride: coordinates beside other data of each vertex."""
    wide = np.full((len(strip.positions), 8), np.nan, np.float32)
    wide[:, 2:5] = strip.positions
    lib, found = native.library(), []
    for positions in (strip.positions, wide[:, 2:5]):
        assert structs.points('positions', positions).first == positions.ctypes.data
        deformer = native.Bind(positions, strip.triangles, strip.roles, 1).finish()
        found.append(deformer.offsets(MOTION).copy())
    assert (found[0] == found[1]).all()
    out = np.full((len(strip.positions), 5), 7, np.float32)
    points = structs.PointsOut(first=out.ctypes.data, count=len(out), stride=20)
    assert lib.dd_deformer_update(deformer._handle, MOTION, 1, native.filled(structs.UpdateOptions, values='OFFSETS'),
                                  points) == 0
    assert (out[:, :3].ravel() == found[0]).all() and (out[:, 3:] == 7).all()


def test_the_example_of_the_header_compiles_and_the_header_without_a_warning(tmp_path):
    example = re.search(r'many times a second:\n(.*?)\n \*\n', TEXT, re.S)[1]
    lines = [line.removeprefix(' *').strip() for line in example.splitlines()]
    body = ['#include "detail_deform/detail_deform.h"', '#include <stdio.h>',
            'int use(const float* positions, size_t vertex_count, const int32_t* triangles, size_t triangle_count,',
            '        const int32_t* roles, int32_t handle_count, const double* matrices, float* result);',
            'int use(const float* positions, size_t vertex_count, const int32_t* triangles, size_t triangle_count,',
            '        const int32_t* roles, int32_t handle_count, const double* matrices, float* result) {',
            *lines, 'return 0;', '}']
    for compiler, standard, name in (('cc', 'c99', 'use.c'), ('c++', 'c++17', 'use.cpp')):
        if not shutil.which(compiler):
            pytest.skip("no compiler")
        text = '\n'.join(body)
        (tmp_path / name).write_text(text.replace('NULL', 'nullptr') if name.endswith('cpp') else text)
        subprocess.run([compiler, f'-std={standard}', '-Wall', '-Wextra', '-Wpedantic', '-Werror', '-I', str(INCLUDE),
                        '-c', '-o', tmp_path / f'{name}.o', tmp_path / name], check=True)
