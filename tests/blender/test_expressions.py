# SPDX-License-Identifier: GPL-3.0-or-later
"""One expression after the other: each is saved as a shape key, and the binding goes on from rest."""

import bpy
import numpy as np
import pytest

from conftest import activate, add_from, bind, evaluated, make_strip, own, refusal, select, set_factor, update


def key_offsets(ob, name):
    key = ob.data.shape_keys.key_blocks[name]
    values = np.empty(3 * len(key.data), np.float32)
    key.data.foreach_get('co', values)
    return values.reshape(-1, 3) - own(ob)


def posed():
    ob = bind(make_strip())
    empty = ob.detail_deform.handles[0].target
    empty.location.z += 0.3
    empty.rotation_euler.y += 0.4
    update()
    return ob, empty


def test_an_expression_is_saved_and_the_binding_goes_on():
    ob, empty = posed()
    shape, place = evaluated(ob), ob.detail_deform.handles[0].rest_matrix[:]
    assert bpy.ops.object.detail_deform_save_key(name="Smile") == {'FINISHED'}
    update()
    assert ob.detail_deform.is_bound and np.abs(evaluated(ob) - own(ob)).max() < 1e-6
    assert ob.detail_deform.handles[0].rest_matrix[:] == place
    assert np.abs(key_offsets(ob, "Smile") - (shape - own(ob))).max() < 1e-6
    key = ob.data.shape_keys.key_blocks["Smile"]
    assert key.value == 0
    key.value = 1
    update()
    assert np.abs(evaluated(ob) - shape).max() < 1e-6

    # A second expression with the same binding.
    key.value = 0
    empty.location.x += 0.2
    update()
    other = evaluated(ob)
    assert np.abs(other - own(ob)).max() > 0.1
    assert bpy.ops.object.detail_deform_save_key(name="Smile") == {'FINISHED'}
    assert [e.name for e in ob.detail_deform.expressions] == ["Smile", "Smile.001"]
    assert np.abs(key_offsets(ob, "Smile.001") - (other - own(ob))).max() < 1e-6


def test_an_expression_is_saved_while_the_empty_is_active():
    ob, empty = posed()
    activate(empty)
    assert bpy.ops.object.detail_deform_save_key() == {'FINISHED'}
    assert [k.name for k in ob.data.shape_keys.key_blocks] == ["Basis", "Expression"]
    empty.location.z += 0.3
    update()
    assert bpy.ops.object.detail_deform_handle_reset() == {'FINISHED'}
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6


def test_of_several_handles_the_active_empty_goes_back():
    ob = make_strip()
    second = add_from(ob, (own(ob)[:, 0] > 0.4) & (own(ob)[:, 0] < 0.5)).target
    bind(ob)
    first = ob.detail_deform.handles[0].target
    places = [np.array(empty.matrix_world) for empty in (first, second)]
    first.location.z += 0.1
    second.location.z += 0.2
    update()
    activate(first)
    bpy.ops.object.detail_deform_handle_reset()
    update()
    assert np.allclose(first.matrix_world, places[0], atol=1e-6)
    assert abs(second.matrix_world.translation.z - places[1][2, 3] - 0.2) < 1e-6


def test_a_shape_made_by_two_pulls_is_one_expression():
    ob, _ = posed()
    select(ob, (own(ob)[:, 0] > 0.4) & (own(ob)[:, 0] < 0.5))
    bpy.ops.object.detail_deform_pull()
    bpy.context.active_object.location.z += 0.1
    update()
    shape = evaluated(ob)
    bpy.ops.object.detail_deform_save_key()
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6 and ob.detail_deform.is_bound
    assert np.abs(key_offsets(ob, "Expression") - (shape - own(ob))).max() < 1e-6


def test_a_reduced_factor_is_saved_as_shown(part):
    ob, _ = posed()
    set_factor(part, ob, 0.5)
    update()
    shape = evaluated(ob)
    bpy.ops.object.detail_deform_save_key()
    assert np.abs(key_offsets(ob, "Expression") - (shape - own(ob))).max() < 1e-6


def test_an_undeformed_or_unbound_surface_is_not_saved():
    ob = bind(make_strip())
    assert "Nothing is deformed" in refusal(bpy.ops.object.detail_deform_save_key)
    assert not ob.data.shape_keys
    bpy.ops.object.detail_deform_unbind()
    assert "Bind first" in refusal(bpy.ops.object.detail_deform_save_key)


def test_a_saved_key_is_the_start_of_the_next_pull():
    ob, _ = posed()
    bpy.ops.object.detail_deform_save_key(name="Smile")
    ob.data.shape_keys.key_blocks["Smile"].value = 1
    update()
    before = evaluated(ob)
    chosen = (own(ob)[:, 0] > 0.4) & (own(ob)[:, 0] < 0.5)
    select(ob, chosen)
    bpy.ops.object.detail_deform_pull()
    update()
    assert np.abs(evaluated(ob) - before).max() < 1e-6
    place = np.array(bpy.context.active_object.matrix_world.translation)
    assert np.abs(before[chosen].mean(0) - place).max() < 1e-5


@pytest.mark.parametrize('deformed', [False, True])
def test_back_to_rest_without_a_binding(deformed):
    ob, empty = posed()
    if deformed:  # a second binding, which starts from the deformed surface
        select(ob, (own(ob)[:, 0] > 0.4) & (own(ob)[:, 0] < 0.5))
        bpy.ops.object.detail_deform_pull()
        bpy.context.active_object.location.x += 0.1
        update()
        activate(ob)
    bpy.ops.object.detail_deform_unbind()
    assert np.linalg.norm(np.array(empty.matrix_world.translation) - (1, 0.5, 0)) > 0.2
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert np.abs(np.array(empty.matrix_world) - np.array([[1, 0, 0, 1], [0, 1, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]])
                  ).max() < 1e-5
    assert not ob.detail_deform.signature
    bind(ob)
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6


def test_after_apply_there_is_no_way_back():
    posed()
    bpy.ops.object.detail_deform_apply(mode='MESH')
    assert "none has a rest place" in refusal(bpy.ops.object.detail_deform_handle_reset)


def test_an_expression_is_saved_from_edit_mode():
    """Edit Mode goes on with the same active key, and the surface is back at rest."""
    ob, _ = posed()
    update()
    shape, rest = evaluated(ob), own(ob)
    activate(ob)
    bpy.ops.object.mode_set(mode='EDIT')
    for name in ("Smile", "Frown"):
        assert bpy.ops.object.detail_deform_save_key(name=name) == {'FINISHED'}
        assert ob.mode == 'EDIT' and ob.active_shape_key_index == 0
        if name == "Smile":
            ob.detail_deform.handles[0].target.location.z += 0.3
            update()
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert np.abs(key_offsets(ob, "Smile") - (shape - rest)).max() < 1e-6
    assert np.abs(key_offsets(ob, "Frown")).max() > 0.1 and np.abs(own(ob) - rest).max() < 1e-7
    assert np.abs(evaluated(ob) - rest).max() < 1e-6 and ob.detail_deform.is_bound
