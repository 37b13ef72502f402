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
NUMBERS = {'int32_t': ctypes.c_int32, 'uint32_t': ctypes.c_uint32, 'size_t': ctypes.c_size_t,
           'double': ctypes.c_double, 'float': ctypes.c_float}


def header_enums():
    found = {}
    for name, body in re.findall(r'enum (dd_\w+) \{(.*?)\};', CODE, re.S):
        found[name] = {key: int(value) for key, value in re.findall(r'(\w+)\s*=\s*(-?\d+)', body)}
        assert body.count('=') == body.strip(', \n').count(',') + 1, f"{name}: each value is written out"
    return found


def header_structs():
    """{name: [(type, field, length, comment)]}"""
    found = {}
    for name, body in re.findall(r'typedef struct (dd_\w+) \{(.*?)\} \1;', TEXT, re.S):
        found[name] = [(kind, field, int(length or 0), ' '.join(comment.split())) for kind, field, length, comment in
                       re.findall(r'((?:const )?\w+\*?)\s+(\w+)(?:\[(\d+)\])?;\s*(?:/\*(.*?)\*/)?', body, re.S)]
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
    # Zero is a default: it is a value of every enum that an option may be of.
    options = {kind for fields in structs.STRUCTS.values() for kind in fields.kinds.values() if isinstance(kind, str)}
    assert all(0 in structs.ENUMS[name][1].values() for name in options)


def test_structs(structs):
    declared = header_structs()
    assert declared.keys() == structs.STRUCTS.keys()
    for name, fields in declared.items():
        ours = structs.STRUCTS[name]
        assert [field for _, field, _, _ in fields] == list(ours.kinds), name
        assert ('struct_size' in ours.kinds) == (name not in ('dd_mesh', 'dd_tet_mesh'))
        for kind, field, length, comment in fields:
            where, told = f'{name}.{field}', ours.kinds[field]
            if kind == 'const char*':
                assert told is ctypes.c_char_p, where
            elif kind.endswith('*'):
                assert isinstance(told, structs.Array), where
                assert told.dtype == np.dtype(NUMBERS[kind[len('const '):-1]]), where
            elif length:
                assert told is NUMBERS[kind] * length, where
            elif kind == 'int32_t' and re.match(r'dd_\w+\b(?!_options)', comment):
                # The comment begins with the enum that the field is of.
                assert told == re.match(r'dd_\w+', comment)[0], where
            else:
                assert told is NUMBERS[kind], where


def c_type(structs, declared):
    """The ctypes parameter that stands for a declared one."""
    base = declared.replace('const ', '')
    if base in NUMBERS:
        return NUMBERS[base]
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
    results = {'int32_t': ctypes.c_int32, 'const char*': ctypes.c_char_p, 'void': None}
    for name, (result, parameters) in declared.items():
        assert structs.result_type(name) == results[result], name
        assert structs.SIGNATURES[name] == [c_type(structs, kind) for kind in parameters], name
        assert len(parameters) <= 7, f"{name} is a call with too many parameters"


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


# Zero is every option's default.

MOTION = rotation(0.8, (0.5, 0, 3))


def bind_of(native, structs, strip, options):
    lib, job, deformer = native.library(), ctypes.c_void_p(), ctypes.c_void_p()
    surface = structs.Mesh(positions=strip.positions, triangles=strip.triangles)
    assert lib.dd_bind_start(surface, strip.roles, len(strip.roles), 1, options, job) == 0
    assert lib.dd_job_take_deformer(job, deformer) == 0
    lib.dd_job_free(job)
    return deformer


def frame(native, deformer, strip, options):
    out = np.empty_like(strip.positions)
    assert native.library().dd_deformer_update(deformer, MOTION, 1, options, out, len(out)) == 0
    return out


