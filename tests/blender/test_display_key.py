# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done in the list of shape keys, by scripts, joins and transfers around the key that displays the
deformation, and what becomes of it."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, bind, choose, evaluated, group, make_strip, moved, own, script_copy, set_factor, update
from multires import KEY, add_key, displaced, key, keys, make_sculpt, pose, subdivide


def test_multires_applied_while_unbound():
    ob = bind(make_sculpt())
    bpy.ops.object.detail_deform_unbind()
    update()
    assert bpy.ops.object.modifier_apply(modifier="Multires") == {'FINISHED'}
    for name in ('region', 'right'):
        ob.vertex_groups.remove(ob.vertex_groups[name])
    group(ob, 'region', np.flatnonzero(own(ob)[:, 0] > 0.2))
    group(ob, 'right', np.flatnonzero(own(ob)[:, 0] > 0.9))
    bind(ob)
    pose(ob)
    assert not keys(ob) and moved(ob) > 0.3


@pytest.mark.parametrize('how', ['clear', 'convert'])
def test_keys_cleared_while_unbound_leave_nothing_behind(how):
    ob = bind(make_sculpt())
    if how == 'clear':
        key(ob).value = 0.5
        key(ob).keyframe_insert('value', frame=1)  # so that it stays
        bpy.ops.object.detail_deform_unbind()
        ob.shape_key_clear()
        ob.modifiers.remove(ob.modifiers["Multires"])
    else:
        ob.modifiers["Multires"].levels = 0
        bpy.ops.object.convert(target='MESH')
        ob.detail_deform.property_unset('signature')
    update()
    bind(ob)
    pose(ob)
    assert moved(ob) > 0.2 and not keys(ob)
    assert not [name for name in ob.data.keys() if name.startswith('detail_deform_key')]
    ob.data.vertices[0].co.z += 0.1
    ob.data.update()
    update()
    assert "vertices were moved since Bind" in ob.detail_deform.status


def test_the_key_was_active_and_pinned_when_it_is_removed():
    ob = make_sculpt()
    mine = add_key(ob, "Mine")
    mine.data.foreach_set('co', (own(ob) + (0, 0, 0.2)).astype(np.float32).ravel())
    rest = evaluated(ob)
    bind(ob)
    pose(ob)
    add_key(ob, "Later").data.foreach_set('co', (own(ob) + (0, 0, 0.4)).astype(np.float32).ravel())
    ob.active_shape_key_index, ob.show_only_shape_key = 2, True
    bpy.ops.object.detail_deform_remove()
    update()
    assert np.abs(evaluated(ob) - rest).max() < 1e-6 and ob.active_shape_key.name == "Mine"


def test_a_keyed_factor_goes_on_by_the_key(part):
    ob = bind(make_strip(13))
    deform_modifier = part('scene.deform_modifier')
    owner, name = deform_modifier.factor_property(ob, deform_modifier.find(ob))
    for frame, value in ((1, 0.0), (11, 1.0)):
        set_factor(part, ob, value)
        owner.keyframe_insert(name, frame=frame)
    bpy.context.scene.frame_set(6)
    pose(ob)
    half = evaluated(ob)
    choose(ob, show_as='SHAPE_KEY')
    bpy.context.scene.frame_set(6)
    assert np.abs(evaluated(ob) - half).max() < 1e-6
    bpy.context.scene.frame_set(11)
    assert np.abs(evaluated(ob) - displaced(ob)).max() < 1e-6
    choose(ob, show_as='AUTO')
    assert not keys(ob)
    bpy.context.scene.frame_set(6)
    assert np.abs(evaluated(ob) - half).max() < 1e-6


def test_a_key_whose_value_is_keyed_stays_until_it_is_removed_with_that():
    ob = bind(make_strip(13))
    add_key(ob, "Mine")
    choose(ob, show_as='SHAPE_KEY')
    pose(ob)
    for frame, value in ((1, 0.0), (11, 0.5)):
        key(ob).value = value
        key(ob).keyframe_insert('value', frame=frame)
    bpy.context.scene.frame_set(11)
    shown = evaluated(ob)
    choose(ob, show_as='AUTO')
    assert KEY in keys(ob) and "stays, as its value is keyed" in ob.detail_deform.status
    bpy.ops.object.detail_deform_apply(mode='SHAPE_KEY')
    bpy.context.scene.frame_set(12)
    bpy.context.scene.frame_set(11)
    assert np.abs(evaluated(ob) - shown).max() < 1e-6 and keys(ob) == ["Basis", "Mine", KEY]


