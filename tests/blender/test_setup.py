# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles and regions are made from selections and groups, changed, reset and removed."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from conftest import (activate, add_empty, add_from, add_handle, bind, data_blocks, evaluated, group,
                      make_strip, members, own, refusal, select, update)


@pytest.fixture
def plane():
    """A flat grid in the xy plane of 21 × 21 vertices, 2 wide, about the origin."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20, size=2)
    return bpy.context.active_object


def selected(ob):
    ob.update_from_editmode()
    return np.array([v.select for v in ob.data.vertices])


def test_a_handle_from_a_selection(plane):
    plane.matrix_world = Matrix.Translation((3, 0, 1)) @ Matrix.Rotation(np.pi / 2, 4, 'X')
    update()
    before = data_blocks()
    chosen = own(plane)[:, 0] > 0.75
    handle = add_from(plane, chosen)
    assert (members(plane, handle.vertex_group) == chosen).all()
    empty = handle.target
    update()
    # In the middle of its vertices, its Z axis along their normal, the plane's.
    middle = plane.matrix_world @ Vector(own(plane)[chosen].mean(0))
    assert (empty.matrix_world.translation - middle).length < 1e-5
    normal = plane.matrix_world.to_3x3() @ Vector((0, 0, 1))
    assert (empty.matrix_world.to_3x3().col[2] - normal).length < 1e-5
    assert 0.9 < empty.empty_display_size < 1.1  # half of its vertices' extent
    # In a collection of its own beside the object, and with the object as parent.
    assert [c.name for c in empty.users_collection] == [f"{plane.name} Handles"]
    assert empty.users_collection[0].name in plane.users_collection[0].children
    place = empty.matrix_world.translation.copy()
    plane.location.z += 2
    update()
    assert (empty.matrix_world.translation - place - Vector((0, 0, 2))).length < 1e-5

    bpy.ops.object.detail_deform_handle_remove()
    assert data_blocks() == before and not plane.vertex_groups


@pytest.mark.parametrize('unit', [1e-22, 1e22])
def test_a_handle_on_a_mesh_in_an_extreme_unit_is_aligned_and_binds(plane, unit):
    """Areas are proportional to the unit's square, 1e44 or 1e-44, which single precision can't hold."""
    plane.data.transform(Matrix.Rotation(np.pi / 2, 4, 'X'))
    chosen = own(plane)[:, 0] > 0.75
    plane.data.vertices.foreach_set('co', (unit * own(plane)).astype(np.float32).ravel())
    update()
    empty = add_from(plane, chosen).target
    update()
    assert (empty.matrix_world.to_3x3().col[2] - Vector((0, -1, 0))).length < 1e-5
    bind(plane)


def test_a_handle_that_is_no_child_and_not_aligned(plane):
    plane.rotation_euler.x = 1
    update()
    handle = add_from(plane, own(plane)[:, 0] > 0.5, parented=False, align=False)
    update()
    assert handle.target.parent is None
    assert (np.array(handle.target.matrix_world)[:3, :3] == np.eye(3)).all()


def test_the_empty_of_a_handle_on_top_is_not_rotated_and_others_have_y_up(plane):
    chosen = own(plane)[:, 0] > 0.5
    assert np.allclose(add_from(plane, chosen).target.rotation_euler, 0, atol=1e-6)
    plane.data.flip_normals()
    below = add_from(plane, chosen).target
    update()
    below = below.matrix_world.to_3x3()
    assert (below.col[2] - Vector((0, 0, -1))).length < 1e-5 and (below.col[1] - Vector((0, 1, 0))).length < 1e-5
    plane.rotation_euler = (0.5 * np.pi, 0, 1)
    update()
    beside = add_from(plane, chosen).target
    update()
    assert (beside.matrix_world.to_3x3().col[1] - Vector((0, 0, 1))).length < 1e-5


def test_the_empty_of_a_ring_without_a_normal_is_not_rotated():
    bpy.ops.mesh.primitive_cylinder_add(vertices=32, end_fill_type='NOTHING')
    ob = bpy.context.active_object
    handle = add_from(ob, own(ob)[:, 2] > 0)
    assert np.allclose(handle.target.rotation_euler, 0)


def test_remove_leaves_the_users_own_empties_and_groups(plane):
    handle = add_from(plane, own(plane)[:, 0] > 0.5)
    made, mine = handle.target.name, bpy.data.objects.new("Mine", None)
    bpy.context.scene.collection.objects.link(mine)
    group(plane, "painted", [0, 1, 2])
    handle.target, handle.vertex_group = mine, "painted"
    activate(plane)
    bpy.ops.object.detail_deform_remove()
    assert "Mine" in bpy.data.objects and "painted" in plane.vertex_groups
    assert made not in bpy.data.objects and "Handle" not in plane.vertex_groups
    assert f"{plane.name} Handles" not in bpy.data.collections


def test_a_copy_of_the_object_leaves_the_original_its_empties(plane):
    handle = add_from(plane, own(plane)[:, 0] > 0.5)
    copy = plane.copy()
    copy.data = plane.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    activate(copy)
    bpy.ops.object.detail_deform_remove()
    assert handle.target is not None and handle.target.name in bpy.data.objects


def test_the_region_from_a_selection(plane):
    group(plane, "painted", range(5))
    plane.detail_deform.region = "painted"
    for chosen in (own(plane)[:, 0] > 0, own(plane)[:, 1] > 0.5):
        select(plane, chosen)
        assert bpy.ops.object.detail_deform_region_set() == {'FINISHED'}
        bpy.ops.object.mode_set(mode='OBJECT')
        assert plane.detail_deform.region == "Region"
        assert (members(plane, "Region") == chosen).all()
    assert members(plane, "painted").sum() == 5  # the user's own group isn't changed
    assert len(plane.vertex_groups) == 2
    bpy.ops.object.detail_deform_remove()
    assert [g.name for g in plane.vertex_groups] == ["painted"]


def test_the_region_around_the_handles(plane):
    p = own(plane)
    add_from(plane, p[:, 0] > 0.95)
    assert bpy.ops.object.detail_deform_region_around(radius=0.72) == {'FINISHED'}
    # Distances from a straight line on a plane are exact: 0.72 is seven rows of vertices, 0.1 apart.
    assert (members(plane, "Region") == (p[:, 0] > 0.25)).all()
    plane.scale = (2, 2, 2)
    update()
    bpy.ops.object.detail_deform_region_around(radius=0.72)  # in the world's unit
    assert (members(plane, "Region") == (p[:, 0] > 0.65)).all()
    bpy.ops.object.detail_deform_region_around()  # the default: a quarter of the bounding box's diagonal
    assert (members(plane, "Region") == (p[:, 0] > 0.95 - 0.25 * np.sqrt(8))).all()
    bpy.ops.object.detail_deform_region_around(by='EDGES', steps=3)
    assert (members(plane, "Region") == (p[:, 0] > 0.65)).all()


def test_the_region_around_a_selection_goes_along_the_surface():
    # Two sheets close to each other, joined at one end only.
    n = 30
    x = np.concatenate([np.linspace(0, 1, n), np.linspace(1, 0, n)])
    z = np.repeat([0.0, 0.05], n)
    points = np.stack([np.repeat(x, 2), np.tile([0, 0.1], 2 * n), np.repeat(z, 2)], -1)
    faces = [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(2 * n - 1)]
    mesh = bpy.data.meshes.new("Fold")
    mesh.from_pydata(points.tolist(), [], faces)
    ob = bpy.data.objects.new("Fold", mesh)
    bpy.context.scene.collection.objects.link(ob)
    select(ob, np.arange(4 * n) < 2)
    bpy.ops.object.detail_deform_region_around(radius=0.5)
    bpy.ops.object.mode_set(mode='OBJECT')
    region = members(ob, "Region")
    assert region[:2 * n].sum() == 2 * 15 and not region[2 * n:].any()


def test_select_and_assign():
    ob = make_strip()
    activate(ob)
    right = members(ob, 'right')
    assert bpy.ops.object.detail_deform_handle_select() == {'FINISHED'} and ob.mode == 'EDIT'
    assert (selected(ob) == right).all()
    # The handle's group was the user's own: it stays, and the handle gets a new one.
    less = own(ob)[:, 0] > 0.95
    select(ob, less)
    assert bpy.ops.object.detail_deform_handle_assign() == {'FINISHED'}
    bpy.ops.object.detail_deform_handle_select()
    assert (selected(ob) == less).all()
    handle = ob.detail_deform.handles[0]
    assert (members(ob, 'right') == right).all() and handle.vertex_group == 'right.001'
    # The new group is changed from then on.
    more = own(ob)[:, 0] > 0.8
    select(ob, more)
    bpy.ops.object.detail_deform_handle_assign()
    bpy.ops.object.mode_set(mode='OBJECT')
    assert (members(ob, handle.vertex_group) == more).all() and len(ob.vertex_groups) == 3
    assert ob.data.vertices[0].select is False
    bpy.ops.object.detail_deform_handle_select()
    select(ob, own(ob)[:, 0] < 0.1)
    bpy.ops.object.detail_deform_handle_select(extend=True)
    assert (selected(ob) == (more | (own(ob)[:, 0] < 0.1))).all()


def test_assigning_to_a_bound_handle_asks_for_a_new_bind():
    ob = bind(make_strip())
    select(ob, own(ob)[:, 0] > 0.8)
    bpy.ops.object.detail_deform_handle_assign()
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert "handles" in ob.detail_deform.stale and "Re-bind" in ob.detail_deform.status
    bind(ob, keep_rest=True)


def test_back_to_rest():
    ob = make_strip()
    p = own(ob)
    second = add_from(ob, p[:, 0] < 0.1)
    bind(ob)
    first = ob.detail_deform.handles[0]
    places = [h.target.matrix_world.copy() for h in (first, second)]
    for handle in (first, second):
        handle.target.location.z += 0.4
        handle.target.rotation_euler.x += 7.0
    update()
    assert np.abs(evaluated(ob) - p).max() > 0.3
    bpy.ops.object.detail_deform_handle_reset(index=0)
    update()
    assert np.abs(np.array(first.target.matrix_world) - np.array(places[0])).max() < 1e-6
    assert abs(first.target.rotation_euler.x) < 1e-6  # whole turns are taken back too
    assert np.abs(np.array(second.target.matrix_world) - np.array(places[1])).max() > 0.1
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert np.abs(evaluated(ob) - p).max() < 1e-5


def test_sentences():
    ob = make_strip()
    activate(ob)
    assert "in Edit Mode" in refusal(bpy.ops.object.detail_deform_region_set)
    assert "in Edit Mode" in refusal(bpy.ops.object.detail_deform_handle_assign)
    assert "none has a rest place" in refusal(bpy.ops.object.detail_deform_handle_reset)
    select(ob, np.zeros(len(ob.data.vertices)))
    assert "No vertex is selected" in refusal(bpy.ops.object.detail_deform_region_set)
    assert "No vertex is selected" in refusal(bpy.ops.object.detail_deform_handle_assign)
    bpy.ops.object.mode_set(mode='OBJECT')
    ob.detail_deform.handles.clear()
    assert "nothing to start from" in refusal(bpy.ops.object.detail_deform_region_around)
    assert "no handle" in refusal(bpy.ops.object.detail_deform_handle_select)


def test_settings_are_copied_to_the_selected():
    ob, other = make_strip(), make_strip(name="Other")
    bind(other)
    values = {'method': 'GRADIENT', 'rotation_only': False, 'refine': 7, 'smoothness': 3, 'levels': 2,
              'volume_tolerance': 0.5, 'steps': 2, 'metric_smoothing': 1.5, 'base_metric': 'BASE'}
    for name, value in values.items():
        setattr(ob.detail_deform, name, value)
    activate(ob)
    assert "No other mesh is selected" in refusal(bpy.ops.object.detail_deform_copy_settings)
    other.select_set(True)
    assert bpy.ops.object.detail_deform_copy_settings() == {'FINISHED'}
    assert {name: getattr(other.detail_deform, name) for name in values} == values
    assert other.detail_deform.region == 'region' and len(other.detail_deform.handles) == 1
    assert "need a new Bind" in other.detail_deform.stale


def undone():
    bpy.ops.ed.undo()
    update()
    return next(o for o in bpy.data.objects if o.type == 'MESH')


def test_undo_in_edit_mode_takes_the_settings_back_too():
    ob = make_strip()
    select(ob, own(ob)[:, 0] > 0.5)
    bpy.ops.ed.undo_push(message="selected")
    bpy.ops.object.detail_deform_region_set('EXEC_DEFAULT', True)
    ob = bpy.context.active_object
    assert ob.detail_deform.region == 'Region'
    ob = undone()
    assert ob.detail_deform.region == 'region' and 'Region' not in ob.vertex_groups


def test_parents_go_back_to_rest_before_their_children():
    ob = make_strip()
    child = ob.detail_deform.handles[0].target
    parent = add_from(ob, own(ob)[:, 0] < 0.1).target
    child.parent = parent
    child.matrix_parent_inverse = parent.matrix_world.inverted()
    update()
    bind(ob)
    parent.location.z += 0.5
    parent.rotation_euler.y += 0.5
    child.location.x += 0.2
    update()
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5


def test_handles_are_told_apart_by_name():
    ob = make_strip()
    second = add_from(ob, own(ob)[:, 0] < 0.1)
    second.name = 'right'
    assert [h.name for h in ob.detail_deform.handles] == ['right', 'right.001']


def test_assigning_again_makes_no_second_group_and_a_child_of_the_empty_stays_in_place():
    ob = make_strip()
    handle = add_from(ob, own(ob)[:, 0] < 0.1)
    child = bpy.data.objects.new("Lamp", None)
    bpy.context.scene.collection.objects.link(child)
    child.parent = handle.target
    update()
    place = child.matrix_world.copy()
    handle.vertex_group = 'right'
    select(ob, own(ob)[:, 0] < 0.2)
    bpy.ops.object.detail_deform_handle_assign()
    bpy.ops.object.mode_set(mode='OBJECT')
    assert handle.vertex_group == handle.own_group and len(ob.vertex_groups) == 3
    bpy.ops.object.detail_deform_handle_remove()
    update()
    assert np.abs(np.array(child.matrix_world) - np.array(place)).max() < 1e-6


def test_a_handle_that_nothing_follows_is_reported():
    ob = make_strip()
    group(ob, 'corner', [0])
    add_handle(ob, 'corner', add_empty("Corner", (0, 0, 0)))
    bind(ob)
    assert "Nothing follows 1 handle (such as 'corner')" in ob.detail_deform.status
    ob.detail_deform.handles[1].enabled = False
    assert "Nothing follows" not in bind(ob).detail_deform.status
