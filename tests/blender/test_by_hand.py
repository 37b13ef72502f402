# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool Pull and the gizmo dots at the handles, by which a drag in the viewport begins. The drags themselves are in
gui/."""

import bpy
import numpy as np
import pytest

from conftest import activate, bind, evaluated, group, make_strip, own, pull, refusal, select, update


def dots(part):
    ob, found = part('ui.handle_gizmos').handles(bpy.context)
    return ob, [number for number, _ in found]


def test_the_tool_is_in_edit_modes_toolbar():
    from bl_ui.space_toolsystem_toolbar import VIEW3D_PT_tools_active
    tools = VIEW3D_PT_tools_active.tools_from_context(bpy.context, mode='EDIT_MESH')
    assert list(tools)[-1].idname == 'detail_deform.pull'  # at the end, and not within another tool's group


def test_the_tools_operator_pulls_what_is_selected_and_moves_it():
    ob = make_strip()
    ob.detail_deform.handles.clear()
    ob.detail_deform.region = ""
    select(ob, np.arange(625) == 312)
    macro = bpy.ops.object.detail_deform_pull_drag
    assert macro.poll()
    assert macro(OBJECT_OT_detail_deform_pull_begin={'radius': 0.2},
                 TRANSFORM_OT_translate={'value': (0, 0, 0.3)}) == {'FINISHED'}
    update()
    empty = ob.detail_deform.handles[0].target
    assert bpy.context.active_object == empty and ob.detail_deform.is_bound
    offsets = np.array([v.vector for v in ob.data.attributes['detail_deform_offset'].data])
    assert np.allclose(offsets[312], (0, 0, 0.3), atol=1e-5) and not offsets[0].any()


def test_without_a_selection_nothing_is_pulled():
    ob = make_strip()
    select(ob, np.zeros(625))
    assert "No vertex is selected" in refusal(bpy.ops.object.detail_deform_pull_begin)
    assert len(ob.detail_deform.handles) == 1 and ob.mode == 'EDIT'


def test_there_is_a_dot_at_each_handle_but_the_active_one(part):
    ob = make_strip()
    assert dots(part) == (None, [])  # not bound
    bind(ob)
    assert dots(part) == (ob, [0])
    empty = pull(ob, np.arange(625) == 100)
    assert dots(part) == (ob, [0])  # the empty of handle 1 is active and shows Blender's own gizmo
    activate(ob)
    assert dots(part) == (ob, [0, 1])
    empty.hide_set(True)
    assert dots(part) == (ob, [0])
    empty.hide_set(False)
    bpy.ops.object.mode_set(mode='EDIT')
    assert dots(part) == (None, [])


def test_a_dot_stays_on_the_surface_when_an_expression_is_raised(part):
    ob = make_strip()
    empty = ob.detail_deform.handles[0].target
    bind(ob)
    empty.location.z += 0.3
    update()
    bpy.ops.object.detail_deform_save_key()
    key = ob.data.shape_keys.key_blocks[-1]
    gizmos, held = part('ui.handle_gizmos'), own(ob)[:, 0] > 0.99
    for value in (0.0, 0.5, 1.0):
        key.value = value
        update()
        place = gizmos.positions(*gizmos.handles(bpy.context))[0]
        lifted = (evaluated(ob) - own(ob))[held].mean(axis=0)
        assert np.allclose(np.subtract(place, empty.matrix_world.translation), lifted, atol=1e-5)
        assert lifted[2] == pytest.approx(0.3 * value, abs=1e-5)
    key_shifts = part('scene.key_shifts')
    bpy.ops.object.mode_set(mode='EDIT')
    assert not key_shifts.shifts(ob, ob.detail_deform.handles).any()
    bpy.ops.object.mode_set(mode='OBJECT')
    # An expression that is raised at Bind shifts no dot: the empties' motions are counted from that shape.
    bind(ob)
    bpy.ops.object.mode_set(mode='EDIT')
    assert not key_shifts.shifts(ob, ob.detail_deform.handles).any()
    bpy.ops.object.mode_set(mode='OBJECT')
    assert np.allclose(gizmos.positions(*gizmos.handles(bpy.context))[0], empty.matrix_world.translation, atol=1e-6)
    group(ob, "Half", [])
    key.vertex_group = "Half"
    update()
    place = gizmos.positions(*gizmos.handles(bpy.context))[0]
    assert np.allclose(np.subtract(place, empty.matrix_world.translation), (0, 0, -0.3), atol=1e-5)


def test_a_dot_takes_its_handle_from_the_mesh_and_from_another_handle():
    ob = bind(make_strip())
    first, second = ob.detail_deform.handles[0].target, pull(ob, np.arange(625) == 100)
    take = bpy.ops.object.detail_deform_handle_take
    assert bpy.context.active_object == second
    take(index=0)
    assert bpy.context.active_object == first and ob.detail_deform.handle_index == 0
    activate(ob)
    take(index=1)
    assert bpy.context.selected_objects == [second]
    assert "There is no handle 7" in refusal(take, index=7)
