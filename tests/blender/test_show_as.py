# SPDX-License-Identifier: GPL-3.0-or-later
"""The deformation displayed by a shape key, where a modifier such as Multires wants the mesh itself or the user wants
it so: what was sculpted turns with the surface, and the key comes, goes and hides with the modifier."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import (activate, add_empty, add_handle, bind, choose, evaluated, group, make_strip, moved, own, pull,
                      refusal, script_copy, set_factor, update)
from multires import KEY, add_key, displaced, key, keys, make_sculpt, offsets_of, pose, press, sculpt


# ---- Multires

def test_what_was_sculpted_turns_with_the_surface():
    """All of the mesh goes with the only handle of a region without border, so its details have to turn as that
    does."""
    ob = make_sculpt()
    choose(ob, region="")
    rest = evaluated(ob)
    bind(ob)
    empty = ob.detail_deform.handles[0].target
    motion = Matrix.Translation((0.3, -0.2, 0.5)) @ Matrix.Rotation(1.1, 4, (1, 2, -1))
    empty.matrix_world = motion @ empty.matrix_world
    update()
    expected = rest @ np.array(motion)[:3, :3].T + np.array(motion)[:3, 3]
    assert np.abs(evaluated(ob) - expected).max() < 1e-5
    assert f"The shape key '{KEY}' shows the deformation, which acts before 'Multires'" in ob.detail_deform.status
    choose(ob, show_as='MODIFIER')
    update()
    assert np.abs(evaluated(ob) - expected).max() > 0.01
    assert "'Multires' has to come before" in ob.detail_deform.status and not keys(ob)


def test_a_bend_is_what_blender_makes_of_the_displaced_mesh():
    ob = bind(make_sculpt())
    posed = pose(ob)
    assert np.abs(posed - displaced(ob)).max() < 1e-6
    assert [m.name for m in ob.modifiers] == ["Multires", "Detail Deform"]


def test_multires_that_comes_later_brings_the_key_and_takes_it_along():
    ob = bind(make_strip(13))
    pose(ob)
    assert not keys(ob)
    modifier = ob.modifiers.new("Multires", 'MULTIRES')
    bpy.ops.object.multires_subdivide(modifier="Multires", mode='CATMULL_CLARK')
    update()
    assert [m.name for m in ob.modifiers][0] == "Multires" and keys(ob) == ["Basis", KEY]
    assert np.abs(evaluated(ob) - displaced(ob)).max() < 1e-6
    key(ob).value = 0.5
    ob.modifiers.remove(modifier)
    update()
    assert not keys(ob)
    assert np.abs(evaluated(ob) - own(ob) - 0.5 * offsets_of(ob)).max() < 1e-6


def test_a_soft_body_feels_the_deformation():
    ob = make_strip()
    ob.modifiers.new("Soft", 'SOFT_BODY')
    ob.modifiers["Soft"].settings.goal_default = 1.0  # all of it is held where the mesh is
    bind(ob)
    pose(ob)
    assert [m.name for m in ob.modifiers] == ["Soft", "Detail Deform"] and keys(ob) == ["Basis", KEY]
    bpy.context.scene.frame_set(2)
    assert np.abs(evaluated(ob) - displaced(ob)).max() < 1e-3 < 0.3 < moved(ob)


def test_sculpting_goes_on_in_between():
    """Relief that is pressed into the posed sculpt lies where it was pressed, and turns back with the surface."""
    ob = bind(make_sculpt(height=0.0))
    smooth = pose(ob)
    mesh = bpy.data.meshes.new_from_object(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()))
    normals = np.array([vertex.normal for vertex in mesh.vertices])
    pressed = smooth + 0.01 * np.sin(60 * smooth[:, 1:2]) * normals
    press(ob, pressed)
    assert np.abs(evaluated(ob) - pressed).max() < 1e-4
    heights = np.linalg.norm(pressed - smooth, axis=1)
    ob.detail_deform.handles[0].target.matrix_world = Matrix.Translation((1, 0.5, 0))
    update()
    back, flat = evaluated(ob), evaluated(make_sculpt(height=0.0))
    assert np.abs(np.linalg.norm(back - flat, axis=1) - heights).max() < 2e-3 < 0.008 < heights.max()


def test_the_users_keys_are_kept():
    ob = make_sculpt()
    mine, other = add_key(ob, "Mine"), add_key(ob, "Other")
    mine.data.foreach_set('co', (own(ob) + (0, 0, 0.2)).astype(np.float32).ravel())
    mine.value, other.value, other.mute = 0.5, 0.25, True
    ob.active_shape_key_index = 2
    update()
    at_bind = evaluated(ob)
    bind(ob)
    assert np.abs(evaluated(ob) - at_bind).max() < 1e-6
    pose(ob)
    assert keys(ob) == ["Basis", "Mine", "Other", KEY] and ob.active_shape_key_index == 2
    bpy.ops.object.detail_deform_remove()
    update()
    assert keys(ob) == ["Basis", "Mine", "Other"] and ob.active_shape_key_index == 2
    mine, other = ob.data.shape_keys.key_blocks[1:]
    assert (mine.value, mine.mute, other.value, other.mute) == (0.5, False, 0.25, True)
    assert np.abs(evaluated(ob) - at_bind).max() < 1e-6


def test_a_pull_lands_where_it_is_aimed():
    ob = make_sculpt()
    chosen = own(ob)[:, 0] > 0.9
    while ob.detail_deform.handles:
        ob.detail_deform.handles.remove(0)
    empty = pull(ob, chosen)
    assert keys(ob) == ["Basis", KEY]
    empty.location.z += 0.3
    update()
    assert np.allclose(offsets_of(ob)[chosen], (0, 0, 0.3), atol=1e-6)
    again = pull(ob, np.abs(own(ob)[:, 0] - 0.5) < 0.05)  # of the displayed surface
    shown = own(ob) + offsets_of(ob)
    assert np.linalg.norm(np.array(again.location) - shown[np.abs(own(ob)[:, 0] - 0.5) < 0.05].mean(axis=0)) < 1e-3


def test_nodes_of_an_earlier_version_are_replaced_and_keep_their_values(part):
    ob = bind(make_strip(13))
    set_factor(part, ob, 0.5)
    group_before = ob.modifiers["Detail Deform"].node_group
    group_before['detail_deform_nodes'] = 2
    sculpt(ob, 0.02)
    pose(ob)
    assert ob.modifiers["Detail Deform"].node_group != group_before and key(ob).value == 0.5
    key(ob).value = 1.0
    update()
    assert np.abs(evaluated(ob) - displaced(ob)).max() < 1e-6


# ---- Nothing is left behind

@pytest.mark.parametrize('kept', [False, True], ids=['none', 'own'])
@pytest.mark.parametrize('how', ['remove', 'apply', 'as key'])
def test_no_key_is_left_behind(how, kept):
    ob = bind(make_sculpt())
    posed = pose(ob)
    if kept:
        add_key(ob, "Mine")
    if how == 'remove':
        bpy.ops.object.detail_deform_remove()
    else:
        bpy.ops.object.detail_deform_apply(mode='MESH' if how == 'apply' else 'SHAPE_KEY')
    update()
    assert keys(ob) == (["Basis"] if kept or how == 'as key' else []) + ["Mine"] * kept + [KEY] * (how == 'as key')
    assert [m.name for m in ob.modifiers] == ["Multires"]
    assert not [name for name in ob.data.keys() if name.startswith('detail_deform')]
    if how != 'remove':
        assert np.abs(evaluated(ob) - posed).max() < 1e-5
    assert not bpy.data.shape_keys or keys(ob)


def test_unbound_it_shows_the_rest_and_comes_back_with_its_value():
    ob = make_sculpt()
    rest = evaluated(ob)
    bind(ob)
    posed = pose(ob)
    key(ob).value = 0.75
    bpy.ops.object.detail_deform_unbind()
    update()
    assert not keys(ob)  # Blender applies no Multires while there are keys
    assert np.abs(evaluated(ob) - rest).max() < 1e-6
    ob.detail_deform.handles[0].target.matrix_world = Matrix.Translation((1, 0.5, 0))
    update()
    bind(ob)
    pose(ob)
    assert keys(ob) == ["Basis", KEY] and abs(key(ob).value - 0.75) < 1e-6
    key(ob).value = 1.0
    update()
    assert np.abs(evaluated(ob) - posed).max() < 1e-5


# ---- Factor, influence, hiding

def test_the_keys_value_is_the_factor_and_is_keyed(part):
    ob = bind(make_sculpt())
    rest = own(ob)
    pose(ob)
    owner, name = part('scene.deform_modifier').factor_property(ob, ob.modifiers["Detail Deform"])
    assert owner == key(ob) and name == 'value'
    for frame, value in ((1, 0.0), (11, 1.0)):
        key(ob).value = value
        key(ob).keyframe_insert('value', frame=frame)
    ob.modifiers["Multires"].levels = 0
    bpy.context.scene.frame_set(6)
    assert np.abs(evaluated(ob) - rest - 0.5 * offsets_of(ob)).max() < 1e-6


def test_a_factor_goes_over_into_the_key(part):
    ob = bind(make_strip(13))
    set_factor(part, ob, 0.25)
    choose(ob, show_as='SHAPE_KEY')
    assert key(ob).value == 0.25
    key(ob).value = 0.5
    choose(ob, show_as='MODIFIER')
    modifier = ob.modifiers["Detail Deform"]
    assert part('scene.deform_modifier').factor(ob, modifier) == 0.5


def test_hidden_with_the_modifier(part, monkeypatch):
    ob = bind(make_sculpt())
    rest = evaluated(ob)
    posed = pose(ob)
    modifier = ob.modifiers["Detail Deform"]
    modifier.show_viewport = False
    update()
    assert np.abs(evaluated(ob) - rest).max() < 1e-6 and "Its modifier is hidden" in ob.detail_deform.status
    computed = []
    with monkeypatch.context() as patch:
        patch.setattr(part('library.native').Deformer, 'offsets', lambda *_, **__: computed.append(1))
        ob.detail_deform.handles[0].target.location.z += 0.1
        update()
    assert not computed
    ob.detail_deform.handles[0].target.location.z -= 0.1
    modifier.show_viewport = True
    update()
    assert np.abs(evaluated(ob) - posed).max() < 1e-6
    choose(ob, live=False)
    modifier.show_viewport = False
    update()
    assert np.abs(evaluated(ob) - rest).max() < 1e-6


def test_muted_or_beside_a_pinned_key_it_says_so():
    ob = make_sculpt()
    add_key(ob, "Mine")
    rest = evaluated(ob)
    bind(ob)
    posed = pose(ob)
    key(ob).mute = True
    update()
    assert np.abs(evaluated(ob) - rest).max() < 1e-6 and f"'{KEY}' is muted" in ob.detail_deform.status
    key(ob).mute = False
    ob.active_shape_key_index, ob.show_only_shape_key = 1, True
    update()
    assert np.abs(evaluated(ob) - rest).max() < 1e-6 and "'Mine' is shown alone" in ob.detail_deform.status
    ob.active_shape_key_index = 2
    update()
    assert np.abs(evaluated(ob) - posed).max() < 1e-6 and "alone" not in ob.detail_deform.status
    ob.show_only_shape_key = False
    update()
    assert np.abs(evaluated(ob) - posed).max() < 1e-6


@pytest.mark.parametrize('invert', [False, True], ids=['', 'inverted'])
def test_influence(invert):
    ob = make_sculpt()
    ob.modifiers["Multires"].levels = 0
    weights = np.linspace(0, 1, len(ob.data.vertices))
    soft = ob.vertex_groups.new(name="soft")
    for vertex, weight in enumerate(weights):
        soft.add([vertex], weight, 'REPLACE')
    bind(ob)
    pose(ob)
    offsets = evaluated(ob) - own(ob)
    choose(ob, influence="soft", invert_influence=invert)
    update()
    shown = (1 - weights if invert else weights)[:, None]
    assert np.abs(evaluated(ob) - own(ob) - shown * offsets).max() < 1e-6
    soft.add(range(len(weights)), 0.25, 'REPLACE')
    ob.data.update_tag()
    update()
    assert np.abs(evaluated(ob) - own(ob) - (0.75 if invert else 0.25) * offsets).max() < 1e-6
    choose(ob, influence="nothing")
    update()
    assert np.abs(evaluated(ob) - own(ob) - invert * offsets).max() < 1e-6
    assert "does not have" in ob.detail_deform.status
    choose(ob, influence="")
    update()
    assert np.abs(evaluated(ob) - own(ob) - offsets).max() < 1e-6


def test_renders_follow_and_show_as_the_modifier_says(rendered):
    ob = bind(make_sculpt())
    rest, target = evaluated(ob), ob.detail_deform.handles[0].target
    for frame, height in ((1, 0.0), (5, 0.4)):
        target.location.z = height
        target.keyframe_insert('location', frame=frame)
    live = {}
    for frame in range(1, 6):
        bpy.context.scene.frame_set(frame)
        live[frame] = evaluated(ob)
    seen = rendered()
    assert all(np.abs(seen[frame] - live[frame]).max() < 1e-6 for frame in live)
    assert np.abs(seen[5] - seen[1]).max() > 0.3
    ob.modifiers["Detail Deform"].show_render = False
    assert all(np.abs(of_frame - rest).max() < 1e-6 for of_frame in rendered().values())
    bpy.context.scene.frame_set(3)
    assert np.abs(evaluated(ob) - live[3]).max() < 1e-6


# ---- A key of any mesh

@pytest.mark.parametrize('kinds', [(), ('SUBSURF',), ('MIRROR', 'SUBSURF')], ids=' '.join)
def test_by_a_key_all_looks_as_by_the_modifier(kinds):
    ob = make_strip()
    for kind in kinds:
        ob.modifiers.new(kind, kind)
    bind(ob)
    by_modifier = pose(ob)
    choose(ob, show_as='SHAPE_KEY')
    update()
    assert keys(ob) == ["Basis", KEY] and np.abs(evaluated(ob) - by_modifier).max() < 1e-6
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    by_key = evaluated(ob)
    assert np.abs(by_key - by_modifier).max() > 0.05
    choose(ob, show_as='AUTO')
    update()
    assert not keys(ob) and np.abs(evaluated(ob) - by_key).max() < 1e-6


def test_absolute_keys_stay_and_are_reported():
    ob = make_sculpt()
    add_key(ob, "Mine")
    ob.data.shape_keys.use_relative = False
    bind(ob)
    pose(ob)
    assert KEY not in keys(ob) and "the shape keys of 'Strip' are absolute: apply" in ob.detail_deform.status
    ob.modifiers.remove(ob.modifiers["Multires"])
    choose(ob, show_as='SHAPE_KEY')
    assert "and no shape key, for the shape keys of 'Strip' are absolute" in ob.detail_deform.status


def test_behind_a_modifier_that_sets_positions_no_key_is_made():
    ob = make_strip(13)
    cage = make_strip(13, name="Cage")
    cage.location.z = -0.1
    activate(ob)
    bound = ob.modifiers.new("Bound", 'SURFACE_DEFORM')
    bound.target = cage
    update()
    bpy.ops.object.surfacedeform_bind(modifier="Bound")
    update()
    assert bound.is_bound
    ob.modifiers.new("Multires", 'MULTIRES')
    bind(ob)
    assert not keys(ob) and "for 'Bound' sets positions whatever it gets: apply" in ob.detail_deform.status


# ---- What users do around it

def test_undo_and_redo():
    ob = bind(make_sculpt())
    rest = evaluated(ob)
    bpy.ops.ed.undo_push(message="bound")
    posed = pose(ob)
    bpy.ops.ed.undo_push(message="posed")
    bpy.ops.object.detail_deform_remove()
    bpy.ops.ed.undo_push(message="removed")
    bpy.ops.ed.undo()
    ob = bpy.data.objects["Strip"]
    update()
    assert keys(ob) == ["Basis", KEY] and np.abs(evaluated(ob) - posed).max() < 1e-6
    bpy.ops.ed.undo()
    ob = bpy.data.objects["Strip"]
    update()
    assert np.abs(evaluated(ob) - rest).max() < 1e-5
    bpy.ops.ed.redo()
    ob = bpy.data.objects["Strip"]
    update()
    assert keys(ob) == ["Basis", KEY] and np.abs(evaluated(ob) - posed).max() < 1e-6


def test_saved_and_loaded(tmp_path):
    ob = bind(make_sculpt())
    posed = pose(ob)
    path = str(tmp_path / 'sculpt.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
    ob = activate(bpy.data.objects["Strip"])
    assert np.abs(evaluated(ob) - posed).max() < 1e-6
    ob.detail_deform.handles[0].target.location.z += 0.2
    update()
    assert np.abs(evaluated(ob) - displaced(ob)).max() < 1e-6 < 0.1 < np.abs(evaluated(ob) - posed).max()


@pytest.mark.parametrize('how', ['operator', 'script'])
def test_a_duplicate_is_posed_alone(how):
    ob = bind(make_sculpt())
    posed = pose(ob)
    if how == 'operator':
        bpy.ops.object.duplicate()
        copy = bpy.context.object
    else:
        copy = script_copy(ob)
        activate(copy)
    update()
    assert np.abs(evaluated(copy) - posed).max() < 1e-6
    key(copy).value = 0.0
    update()
    assert np.abs(evaluated(ob) - posed).max() < 1e-6
    bpy.ops.object.detail_deform_remove()
    update()
    assert not keys(copy) and keys(ob) == ["Basis", KEY] and np.abs(evaluated(ob) - posed).max() < 1e-6


def test_a_linked_copy_shows_it_once():
    ob = bind(make_sculpt())
    copy = ob.copy()
    bpy.context.scene.collection.objects.link(copy)
    posed = pose(ob)
    assert np.abs(evaluated(copy) - posed).max() < 1e-6 and keys(ob) == ["Basis", KEY]
    copy.modifiers.remove(copy.modifiers["Multires"])
    for _ in range(3):
        update()
    assert keys(ob) == ["Basis", KEY] and np.abs(evaluated(ob) - posed).max() < 1e-6
    assert np.abs(evaluated(copy) - own(ob) - offsets_of(ob)).max() < 1e-6


def test_a_key_that_was_renamed_stays_the_only_one():
    ob = bind(make_sculpt())
    pose(ob)
    key(ob).name = "Pulled"
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    assert keys(ob) == ["Basis", "Pulled"] and np.abs(evaluated(ob) - displaced(ob)).max() < 1e-6
    assert "The shape key 'Pulled' shows" in ob.detail_deform.status
    bpy.ops.object.detail_deform_remove()
    assert not keys(ob)


def test_a_key_that_was_removed_comes_back():
    ob = bind(make_sculpt())
    posed = pose(ob)
    ob.shape_key_remove(key(ob))
    update()
    assert keys(ob) == ["Basis", KEY] and np.abs(evaluated(ob) - posed).max() < 1e-6


def test_keys_that_were_applied_end_the_binding():
    ob = bind(make_sculpt())
    posed = pose(ob)
    if hasattr(key(ob), 'lock_shape'):
        assert "locked" in refusal(bpy.ops.object.shape_key_remove, all=True, apply_mix=True)
        key(ob).lock_shape = False
        bpy.ops.object.shape_key_remove(all=True, apply_mix=True)
    else:
        points = np.array([point.co for point in key(ob).data])
        ob.shape_key_clear()
        ob.data.vertices.foreach_set('co', points.astype(np.float32).ravel())
        ob.data.update()
    update()
    assert not keys(ob) and np.abs(evaluated(ob) - posed).max() < 1e-5
    assert "The shape key was applied by hand" in ob.detail_deform.status
    bind(ob)
    assert np.abs(evaluated(ob) - posed).max() < 1e-5


def test_the_modifier_removed_by_hand_takes_the_key_along():
    ob = make_sculpt()
    rest = evaluated(ob)
    bind(ob)
    posed = pose(ob)
    ob.modifiers.remove(ob.modifiers["Detail Deform"])
    update()
    assert not keys(ob) and np.abs(evaluated(ob) - rest).max() < 1e-6
    assert bpy.ops.object.detail_deform_update() == {'FINISHED'}
    update()
    assert keys(ob) == ["Basis", KEY] and np.abs(evaluated(ob) - posed).max() < 1e-6


@pytest.mark.parametrize('what', ['location', 'rotation', 'scale'])
def test_an_applied_transform(what):
    ob = make_sculpt()
    ob.matrix_world = Matrix.LocRotScale((1, 2, 3), Matrix.Rotation(0.7, 3, (1, 1, 0)), (2, 2, 2))
    ob.detail_deform.handles[0].target.matrix_world = ob.matrix_world @ Matrix.Translation((1, 0.5, 0))
    update()
    bind(ob)
    empty = ob.detail_deform.handles[0].target
    empty.matrix_world = ob.matrix_world @ Matrix.Translation((0.8, 0.5, 0.5)) @ Matrix.Rotation(-1, 4, 'Y')
    update()

    def seen():
        world = np.array(ob.matrix_world)
        return evaluated(ob) @ world[:3, :3].T + world[:3, 3]
    before = seen()
    activate(ob)
    bpy.ops.object.transform_apply(location=what == 'location', rotation=what == 'rotation', scale=what == 'scale')
    update()
    bind(ob, keep_rest=True)
    assert np.abs(seen() - before).max() < 1e-4


def test_editing_goes_on():
    ob = bind(make_sculpt())
    pose(ob)
    bpy.ops.object.mode_set(mode='EDIT')
    update()
    bpy.ops.mesh.select_all(action='DESELECT')
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert np.abs(evaluated(ob) - displaced(ob)).max() < 1e-6 and ob.detail_deform.is_bound
    ob.data.vertices.foreach_set('select', own(ob)[:, 0] < 0.5)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert "Press Re-bind" in ob.detail_deform.status
    bind(ob, keep_rest=True)
    assert keys(ob) == ["Basis", KEY] and np.abs(evaluated(ob) - displaced(ob)).max() < 1e-6


# ---- Results, and what reads shape keys

@pytest.fixture
def keyed():
    """A bound sculpt whose handle is keyed, and its evaluated positions in the frames 1 to 5."""
    ob = bind(make_sculpt())
    target = ob.detail_deform.handles[0].target
    for frame, height in ((1, 0.0), (5, 0.4)):
        target.location.z, target.rotation_euler.y = height, -2 * height
        target.keyframe_insert('location', frame=frame)
        target.keyframe_insert('rotation_euler', frame=frame)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 5
    return ob, frames_of(ob)


def frames_of(ob):
    result = []
    for frame in range(1, 6):
        bpy.context.scene.frame_set(frame)
        result.append(evaluated(ob))
    return np.array(result)


def test_a_baked_cache_stands_before_multires(keyed, tmp_path):
    ob, live = keyed
    assert bpy.ops.object.detail_deform_bake(filepath=str(tmp_path / 'sculpt.pc2')) == {'FINISHED'}
    assert [m.name for m in ob.modifiers] == ["Detail Deform Cache", "Multires", "Detail Deform"]
    assert np.abs(frames_of(ob) - live).max() < 1e-5
    assert (tmp_path / 'sculpt.pc2').stat().st_size < 100 + 5 * 12 * len(ob.data.vertices)
    assert bpy.ops.object.detail_deform_bake_drop() == {'FINISHED'}
    assert np.abs(frames_of(ob) - live).max() < 1e-5 and keys(ob) == ["Basis", KEY]


def test_frames_baked_to_shape_keys(keyed):
    ob, live = keyed
    assert bpy.ops.object.detail_deform_bake(mode='SHAPE_KEYS') == {'FINISHED'}
    assert np.abs(frames_of(ob) - live).max() < 1e-5


@pytest.mark.skipif(not bpy.app.build_options.alembic, reason="built without Alembic")
def test_an_alembic_file_has_what_was_sculpted(keyed, tmp_path):
    ob, live = keyed
    path = tmp_path / 'sculpt.abc'
    assert bpy.ops.object.detail_deform_bake(mode='ALEMBIC', filepath=str(path)) == {'FINISHED'}
    bpy.ops.wm.alembic_import(filepath=str(path), as_background_job=False)
    read = bpy.context.object
    assert read != ob
    result = frames_of(read)
    up = Matrix.Rotation(np.pi / 2, 4, 'X')  # Alembic's y is up
    assert min(np.abs(result - live).max(), np.abs(result @ np.array(up)[:3, :3].T - live).max()) < 1e-5


def test_an_expression_is_saved_beside_the_key():
    ob = bind(make_sculpt())
    posed = pose(ob)
    bpy.ops.object.detail_deform_save_key(name="Smile")
    update()
    assert keys(ob) == ["Basis", KEY, "Smile"]
    ob.data.shape_keys.key_blocks["Smile"].value = 1.0
    update()
    assert np.abs(evaluated(ob) - posed).max() < 1e-5
    bpy.ops.object.detail_deform_remove()
    assert keys(ob) == ["Basis", "Smile"]


def test_examples_and_transfers_leave_the_key_out():
    ob = make_sculpt()
    mine = add_key(ob, "Mine")
    mine.data.foreach_set('co', (own(ob) * (1, 1, 3)).astype(np.float32).ravel())
    bind(ob)
    pose(ob)
    bpy.ops.object.detail_deform_examples_from_keys()
    assert [example.name for example in ob.detail_deform.examples] == ["Mine"]
    target = make_strip(13, name="Target")
    target.detail_deform.transfer.source = ob
    assert bpy.ops.object.detail_deform_transfer(what='ALL_KEYS') == {'FINISHED'}
    assert keys(target) == ["Basis", "Mine"]


def test_a_follower_with_multires():
    source = bind(make_strip(13, name="Source"))
    target = make_sculpt()
    while target.detail_deform.handles:
        target.detail_deform.handles.remove(0)
    activate(target)
    target.detail_deform.transfer.source = source
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    source.detail_deform.handles[0].target.location.z += 0.3
    update()
    update()
    assert keys(target) == ["Basis", KEY] and np.abs(evaluated(target) - displaced(target)).max() < 1e-6
    assert moved_by_key(target) > 0.2
    bpy.ops.object.detail_deform_transfer_live(on=False)
    update()
    assert not keys(target) and [m.name for m in target.modifiers] == ["Multires"]


def moved_by_key(ob):
    return max(abs(point.co[2] - vertex.co[2]) for point, vertex in zip(key(ob).data, ob.data.vertices))


def test_a_key_is_the_source_of_followers_as_the_modifier_is():
    source = bind(make_sculpt())
    target = make_strip(13, name="Target")
    while target.detail_deform.handles:
        target.detail_deform.handles.remove(0)
    activate(target)
    target.detail_deform.transfer.source = source
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    pose(source)
    assert np.abs(evaluated(target) - own(source) - offsets_of(source)).max() < 1e-4


def test_a_handle_is_added_to_the_posed_sculpt():
    ob = bind(make_sculpt())
    posed = pose(ob)
    group(ob, 'middle', np.flatnonzero(np.abs(own(ob)[:, 0] - 0.5) < 0.05))
    add_handle(ob, 'middle', add_empty("Middle", (0.5, 0.5, 0)))
    update()
    bind(ob, keep_rest=True)
    assert np.abs(evaluated(ob) - posed).max() < 1e-4


def test_a_place_in_the_stack_is_none_of_its_concerns():
    ob = bind(make_sculpt())
    ob.modifiers.new("Twin", 'MIRROR')
    assert "modifier stack" not in ob.detail_deform.status
    assert "should stand behind" in refusal(bpy.ops.object.detail_deform_place)
