# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of options: Blender's properties agree with it, and each setting either changes the result or has the
reason why not that the table states."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, bind, evaluated, make_strip, own, update

METHODS = ('TRANSFER', 'VARIATIONAL', 'NORMAL', 'GRADIENT', 'VOLUMES', 'EXAMPLES')
TYPES = {bool: 'BOOLEAN', int: 'INT', float: 'FLOAT', str: 'STRING'}


@pytest.fixture
def options(part):
    return part('library.options')


@pytest.fixture
def look(part):
    return part('follow.update_options')


@pytest.fixture
def strip():
    """A bound strip with an example, its handle moved, turned and scaled, in which every setting can have an effect."""
    ob = make_strip(n=17)
    ob.shape_key_add(name="Basis", from_mix=False)
    bent = own(ob)
    bent[:, 2] += 0.5 * bent[:, 0] ** 2
    ob.shape_key_add(name="Bent", from_mix=False).data.foreach_set('co', bent.astype(np.float32).ravel())
    assert bpy.ops.object.detail_deform_examples_from_keys() == {'FINISHED'}
    ob.detail_deform.metric_smoothing = 0.5  # without it Smooth Displacement has one metric
    ob.detail_deform.volume_tolerance = 1.0  # the search ends before the limit of iterations
    # Automatic chooses Linear for such a turn; with Linear set, other_value() chooses Motions.
    ob.detail_deform.base_deformer = 'LINEAR'
    bind(ob)
    target = ob.detail_deform.handles[0].target
    motion = Matrix.Translation((-0.1, 0, 0.1)) @ Matrix.Rotation(0.3, 4, 'Y')
    target.matrix_world = motion @ target.matrix_world @ Matrix.Scale(1.2, 4)
    update()
    return ob


def tables(options):
    return ((bpy.types.PropertyGroup.bl_rna_get_subclass_py('DetailDeformSettings'), options.SETTINGS),
            (bpy.types.PropertyGroup.bl_rna_get_subclass_py('DetailDeformTransfer'), options.TRANSFER_SETTINGS))


def test_properties_agree_with_the_table(options):
    for cls, table in tables(options):
        for option in table:
            found = cls.bl_rna.properties[option.name]
            assert (found.name, found.description) == (option.title, option.tooltip)
            if isinstance(option.kind, tuple):
                assert found.type == 'ENUM' and found.default == (option.default or option.kind[0][0])
                values = [(v.identifier, v.name, v.description) for v in found.enum_items]
                assert sorted(values) == sorted(option.kind)
                assert {v.identifier: v.value for v in found.enum_items} == options.enum_numbers(option.kind)
                assert not option.compared or [v[0] for v in values[-len(option.compared):]] == list(option.compared)
                continue
            assert found.type == TYPES[option.kind]
            assert found.default == pytest.approx(option.kind() if option.default is None else option.default)
            if option.kind in (int, float):
                limits = option.limits
                assert (found.hard_min, found.hard_max) == pytest.approx((limits['min'], limits['max']))
                assert found.soft_min == pytest.approx(limits['min'])
                assert found.soft_max == pytest.approx(limits.get('soft_max', limits['max']))


def test_arguments_of_the_operator_are_the_settings(options):
    found = bpy.ops.object.detail_deform_transfer.get_rna_type().properties
    settings = bpy.types.PropertyGroup.bl_rna_get_subclass_py('DetailDeformTransfer').bl_rna.properties
    for option in options.TRANSFER_SETTINGS:
        argument, setting = found[option.name], settings[option.name]
        assert argument.is_skip_save and argument.description == (option.argument_tooltip or option.tooltip)
        assert (argument.name, argument.type, argument.subtype, argument.default) == (
            setting.name, setting.type, setting.subtype, setting.default)


def other_value(option, present):
    if option.kind is bool:
        return not present
    if isinstance(option.kind, tuple):
        values = [value[0] for value in option.kind]
        return values[(values.index(present) + 1) % len(values)]
    if option.kind is str:
        return f"{present} Other"
    least, most = option.limits['min'], option.limits.get('soft_max', option.limits['max'])
    return least if present > least else min(most, present + 2)


def shown(ob):
    update()
    if ob.detail_deform.stale:
        bind(ob, keep_rest=True)
        update()
    assert not ob.detail_deform.problem
    return evaluated(ob)