def test_a_transfer_that_replaces_leaves_the_key():
    source, target = make_strip(13, name="Source"), make_sculpt()
    add_key(source, KEY).data.foreach_set('co', (own(source) + (0, 0, 0.3)).astype(np.float32).ravel())
    bind(target)
    posed = pose(target)
    target.detail_deform.transfer.source = source
    assert bpy.ops.object.detail_deform_transfer(what='ALL_KEYS', replace=True) == {'FINISHED'}
    update()
    assert keys(target) == ["Basis", KEY, KEY + ".001"] and np.abs(evaluated(target) - posed).max() < 1e-6
    bpy.ops.object.detail_deform_remove()
    assert keys(target) == ["Basis", KEY + ".001"]


def test_it_stays_relative_to_the_first_key():
    ob = make_sculpt()
    mine = add_key(ob, "Mine")
    mine.data.foreach_set('co', (own(ob) + (0, 0, 0.2)).astype(np.float32).ravel())
    bind(ob)
    key(ob).relative_key = mine
    pose(ob)
    assert np.abs(evaluated(ob) - displaced(ob)).max() < 1e-6


@pytest.mark.skipif(bpy.app.version >= (5, 0), reason="Blender refuses to move it, as it is locked")
def test_the_key_moved_to_the_top():
    ob = make_sculpt()
    add_key(ob, "Mine")
    bind(ob)
    posed = pose(ob)
    ob.active_shape_key_index = 2
    for _ in range(2):
        bpy.ops.object.shape_key_move(type='UP')
    update()
    assert "has become the first" in ob.detail_deform.status and keys(ob) == [KEY, "Basis", "Mine"]
    for _ in range(2):
        bpy.ops.object.shape_key_move(type='DOWN')
    update()
    assert keys(ob) == ["Basis", "Mine", KEY] and np.abs(evaluated(ob) - posed).max() < 1e-6


def test_what_others_write_into_the_key_is_overwritten():
    ob = bind(make_sculpt())
    posed = pose(ob)
    key(ob).data.foreach_set('co', own(ob).astype(np.float32).ravel())  # as Propagate to Shapes does
    ob.data.update()
    ob.data.update_tag()
    update()
    assert np.abs(evaluated(ob) - posed).max() < 1e-6


def test_a_copy_of_the_key_is_the_users():
    ob = bind(make_sculpt())
    pose(ob)
    add_key(ob, "Copy").interpolation = key(ob).interpolation
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    ob.shape_key_remove(key(ob))
    update()
    assert keys(ob) == ["Basis", "Copy", KEY] and np.abs(evaluated(ob) - displaced(ob)).max() < 1e-6
    bpy.ops.object.detail_deform_remove()
    assert keys(ob) == ["Basis", "Copy"]


def test_a_script_moves_the_vertices_alone():
    ob = bind(make_sculpt())
    pose(ob)
    ob.data.transform(Matrix.Translation((0, 0, 1)))
    ob.data.update()
    update()
    bind(ob, keep_rest=True)
    assert np.abs(evaluated(ob) - displaced(ob)).max() < 1e-5 and evaluated(ob)[:, 2].min() > 0.5


def test_another_mesh_under_the_same_name():
    ob = bind(make_sculpt())
    pose(ob)
    ob.data.clear_geometry()
    ob.data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    ob.data.update()
    update()
    update()
    assert "Press Re-bind" in ob.detail_deform.status or "is bound" not in ob.detail_deform.status


def test_vertices_that_are_not_where_the_first_key_is():
    ob = make_strip(13)
    add_key(ob, "Mine")
    ob.data.vertices.foreach_set('co', (own(ob) + (0, 0, 1)).astype(np.float32).ravel())
    ob.data.update()
    bind(ob)
    pose(ob)
    shown = evaluated(ob)
    ob.modifiers["Detail Deform"].show_viewport = False
    choose(ob, show_as='SHAPE_KEY')
    update()
    ob.modifiers["Detail Deform"].show_viewport = True
    update()
    assert np.abs(evaluated(ob) - shown).max() < 1e-6
    bpy.ops.object.detail_deform_apply(mode='SHAPE_KEY')
    update()
    assert np.abs(evaluated(ob) - shown).max() < 1e-6


@pytest.mark.parametrize('active', [1, 2], ids=['ours', 'mine'])
def test_subdivided_with_another_key_active(active):
    """Blender gives new vertices the place that they have in the active key, the first key keeps the rest."""
    ob = bind(make_strip(13))
    choose(ob, show_as='SHAPE_KEY')
    pose(ob)
    if active == 2:
        add_key(ob, "Mine").data.foreach_set('co', (own(ob) + (0, 0, 0.4)).astype(np.float32).ravel())
    ob.active_shape_key_index = active
    subdivide(ob)
    ob.active_shape_key_index = 0
    ob.data.update_tag()
    update()
    reference = np.array([point.co for point in ob.data.shape_keys.reference_key.data])
    assert reference[:, 2].max() < 0.1
    if active == 2:
        ob.shape_key_remove(ob.data.shape_keys.key_blocks["Mine"])
    bpy.ops.object.detail_deform_remove()
    update()
    assert not keys(ob) and np.abs(evaluated(ob) - reference).max() < 1e-6


