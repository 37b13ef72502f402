# SPDX-License-Identifier: GPL-3.0-or-later
"""What users read: every setting and operator says what it is for."""

import bpy
import pytest


def described():
    settings = bpy.types.Object.bl_rna.properties['detail_deform'].fixed_type
    groups = [settings, *(settings.properties[name].fixed_type for name in ('handles', 'examples', 'transfer'))]
    operators = [getattr(bpy.ops.object, name).get_rna_type() for name in dir(bpy.ops.object)
                 if name.startswith('detail_deform')]
    return groups, operators


def visible(rna):
    return [p for p in rna.properties if p.identifier not in {'rna_type', 'name'} and not p.is_hidden]


def test_every_setting_and_operator_has_a_tooltip():
    groups, operators = described()
    assert len(operators) >= 20
    for rna in (*groups, *operators):
        for prop in visible(rna):
            assert len(prop.description) > 10, f"{rna.identifier}.{prop.identifier}"
            if prop.type == 'ENUM':
                for item in prop.enum_items:
                    assert len(item.description) > 10, f"{prop.identifier} {item.identifier}"
    for rna in operators:
        assert len(rna.description) > 20, rna.identifier


def test_tooltips_end_as_blenders_do():
    """Blender adds the full stop."""
    groups, operators = described()
    for rna in (*groups, *operators):
        for text in (rna.description if rna in operators else "", *(p.description for p in visible(rna))):
            assert not text.endswith('.'), text


@pytest.mark.parametrize('name', ['Detail Deform', 'Handles', 'Examples', 'Base Surface', 'Advanced',
                                  'Detail Deform: Transfer'])
def test_panels_are_there(name):
    assert any(getattr(getattr(bpy.types, kind), 'bl_label', "") == name for kind in dir(bpy.types)
               if kind.startswith('OBJECT_PT_detail_deform'))