def changes(ob, option):
    """Whether another value of the setting changes the displayed shape."""
    settings, before = ob.detail_deform, shown(ob)
    present = getattr(settings, option.name)
    setattr(settings, option.name, other_value(option, present))
    after = shown(ob)
    setattr(settings, option.name, present)
    assert np.abs(shown(ob) - before).max() < 1e-6
    return np.abs(after - before).max() > 1e-6


def reason(options, look, option, settings):
    """The panel's reason why the setting has no effect; "" where it has one."""
    if not options.is_shown(option, settings):
        return "no row"
    return options.why_not(option, settings) or (look.why_no_base(settings) if option.section == 'BASE' else "")


def with_rows(options):
    # Without `base`, whose effect depends on the base object, `solidity`, as a strip has no inside (test_solidity.py),
    # and `stiff_parts`, which takes a group (test_stiffness.py).
    return [option for option in options.SETTINGS
            if option.section and option.name not in {'base', 'solidity', 'stiff_parts'}]


@pytest.mark.parametrize('method', METHODS)
def test_each_setting_has_an_effect_or_a_reason_why_not(strip, options, look, method):
    settings = strip.detail_deform
    settings.method = method
    for option in with_rows(options):
        assert changes(strip, option) != bool(reason(options, look, option, settings)), option.name


@pytest.mark.parametrize('method', METHODS)
def test_a_setting_without_the_settings_it_needs_has_no_effect(strip, options, look, method):
    settings, tried = strip.detail_deform, 0
    settings.method = method
    rows = {option.name: option for option in options.SETTINGS}
    for option in with_rows(options):
        for need in option.needs:
            if (need.name in {'method', 'base'} or (need.methods and method not in need.methods)
                    or reason(options, look, option, settings)):
                continue
            present = getattr(settings, need.name)
            setattr(settings, need.name, other_value(rows[need.name], present))
            assert reason(options, look, option, settings)
            assert not changes(strip, option), (option.name, need)
            setattr(settings, need.name, present)
            tried += 1
    assert tried == {'TRANSFER': 8, 'GRADIENT': 0, 'EXAMPLES': 7}.get(method, 1)


def test_steps_and_refinement_have_reasons_with_a_base_object(options):
    ob = activate(make_strip())
    rows = {option.name: option for option in options.SETTINGS}
    settings = ob.detail_deform
    settings.base = 'OBJECT'
    assert "is followed as it is" in options.why_not(rows['refine'], settings)
    assert "can't be split" in options.why_not(rows['steps'], settings)
    assert options.arguments_of(options.BIND, settings) == {'metric_smoothing': 0}  # of the surface: none
    told = options.arguments_of(options.UPDATE, settings)
    assert (told['refine'], told['steps']) == (0, 1)


def test_a_stiffness_of_zero_is_not_taken_for_the_default(strip):
    settings = strip.detail_deform
    settings.method = 'EXAMPLES'
    usual = shown(strip)
    settings.example_stiffness = 1e-4
    least = shown(strip)
    settings.example_stiffness = 0
    none = shown(strip)
    assert np.abs(none - least).max() < 0.01 * np.abs(usual - least).max()


def test_copy_settings_copies_the_settings_marked_in_the_table(options):
    ob, other = make_strip(n=7, name="One"), make_strip(n=7, name="Other")
    for option in options.SETTINGS:
        present = getattr(ob.detail_deform, option.name)
        setattr(ob.detail_deform, option.name, True if option.kind is bool and not present else
                other_value(option, present))
    activate(ob)
    other.select_set(True)
    assert bpy.ops.object.detail_deform_copy_settings() == {'FINISHED'}
    usual = make_strip(n=7, name="Usual").detail_deform
    for option in options.SETTINGS:
        expected = ob.detail_deform if option.copied else usual
        assert getattr(other.detail_deform, option.name) == getattr(expected, option.name), option.name
    assert {option.name for option in options.SETTINGS if not option.copied} == {'weights_by', 'base', 'stiff_parts'}


@pytest.mark.parametrize('settings, text', [
    ({}, 'SURFACE.0.2'), ({'metric_smoothing': 0.75, 'smoothness': 3}, 'SURFACE.0.75.3'),
    ({'base_metric': 'BASE', 'metric_smoothing': 0.75, 'smoothness': 1}, 'BASE.0.1')])
def test_a_signature_has_the_same_words_as_in_existing_files(settings, text):
    ob = make_strip(n=7)
    for name, value in settings.items():
        setattr(ob.detail_deform, name, value)
    bind(ob)
    assert ob.detail_deform.signature.split('.', 3)[3] == text
