# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of options against the header, and against itself."""

import ctypes
import re

import pytest

from conftest import part
from test_header import TEXT, header_enums, header_structs

OPTIONS = part('library.options')
FILLING = [option for option in OPTIONS.SETTINGS + OPTIONS.TRANSFER_SETTINGS if option.fills]
C_TYPES = {int: 'int32_t', float: 'double'}


def named(option):
    return f'{option.struct}.{option.fills.name}'


def comment_of(option):
    return next(comment for _, field, _, comment in header_structs()[option.struct] if field == option.fills.name)


@pytest.mark.parametrize('option', FILLING, ids=named)
def test_a_row_fills_a_field_of_its_kind(option, structs):
    kinds = {field: kind for kind, field, _, _ in header_structs()[option.struct]}
    assert kinds[option.fills.name] == C_TYPES.get(option.fills.kind, 'int32_t')
    if isinstance(option.fills.kind, str):
        assert comment_of(option).startswith(option.fills.kind)
    if isinstance(option.kind, tuple):
        prefix, _ = structs.ENUMS[option.fills.kind]
        named_there = dict(header_enums()[option.fills.kind])
        if option.name == 'pairs_of':
            del named_there['DD_PAIRS_OF_NEAREST']  # which no list has
        assert {prefix + name: number for name, number in OPTIONS.numbers_of(option.kind).items()} == named_there


def zero_stands_for(option, structs):
    """By the header: the value in the library's terms."""
    number = re.search(r'0 stands for ([\d.]+\d|\d)', comment_of(option))
    if number:
        return float(number[1])
    if not isinstance(option.fills.kind, str):
        return 0
    prefix, values = structs.ENUMS[option.fills.kind]
    usual = re.search(rf'{prefix}DEFAULT = 0, +/\* ([\w ]+) \*/', TEXT)
    return values[usual[1].upper().replace(' ', '_')] if usual else 0


@pytest.mark.parametrize('option', FILLING, ids=named)
def test_a_default_is_what_a_zero_stands_for(option, structs):
    default = option.default
    if default is None:
        default = option.kind[0][0] if isinstance(option.kind, tuple) else option.kind()
    told = option.fills.value(default)
    if isinstance(told, str):
        told = structs.ENUMS[option.fills.kind][1][told]
    if named(option) == 'dd_apply_options.gradients':
        assert told == structs.GRADIENTS['WHOLE']  # transfers between meshes take the stretch along, as theirs do
    else:
        assert told == zero_stands_for(option, structs)


@pytest.mark.parametrize('option', [option for option in FILLING if 'min' in option.limits], ids=named)
def test_the_least_value_is_not_taken_for_the_default(option, structs):
    if option.name == 'refine':
        return  # the library's wrapper has a word for none
    told = option.fills.value(option.limits['min'])
    assert told != 0 or zero_stands_for(option, structs) == 0


def test_every_number_and_choice_of_bind_and_update_has_its_row(structs):
    filled = {(option.struct, option.fills.name) for option in FILLING}
    told_otherwise = {'precision', 'draft', 'threads', 'triangulation', 'values'}
    for struct in (OPTIONS.BIND, OPTIONS.UPDATE):
        for field, kind in structs.STRUCTS[struct].kinds.items():
            if isinstance(kind, str) or kind in (ctypes.c_int32, ctypes.c_double):
                assert (struct, field) in filled or field in told_otherwise, f"{struct}.{field}"


def test_needs_name_settings_and_values_that_there_are():
    for table in (OPTIONS.SETTINGS, OPTIONS.TRANSFER_SETTINGS):
        rows = {option.name: option for option in table}
        assert len(rows) == len(table)
        for option in table:
            for need in option.needs:
                kind, limits = rows[need.name].kind, rows[need.name].limits
                possible = ({value[0] for value in kind} if isinstance(kind, tuple) else {False, True} if kind is bool
                            else set(range(limits['min'], limits['max'] + 1)))
                assert set(need.values) < possible, f"{option.name} needs {need}"
                assert not need.why_not or need.why_not.endswith('.')
            assert option.off is None or any(need.why_not for need in option.needs)
