# SPDX-License-Identifier: GPL-3.0-or-later
"""A binding when the mesh, its groups or the file change."""
import time

import bpy
import numpy as np
import pytest

from conftest import (activate, bind, evaluated, group, make_strip, members,
                      own, refusal, update)


def right(ob):
    return ob.detail_deform.handles[0].target


def posed():
    ob = bind(make_strip())
    right(ob).location.z += 0.4
    update()
    return ob


def touch(ob):
    ob.data.update()
    ob.data.update_tag()
    update()


def swap_positions(ob):
    a, b = ob.data.vertices[300], ob.data.vertices[301]
    a.co, b.co = b.co.copy(), a.co.copy()


def swap_faces(ob):
    """Exchanges a corner between two faces: counts and positions stay the same."""
    loops = ob.data.loops
    first, second = loops[0].vertex_index, loops[4].vertex_index
    loops[0].vertex_index, loops[4].vertex_index = second, first


def weaken(ob):
    ob.vertex_groups['region'].add([320], 0.4, 'REPLACE')


def move_weight(ob):
    ob.vertex_groups['right'].remove([624])
    ob.vertex_groups['right'].add([500], 1.0, 'REPLACE')


CHANGES = [(swap_positions, "vertices were moved"), (swap_faces, "vertices or faces were changed"),
           (weaken, "region, the handles or their vertex groups"),
           (move_weight, "region, the handles or their vertex groups")]


@pytest.mark.parametrize('change, sentence', CHANGES)
def test_changes_are_noticed_by_content(change, sentence):
    ob = posed()
    offsets = evaluated(ob) - own(ob)
    assert "Re-bind" not in ob.detail_deform.status
    change(ob)
    touch(ob)
    assert sentence in ob.detail_deform.status and "Re-bind" in ob.detail_deform.status
    assert not ob.detail_deform.is_bound
    # The shape is frozen and doesn't follow its handle, because the binding is another mesh's.
    right(ob).location.z += 1
    update()
    assert np.abs(evaluated(ob) - own(ob) - offsets).max() < 1e-6
    assert sentence in refusal(bpy.ops.object.detail_deform_update)


def test_a_change_that_is_taken_back_keeps_the_binding():
    ob = posed()
    shown = evaluated(ob)
    swap_positions(ob)
    touch(ob)
    assert not ob.detail_deform.is_bound
    swap_positions(ob)
    touch(ob)
    assert ob.detail_deform.is_bound
    assert np.abs(evaluated(ob) - shown).max() < 1e-6


def test_a_group_that_no_handle_uses_keeps_the_binding():
    ob = posed()
    group(ob, 'unrelated', [1, 2, 3])
    touch(ob)
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    right(ob).location.z += 0.05
    update()
    assert np.abs((evaluated(ob) - own(ob))[members(ob, 'right')] - (0, 0, 0.45)).max() < 1e-5


def test_topology_changed_in_edit_mode_is_noticed_and_rebinding_keeps_the_pose():
    ob = posed()
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert "vertices or faces were changed" in ob.detail_deform.status
    bind(ob, keep_rest=True)
    update()
    moved = evaluated(ob) - own(ob)
    assert len(moved) > 625
    assert np.allclose(moved[members(ob, 'right')], (0, 0, 0.4), atol=1e-5)


def test_bind_takes_the_present_places_as_rest():
    ob = posed()
    bpy.ops.object.detail_deform_unbind()
    bind(ob)
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6
    right(ob).location.z -= 0.4
    update()
    assert np.allclose((evaluated(ob) - own(ob))[members(ob, 'right')], (0, 0, -0.4), atol=1e-5)


def test_settings_that_need_a_new_bind_say_so():
    ob = posed()
    for change, back in (({'base_metric': 'BASE'}, {'base_metric': 'SURFACE'}),
                         ({'metric_smoothing': 1.0}, {'metric_smoothing': 0.0}),
                         ({'region': ''}, {'region': 'region'})):
        for name, value in change.items():
            setattr(ob.detail_deform, name, value)
        assert "Re-bind" in ob.detail_deform.status
        for name, value in back.items():
            setattr(ob.detail_deform, name, value)
        assert ob.detail_deform.is_bound
    ob.detail_deform.handles[0].enabled = False
    assert "Re-bind" in ob.detail_deform.status


def test_a_deleted_group_or_handle_is_named():
    ob = posed()
    ob.vertex_groups.remove(ob.vertex_groups['right'])  # Blender doesn't tag the object as changed
    right(ob).location.z += 0.1
    update()
    assert "'right'" in ob.detail_deform.status
    assert np.abs(evaluated(ob) - own(ob)).max() < 0.41

    second = bind(make_strip(name="Second"))
    bpy.ops.object.detail_deform_handle_remove()
    assert "handle" in second.detail_deform.status and not second.detail_deform.is_bound


