# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of options against the header, and against itself."""

import ctypes

import pytest

from conftest import part
from test_header import header_enums, header_structs, usual

OPTIONS = part('library.options')
FILLING = [option for option in OPTIONS.SETTINGS + OPTIONS.TRANSFER_SETTINGS if option.fills]
C_TYPES = {int: 'int32_t', float: 'double'}


def named(option):
    return f'{option.struct}.{option.fills.name}'


@pytest.mark.parametrize('option', FILLING, ids=named)
def test_a_row_fills_a_field_of_its_kind(option, structs):
    kinds = {field: kind for kind, field, _, _ in header_structs()[option.struct]}
    assert kinds[option.fills.name] == C_TYPES.get(option.fills.kind, option.fills.kind)
    if isinstance(option.kind, tuple):
        prefix, _ = structs.ENUMS[option.fills.kind]
        named_there = dict(header_enums()[option.fills.kind])
        if option.name == 'pairs_of':
            del named_there['DD_PAIRS_OF_NEAREST']  # not a choice in the panel
        assert {prefix + option.fills.value(name): number
                for name, number in OPTIONS.enum_numbers(option.kind).items()} == named_there


@pytest.mark.parametrize('option', FILLING, ids=named)
def test_a_default_is_the_librarys(option, structs, native):
    told = option.fills.value(usual(option))
    if isinstance(told, str):
        told = structs.ENUMS[option.fills.kind][1][told]
    assert told == getattr(native.filled(structs.STRUCTS[option.struct]), option.fills.name)


def test_every_number_and_choice_of_bind_and_update_has_its_row(structs):
    filled = {(option.struct, option.fills.name) for option in FILLING}
    told_otherwise = {'precision', 'draft', 'threads', 'triangulation', 'values'}
    for struct in (OPTIONS.BIND, *OPTIONS.OF_UPDATE):
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
            assert option.off is None or option.needs  # it is for where they are unmet
