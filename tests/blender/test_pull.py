# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull: makes a handle and a region from a selection, and binds, in one action."""

import bpy
import numpy as np

import pytest

from conftest import (activate, bind, data_blocks, evaluated, in_a_collection, make_strip,
                      members, own, pull, refusal, select, update)


def test_pull_makes_all_of_it_at_once():
    """From Suzanne in a new scene: Edit Mode, a selection, Pull, a move of the empty."""
    bpy.ops.mesh.primitive_monkey_add()
    ob = bpy.context.active_object
    p = own(ob)
    select(ob, p[:, 0] > 1.2)
    assert bpy.ops.object.detail_deform_pull(radius=0.4) == {'FINISHED'}
    assert ob.mode == 'OBJECT' and ob.detail_deform.is_bound, ob.detail_deform.status
    empty = bpy.context.active_object
    assert empty == ob.detail_deform.handles[0].target and bpy.context.selected_objects == [empty]
    empty.location.x += 0.3
    update()
    moved = np.linalg.norm(evaluated(ob) - p, axis=1)
    assert np.allclose(moved[p[:, 0] > 1.2], 0.3, atol=1e-5)
    assert not moved[p[:, 0] < 0.5].any()

    # After a second Pull the first handle keeps its pose, and the region is around both.
    select(ob, p[:, 0] < -1.2)
    assert bpy.ops.object.detail_deform_pull(radius=0.4) == {'FINISHED'}
    moved = np.linalg.norm(evaluated(ob) - p, axis=1)
    assert np.allclose(moved[p[:, 0] > 1.2], 0.3, atol=1e-5) and moved[p[:, 0] < 0].max() < 1e-6
    activate(ob)
    bpy.ops.object.detail_deform_remove()
    assert not ob.vertex_groups and not bpy.data.collections and len(bpy.data.objects) == 1


def test_pull_keeps_a_region_of_the_users_own():
    ob = make_strip()
    select(ob, (own(ob)[:, 0] > 0.4) & (own(ob)[:, 0] < 0.5))
    bpy.ops.object.detail_deform_pull()
    assert ob.detail_deform.region == 'region' and len(ob.detail_deform.handles) == 2


def test_a_pull_that_fails_leaves_no_data_blocks_handles_or_groups():
    ob = make_strip()
    before = data_blocks()
    select(ob, own(ob)[:, 0] > 0.95)  # vertices of the first handle
    assert "larger weight in another handle" in refusal(bpy.ops.object.detail_deform_pull)
    assert ob.mode == 'EDIT' and len(ob.detail_deform.handles) == 1 and len(ob.vertex_groups) == 2
    assert data_blocks() == before


def test_a_pull_that_fails_leaves_region_and_binding(part):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=30, y_subdivisions=30)
    ob = bpy.context.active_object
    p = own(ob)
    select(ob, p[:, 0] > 0.9)
    bpy.ops.object.detail_deform_pull(radius=0.3)
    activate(ob)
    region = members(ob, "Region")
    select(ob, p[:, 0] > 0.95)
    assert "larger weight" in refusal(bpy.ops.object.detail_deform_pull, radius=1.0)
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert (members(ob, "Region") == region).all() and ob.detail_deform.is_bound, ob.detail_deform.status


def test_a_region_that_was_chosen_is_not_changed_by_pull():
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=30, y_subdivisions=30)
    ob = bpy.context.active_object
    p = own(ob)
    select(ob, p[:, 0] > 0.2)
    bpy.ops.object.detail_deform_region_set()
    select(ob, p[:, 0] > 0.9)
    bpy.ops.object.detail_deform_pull(radius=0.1)
    assert (members(ob, "Region") == (p[:, 0] > 0.2)).all()


def test_poses_are_not_counted_twice():
    ob = make_strip()
    p = own(ob)
    bind(ob)
    ob.detail_deform.handles[0].target.location.z += 0.4
    update()
    activate(ob)
    bpy.ops.object.detail_deform_apply(mode='MESH')
    applied = own(ob)
    select(ob, (p[:, 0] > 0.3) & (p[:, 0] < 0.4))
    bpy.ops.object.detail_deform_pull()
    update()
    assert np.abs(evaluated(ob) - applied).max() < 1e-6