def test_an_empty_that_disappears_is_named_and_the_shape_stays():
    ob = posed()
    shown = evaluated(ob)
    empty = right(ob)
    bpy.context.scene.collection.objects.unlink(empty)
    update()
    ob.data.update_tag()
    update()
    assert "lost their empties" in ob.detail_deform.status and np.abs(evaluated(ob) - shown).max() < 1e-6
    bpy.context.scene.collection.objects.link(empty)
    update()
    assert ob.detail_deform.is_bound and "Bound" in ob.detail_deform.status
    bpy.data.objects.remove(empty)
    update()
    assert "lost their empties" in ob.detail_deform.status
    assert np.abs(evaluated(ob) - shown).max() < 1e-6


def test_unbind_shows_the_rest_shape():
    ob = posed()
    assert bpy.ops.object.detail_deform_unbind() == {'FINISHED'}
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() == 0
    assert ob.detail_deform.status == "Not bound."
    assert 'detail_deform_offset' not in ob.data.attributes
    right(ob).location.z += 1
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() == 0


def snapshot(ob):
    mesh = ob.data
    return (own(ob).tolist(), [tuple(p.vertices) for p in mesh.polygons],
            sorted(a.name for a in mesh.attributes if not a.name.startswith('.')), [m.name for m in ob.modifiers],
            [g.name for g in ob.vertex_groups],
            [[(g.group, g.weight) for g in v.groups] for v in mesh.vertices],
            sorted(o.name for o in bpy.data.objects), ob.animation_data, len(bpy.data.node_groups),
            len(bpy.data.meshes))


def test_remove_leaves_the_object_as_it_was_found():
    ob = make_strip()
    ob.modifiers.new('Subdivision', 'SUBSURF')
    before = snapshot(ob)
    bpy.ops.object.detail_deform_add()
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='DESELECT')
    bpy.ops.object.mode_set(mode='OBJECT')
    for v in range(8):
        ob.data.vertices[12 * 25 + v].select = True
    bpy.ops.object.mode_set(mode='EDIT')
    assert bpy.ops.object.detail_deform_handle_add() == {'FINISHED'}
    bpy.ops.object.mode_set(mode='OBJECT')
    assert snapshot(ob) != before
    bind(ob)
    right(ob).location.z += 0.2
    update()
    assert bpy.ops.object.detail_deform_remove() == {'FINISHED'}
    update()
    after = snapshot(ob)
    assert after == before
    assert len(ob.detail_deform.handles) == 0 and ob.detail_deform.region == ''


