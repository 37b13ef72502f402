# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
import numpy as np

from conftest import bind, evaluated, make_strip, own, refusal, update


def posed():
    ob = bind(make_strip())
    ob.detail_deform.handles[0].target.location.z += 0.4
    update()
    return ob


def assert_detached(ob):
    assert not ob.detail_deform.is_bound
    assert 'detail_deform_offset' not in ob.data.attributes
    assert [m for m in ob.modifiers if m.type == 'NODES'] == []
    assert len(ob.detail_deform.handles) == 1


def test_as_mesh():
    ob = posed()
    shown = evaluated(ob)
    assert bpy.ops.object.detail_deform_apply() == {'FINISHED'}
    update()
    assert np.abs(own(ob) - shown).max() < 1e-6
    assert np.abs(evaluated(ob) - shown).max() < 1e-6
    assert_detached(ob)
    bind(ob)


def test_as_mesh_with_shape_keys_keeps_their_effect():
    ob = make_strip()
    ob.shape_key_add(name='Basis')
    key = ob.shape_key_add(name='Raise')
    for point in key.data:
        point.co.z += 0.2
    bind(ob)
    ob.detail_deform.handles[0].target.location.z += 0.4
    key.value = 0.5
    update()
    shown = evaluated(ob)
    bpy.ops.object.detail_deform_apply(mode='MESH')
    update()
    assert np.abs(evaluated(ob) - shown).max() < 1e-6
    key.value = 0
    update()
    assert np.allclose(evaluated(ob)[:, 2], shown[:, 2] - 0.1, atol=1e-6)


def test_as_shape_key():
    ob = posed()
    rest, shown = own(ob), evaluated(ob)
    assert bpy.ops.object.detail_deform_apply(mode='SHAPE_KEY') == {'FINISHED'}
    update()
    assert np.abs(evaluated(ob) - shown).max() < 1e-6
    key = ob.data.shape_keys.key_blocks['Detail Deform']
    key.value = 0
    update()
    assert np.abs(evaluated(ob) - rest).max() < 1e-6
    assert_detached(ob)


def test_nothing_to_apply():
    make_strip()
    assert "There is no deformation to apply" in refusal(bpy.ops.object.detail_deform_apply)