def test_empties_go_into_a_collection_of_this_view_layer():
    ob = make_strip()
    hidden = bpy.data.collections.new("Elsewhere")
    bpy.data.scenes.new("Other").collection.children.link(hidden)
    hidden.objects.link(ob)
    bpy.context.scene.collection.objects.unlink(ob)
    bpy.context.scene.collection.objects.link(ob)
    select(ob, (own(ob)[:, 0] > 0.3) & (own(ob)[:, 0] < 0.4))
    bpy.ops.object.detail_deform_pull()
    assert ob.detail_deform.is_bound and bpy.context.active_object.visible_get()


def test_from_mesh_to_empty_and_back():
    ob = bind(make_strip())
    bpy.ops.object.detail_deform_handle_activate()
    empty = ob.detail_deform.handles[0].target
    assert bpy.context.active_object == empty and bpy.context.selected_objects == [empty]
    assert bpy.ops.object.detail_deform_pull.poll()  # otherwise Adjust Last Operation would show no slider
    bpy.ops.object.detail_deform_mesh_activate()
    assert bpy.context.active_object == ob
    assert "Edit Mode" in refusal(bpy.ops.object.detail_deform_pull)


@pytest.mark.parametrize('how', ['as it is', 'hidden', 'disabled', 'unselectable', 'in a hidden collection'])
def test_from_an_empty_to_edit_mode_where_blender_allows_it(how):
    ob = bind(make_strip())
    activate(ob.detail_deform.handles[0].target)
    if how == 'hidden':
        ob.hide_set(True)
    elif how == 'disabled':
        ob.hide_viewport = True
    elif how == 'unselectable':
        ob.hide_select = True
    elif how == 'in a hidden collection':
        in_a_collection(ob).hide_viewport = True
    update()
    assert bpy.ops.object.detail_deform_mesh_activate(edit=True) == {'FINISHED'}
    assert ob.mode == ('OBJECT' if how == 'disabled' else 'EDIT')
    assert bpy.context.view_layer.objects.active == ob


def test_the_status_says_that_one_handle_without_a_region_moves_the_whole_mesh():
    ob = make_strip()
    ob.detail_deform.region = ""
    bind(ob)
    assert "takes the whole mesh along" in ob.detail_deform.status
    ob.detail_deform.region = 'region'
    bind(ob)
    assert "takes the whole mesh along" not in ob.detail_deform.status


def test_no_way_to_a_mesh_that_is_not_in_the_view_layer():
    ob = bind(make_strip())
    empty = ob.detail_deform.handles[0].target
    activate(empty)
    bpy.context.scene.collection.objects.unlink(ob)
    assert not bpy.ops.object.detail_deform_mesh_activate.poll()


# ---- how far it reaches