def test_a_copys_keyframes_are_its_own_business():
    ob = bind(make_strip(13))
    choose(ob, show_as='SHAPE_KEY')
    pose(ob)
    for frame, value in ((1, 0.0), (11, 1.0)):
        key(ob).value = value
        key(ob).keyframe_insert('value', frame=frame)
    copy = script_copy(ob)
    activate(copy)
    bpy.ops.object.detail_deform_remove()
    bpy.context.scene.frame_set(1)
    bpy.context.scene.frame_set(11)
    assert abs(key(ob).value - 1) < 1e-6
    bpy.context.scene.frame_set(1)
    assert abs(key(ob).value) < 1e-6


def test_the_first_key_is_removed():
    ob = bind(make_strip(13))
    choose(ob, show_as='SHAPE_KEY')
    pose(ob)
    ob.shape_key_remove(ob.data.shape_keys.reference_key)
    update()
    assert "Press Re-bind" in ob.detail_deform.status  # Blender has moved the vertices to where the key has them
    bind(ob, keep_rest=True)
    assert "has become the first" in ob.detail_deform.status
    assert bpy.ops.object.detail_deform_remove() == {'FINISHED'}
    assert not keys(ob)


def test_a_key_that_came_by_joining_stays_where_it_displays():
    ob = bind(make_strip(13, name="Other"))
    choose(ob, show_as='SHAPE_KEY')
    pose(ob)
    plain = make_strip(13, name="Plain")
    plain.location.y = plain.detail_deform.handles[0].target.location.y = 2.5
    update()
    ob.select_set(True)
    bpy.ops.object.join()
    update()
    shown = evaluated(plain)
    bind(plain)
    plain.data.vertices[0].co.z += 0.001
    plain.data.update()
    update()
    assert keys(plain) == ["Basis", KEY] and np.abs(evaluated(plain) - shown).max() < 0.002


def test_a_script_copy_follows_its_own_factor(part):
    ob = bind(make_strip(13))
    deform_modifier = part('scene.deform_modifier')
    owner, name = deform_modifier.factor_property(ob, deform_modifier.find(ob))
    set_factor(part, ob, 0.5)
    owner.keyframe_insert(name, frame=1)
    choose(ob, show_as='SHAPE_KEY')
    copy = script_copy(ob)
    copy.animation_data.action = ob.animation_data.action.copy()
    update()
    driver = copy.data.shape_keys.animation_data.drivers[0].driver
    assert driver.variables[0].targets[0].id == copy
    ob.animation_data.action = None
    update()
    key(ob).value = 0.25
    update()
    assert abs(key(ob).value - 0.25) < 1e-6


def test_a_vertex_that_is_nowhere():
    ob = bind(make_strip(13))
    choose(ob, show_as='SHAPE_KEY')
    pose(ob)
    ob.data.vertices[0].co.z = float('nan')
    ob.data.update()
    update()
    assert "Press Re-bind" in ob.detail_deform.status


def test_tools_that_drop_keys_leave_the_pose_to_rebind():
    ob = bind(make_sculpt())
    pose(ob)
    ob.shape_key_clear()
    subdivide(ob)
    assert "Press Re-bind" in ob.detail_deform.status


def test_a_muted_key_leaves_a_hidden_modifier():
    ob = bind(make_strip(13))
    choose(ob, show_as='SHAPE_KEY')
    pose(ob)
    key(ob).mute = True
    choose(ob, show_as='AUTO')
    update()
    assert not keys(ob) and moved(ob) < 1e-6 and "Its modifier is hidden" in ob.detail_deform.status


@pytest.mark.parametrize('first', ['MODIFIER', 'SHAPE_KEY'])
def test_bound_objects_are_joined(first):
    one, other = bind(make_strip(13, name="One")), bind(make_strip(13, name="Other"))
    other.location.y = other.detail_deform.handles[0].target.location.y = 2.5
    for ob, how in ((one, first), (other, {'MODIFIER': 'SHAPE_KEY', 'SHAPE_KEY': 'MODIFIER'}[first])):
        choose(ob, show_as=how)
        pose_in_place(ob)
    apart = [evaluated(ob) + np.array(ob.location) for ob in (one, other)]
    activate(one)
    other.select_set(True)
    bpy.ops.object.join()
    update()
    assert np.abs(evaluated(one) - np.concatenate(apart)).max() < 1e-5
    assert keys(one) == (["Basis", KEY] if first == 'SHAPE_KEY' else [])


def pose_in_place(ob):
    ob.detail_deform.handles[0].target.location.z += 0.4
    update()