def test_a_null_pointer_stands_for_a_struct_of_zeros(native, structs, strip):
    lib, found = native.library(), []
    for zeros in (False, True):
        deformer = bind_of(native, structs, strip, structs.BindOptions() if zeros else None)
        found.append(frame(native, deformer, strip, structs.UpdateOptions() if zeros else None))
        lib.dd_deformer_free(deformer)
    assert (found[0] == found[1]).all() and np.abs(found[0] - strip.positions).max() > 1
    surface = structs.Mesh(positions=strip.positions, triangles=strip.triangles)
    found.clear()
    for zeros in (False, True):
        job, transfer, match, _count = (ctypes.c_void_p() for _ in range(3)), None, None, ctypes.c_size_t()
        job, transfer, match = job
        options = structs.TransferOptions() if zeros else None
        assert lib.dd_transfer_start(surface, surface, None, 0, options, job) == 0
        assert lib.dd_job_take_transfer(job, transfer) == 0
        lib.dd_job_free(job)
        out, pose = np.empty_like(strip.positions), (strip.positions ** 2 / 20).astype(np.float32)
        options = structs.ApplyOptions(gradients='WHOLE')
        assert lib.dd_transfer_apply(transfer, pose, len(pose), options, out, len(out)) == 0
        lib.dd_transfer_free(transfer)
        markers = np.int32([[0, 0], [7, 7], [191, 191]])
        assert lib.dd_match_start(surface, surface, markers, 3, structs.MatchOptions() if zeros else None, job) == 0
        assert lib.dd_job_take_match(job, match) == 0
        lib.dd_job_free(job)
        fitted = np.empty_like(strip.positions)
        assert lib.dd_match_get_positions(match, fitted, len(fitted)) == 0
        lib.dd_match_free(match)
        measures = structs.Measures()
        options = structs.MeasureOptions() if zeros else None
        assert lib.dd_measure(surface, strip.roles, len(strip.roles), pose, len(pose), options, measures) == 0
        found.append((out.tobytes(), fitted.tobytes(), bytes(measures)))
    assert found[0] == found[1]


def told_defaults():
    """What the header says that a zero stands for."""
    return [(name, field, float(number[1])) for name, fields in header_structs().items()
            for _, field, _, comment in fields
            for number in [re.search(r'0 stands for ([\d.]+\d|\d)', comment)] if number]


@pytest.mark.parametrize('struct, field, value', told_defaults())
def test_zero_stands_for_what_the_header_says(native, structs, strip, struct, field, value):
    kind = structs.STRUCTS[struct]
    value = int(value) if kind.kinds[field] is ctypes.c_int32 else value
    if struct == 'dd_match_options':
        target = strip.positions * np.float32([1, 1, 1.5])
        found = [native.Match((strip.positions, strip.triangles), (target, strip.triangles),
                              [[0, 0], [7, 7], [184, 184], [191, 191]], **{field: number}).finish()
                 for number in (0, value, 2 * value)]
        same, other = ([(a == b).all() for a, b in zip(found[0], one)] for one in found[1:])
        assert all(same) and (field == 'reach' or not all(other))
        return
    if struct == 'dd_transfer_options':  # the source comes up to what is pinned
        above, up = np.float32([0, 0, 2]), np.float32([0, 0, 1.95])
        found = [native.Transfer((strip.positions, strip.triangles), (strip.positions + above, strip.triangles),
                                 pairs_of='NEAREST', anchor='PINNED', anchors=[0, 90],
                                 **{field: number}).apply(strip.positions + up, 'WHOLE')
                 for number in (0, value, 100 * value)]
        assert (found[0] == found[1]).all() and (found[0] != found[2]).any()
        return
    assert struct == 'dd_update_options'
    of = {option.fills.name: need.values[0] for option in part('library.options').SETTINGS if option.fills
          for need in option.needs if need.name == 'method'}
    # What lets the field matter: a search that isn't over before, or one that its stiffness holds back.
    others = {'volume_tolerance': 1e-9} if field == 'volume_iterations' else {}
    poses, more = None, 2
    if field == 'example_stiffness':
        poses, more = strip.positions[None] * np.float32([1, 1, 2]), 1000
    deformer = bind_of(native, structs, strip, structs.BindOptions(examples=poses))
    found = [frame(native, deformer, strip, structs.UpdateOptions(method=of.get(field), **{field: number}, **others))
             for number in (0, value, more * value)]
    native.library().dd_deformer_free(deformer)
    assert (found[0] == found[1]).all() and (found[0] != found[2]).any()


def test_defaults_are_told():
    assert [field for _, field, _ in told_defaults()] == [
        'refine', 'levels', 'volume_tolerance', 'volume_iterations', 'steps', 'example_stiffness', 'rim_smoothing',
        'rotation_smoothing', 'gap', 'stages', 'rounds', 'smoothness', 'identity', 'reach']