def sheet(n=40, scale=1.0, size=1.0):
    """A flat square of two units, whose vertices are scaled by `scale`, and its object by `size`."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=n, y_subdivisions=n)
    ob = bpy.context.active_object
    ob.data.vertices.foreach_set('co', (scale * own(ob)).astype(np.float32).ravel())
    ob.scale = 3 * [size]
    update()
    return ob


def reach_of_disk(radius, **of):
    """How far Pull reaches beyond a disk in the middle of a sheet, in units of the unscaled sheet."""
    ob = sheet(**of)
    away = np.linalg.norm(own(ob)[:, :2], axis=1) / of.get('scale', 1.0)
    pull(ob, away <= max(radius, away.min()))
    return away[members(ob, "Region")].max() - radius


@pytest.mark.parametrize('of', [{}, {'n': 120}, {'scale': 1e-4}, {'scale': 1e4}, {'size': 1e-3}, {'size': 1e3}])
def test_it_reaches_as_far_as_the_selection_is_large(of):
    assert reach_of_disk(0.2, **of) == pytest.approx(0.4, abs=0.07)


def test_a_larger_selection_reaches_farther_up_to_a_quarter_of_the_object():
    assert reach_of_disk(0.1, n=80) == pytest.approx(0.2, abs=0.05)
    assert reach_of_disk(0.38, n=80) == pytest.approx(0.25 * np.sqrt(8), abs=0.07)


@pytest.mark.parametrize('n', [8, 40, 200])
def test_around_a_single_vertex_there_is_something_to_follow(n):
    assert 0.99 * max(0.04 * np.sqrt(8), 2 * 2 / n) - 2 / n < reach_of_disk(0.0, n=n) < 0.75


def test_a_second_pull_adds_to_the_region_of_the_first_where_it_reaches_that_handle():
    ob = sheet()
    p = own(ob)
    pull(ob, np.linalg.norm(p[:, :2], axis=1) < 0.2, radius=0.5)
    first = members(ob, "Region")
    pull(ob, np.linalg.norm(p[:, :2] - (0.7, 0.7), axis=1) < 0.1, radius=0.8)
    both = members(ob, "Region")
    assert both[first].all() and both.sum() > first.sum() + 20
    away = np.linalg.norm(p[:, :2] - (0.7, 0.7), axis=1) > 0.95
    assert not both[away & ~first].any()


# ---- cancelling

@pytest.fixture
def begin(part):
    """begin(ob, chosen): starts a Pull of these vertices in the background, up to its bind; returns its generator."""
    def run(ob, chosen):
        select(ob, chosen)
        stages = part('setup.pulling').Pull(bpy.context, ob).stages(wait=False, watch=True)
        while not part('follow.handle_follower').cache.contents_under_way():
            next(stages)
        return stages
    yield run
    part('session').ended(part('session').Until.DISABLED)


def test_a_pull_that_is_cancelled_leaves_nothing_behind(begin):
    ob = sheet()
    before = data_blocks()
    stages = begin(ob, np.linalg.norm(own(ob)[:, :2], axis=1) < 0.2)
    assert ob.modifiers and ob.vertex_groups
    stages.close()
    settings = ob.detail_deform
    assert ob.mode == 'EDIT' and data_blocks() == before
    assert not (ob.modifiers or ob.vertex_groups or ob.animation_data or settings.handles or settings.signature
                or settings.problem or settings.region or settings.own_region)
    pull(ob, np.linalg.norm(own(ob)[:, :2], axis=1) < 0.2)


def test_a_pull_can_be_cancelled_after_each_stage(part):
    ob = sheet()
    pull(ob, np.linalg.norm(own(ob)[:, :2], axis=1) < 0.2)
    before, groups = data_blocks(), len(ob.vertex_groups)
    for count in range(1, 6):
        select(ob, np.linalg.norm(own(ob)[:, :2] - (0.5, 0.5), axis=1) < 0.1)
        stages = part('setup.pulling').Pull(bpy.context, ob).stages(wait=False, watch=True)
        for _ in range(count):
            next(stages)
        stages.close()
        assert ob.mode == 'EDIT' and data_blocks() == before and len(ob.vertex_groups) == groups
        assert len(ob.detail_deform.handles) == 1 and ob.detail_deform.signature
        assert ob.detail_deform.handle_index == 0
        bpy.ops.object.mode_set(mode='OBJECT')
        update()
        assert ob.detail_deform.is_bound, ob.detail_deform.status


def test_a_pull_that_is_cancelled_leaves_the_earlier_binding(begin):
    ob = sheet()
    p = own(ob)
    first = pull(ob, np.linalg.norm(p[:, :2], axis=1) < 0.2)
    first.location.z += 0.3
    update()
    before, region = evaluated(ob), members(ob, "Region")
    begin(ob, np.linalg.norm(p[:, :2] - (0.5, 0.5), axis=1) < 0.1).close()
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert ob.detail_deform.is_bound and len(ob.detail_deform.handles) == 1, ob.detail_deform.status
    assert (members(ob, "Region") == region).all() and len(ob.vertex_groups) == 2
    assert np.abs(evaluated(ob) - before).max() < 1e-7
    first.location.z -= 0.3
    update()
    assert np.abs(evaluated(ob) - p).max() < 1e-6


def test_a_selection_on_both_sides_is_measured_once(part):
    """With Edit Mode's symmetry the mirror image is pulled too, and the reach depends on the size of one side."""
    ob = sheet(60)
    p = own(ob)
    ob.data.use_mirror_x = True
    pull(ob, np.linalg.norm(p[:, :2] - (0.6, 0), axis=1) < 0.1)
    region, away = members(ob, "Region"), np.linalg.norm(np.abs(p[:, :2]) - (0.6, 0), axis=1)
    assert away[region].max() == pytest.approx(0.3, abs=0.05)
    assert (region[away < 0.25]).all()