def test_save_and_reopen_keeps_pose_and_binding(tmp_path):
    ob = posed()
    shown, path = evaluated(ob), str(tmp_path / 'posed.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    ob = activate(bpy.data.objects['Strip'])
    assert np.abs(evaluated(ob) - shown).max() < 1e-6
    update()
    right(ob).location.z += 0.1
    update()
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    moved = evaluated(ob) - shown
    assert np.allclose(moved[members(ob, 'right')], (0, 0, 0.1), atol=1e-5)


def test_another_file_gives_back_the_memory_of_what_was_bound(module, tmp_path):
    bound = module.follow.handle_follower
    ob = posed()
    path, content = str(tmp_path / 'posed.blend'), bound.content_of(ob)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    made = bound.cache.find(content).made
    bpy.ops.wm.open_mainfile(filepath=path)
    assert bound.cache.find(content).made is made  # the file that is opened needs it
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert bound.cache.find(content) is None


def test_a_file_opened_without_the_addon_shows_the_result(module, tmp_path):
    ob = posed()
    shown, path = evaluated(ob), str(tmp_path / 'posed.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path)
    module.unregister()
    try:
        bpy.ops.wm.open_mainfile(filepath=path)
        assert np.abs(evaluated(bpy.data.objects['Strip']) - shown).max() < 1e-6
    finally:
        module.register()


def test_renaming_keeps_the_binding():
    ob = posed()
    ob.name, right(ob).name = "Renamed", "Other"
    right(ob).location.z += 0.1
    update()
    assert np.allclose((evaluated(ob) - own(ob))[members(ob, 'right')], (0, 0, 0.5), atol=1e-5)


def test_undo_of_a_drag_costs_no_bind(part):
    ob = bind(make_strip())
    native = part('library.native')
    bpy.ops.ed.undo_push(message="bound")
    right(ob).location.z += 0.4
    update()
    bpy.ops.ed.undo_push(message="moved")
    original, binds = native.Bind, []
    native.Bind = lambda *a, **k: (binds.append(1), original(*a, **k))[1]
    try:
        bpy.ops.ed.undo()
        update()
        ob = bpy.data.objects['Strip']
        assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6
        assert ob.detail_deform.is_bound, ob.detail_deform.status
        bpy.ops.ed.redo()
        update()
        ob = bpy.data.objects['Strip']
        assert np.allclose((evaluated(ob) - own(ob))[members(ob, 'right')], (0, 0, 0.4), atol=1e-5)
        right(ob).location.z -= 0.4
        update()
        assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6
        assert binds == []
    finally:
        native.Bind = original


def test_a_duplicate_with_its_own_mesh_follows_too():
    ob = posed()
    copy = ob.copy()
    copy.data = ob.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    update()
    right(ob).location.z += 0.1
    update()
    for each in (ob, copy):
        assert np.allclose((evaluated(each) - own(each))[members(each, 'right')], (0, 0, 0.5), atol=1e-5)


def test_a_linked_duplicate_goes_along_and_only_the_first_writes_to_the_mesh():
    ob = posed()
    copy = ob.copy()
    bpy.context.scene.collection.objects.link(copy)
    before = evaluated(ob)
    right(ob).location.z += 0.1
    update()
    assert "single-user" in copy.detail_deform.status and "single-user" not in ob.detail_deform.status
    assert np.array_equal(evaluated(copy), evaluated(ob)) and np.abs(evaluated(ob) - before).max() > 0.09
    bpy.data.objects.remove(copy)
    right(ob).location.z += 0.1
    update()
    assert ob.detail_deform.is_bound and "Bound" in ob.detail_deform.status


def finish_in_background(life):
    """Does the work of the window's timer, which background Blender doesn't run."""
    for _ in range(2000):
        if life._poll() is None:
            return
        time.sleep(0.01)
    raise AssertionError("the bind did not end")


def test_a_bind_in_the_background_ends_with_the_surface_bound(part):
    binding, life, cache = part('follow.binding'), part('follow.lifecycle'), part('follow.handle_follower').cache
    ob = make_strip(37)  # a size that no other test uses, whose binding isn't cached
    binding.bind(ob, bpy.context.evaluated_depsgraph_get(), wait=False, keep_rest=False)
    assert cache.contents_under_way() and "Preparing (" in ob.detail_deform.status
    assert not ob.detail_deform.is_bound
    finish_in_background(life)
    assert ob.detail_deform.is_bound
    right(ob).location.z += 0.4
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() > 0.39


def test_a_bind_in_the_background_notices_edits_deletion_unbinding_and_cancelling(part, as_in_a_window):
    as_in_a_window('follow.lifecycle')  # without a window an operator waits for the bind, and no cancel is in time
    binding, life = part('follow.binding'), part('follow.lifecycle')
    changed, deleted, unbound, cancelled = (make_strip(n, name=str(n)) for n in (31, 32, 33, 61))
    for ob in (changed, deleted, unbound, cancelled):
        binding.bind(ob, bpy.context.evaluated_depsgraph_get(), wait=False, keep_rest=False)
    swap_positions(changed)
    bpy.data.objects.remove(deleted)
    binding.unbind(unbound)
    activate(cancelled)
    assert bpy.ops.object.detail_deform_bind_cancel() == {'FINISHED'}
    finish_in_background(life)
    assert "vertices were moved" in changed.detail_deform.status
    assert unbound.detail_deform.status == "Not bound."
    assert cancelled.detail_deform.status == "It was cancelled." and not cancelled.detail_deform.is_bound


def test_a_new_bind_right_after_unbinding_is_not_taken_for_the_old_one(part):
    binding, life = part('follow.binding'), part('follow.lifecycle')
    ob = make_strip(83)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for _ in range(3):
        binding.bind(ob, depsgraph, wait=False, keep_rest=False)
        binding.unbind(ob)
    binding.bind(ob, depsgraph, wait=False, keep_rest=False)
    finish_in_background(life)
    assert ob.detail_deform.is_bound, ob.detail_deform.status


@pytest.mark.parametrize('in_place', [False, True])
def test_a_mesh_replaced_between_frames_is_not_written_to(in_place):
    ob = posed()
    if in_place:
        ob.data.clear_geometry()
    else:
        ob.data = bpy.data.meshes.new('Other')
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    ob.data.from_pydata(points, [], [(0, 1, 2)])
    ob.vertex_groups.clear()
    group(ob, 'region', [0, 1, 2])
    group(ob, 'right', [2])
    right(ob).location.z += 1
    bpy.context.scene.frame_set(7)
    assert "vertices or faces were changed" in ob.detail_deform.status
    assert not ob.detail_deform.is_bound and (evaluated(ob) == points).all()
