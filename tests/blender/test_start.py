# SPDX-License-Identifier: GPL-3.0-or-later
"""A handle added to a deformed surface: it moves nothing, its empty stands on the displayed surface, and the binding
starts from there."""

import bpy
import numpy as np
import pytest
from mathutils import Euler

from conftest import (activate, add_from, bind, evaluated, make_strip, own, pull, refusal, select, set_factor,
                      symmetric, update)

SIZE = 1e-5


def box(ob):
    return np.ptp(own(ob), axis=0).max()


def pulled_sheet(lift=0.6, turn=0.0):
    """(object, empty): a sheet of size 2 whose middle is lifted."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40)
    ob = bpy.context.active_object
    pull(ob, np.linalg.norm(own(ob)[:, :2], axis=1) < 0.2, radius=0.7)
    empty = ob.detail_deform.handles[0].target
    empty.location.z += lift
    empty.rotation_euler.x += turn
    update()
    return ob, empty


def on_slope(ob):
    return np.linalg.norm(own(ob)[:, :2] - (0.45, 0), axis=1) < 0.08


def on_surface(ob, empty, chosen):
    """The empty's distance from the middle of these displayed vertices, in local space."""
    place = np.array(ob.matrix_world.inverted() @ empty.matrix_world.translation)
    return np.linalg.norm(evaluated(ob)[chosen].mean(0) - place)


@pytest.mark.parametrize('turn', [0.0, 0.5])
def test_a_second_pull_moves_nothing_and_stands_on_the_surface(turn):
    ob, first = pulled_sheet(turn=turn)
    before, spot = evaluated(ob), on_slope(ob)
    assert before[spot, 2].min() > 0.1
    second = pull(ob, spot)
    assert np.abs(evaluated(ob) - before).max() < SIZE * box(ob)
    assert on_surface(ob, second, spot) < SIZE * box(ob)
    normal = np.array(second.matrix_world.col[2])[:3]
    assert normal[0] > 0.3  # the slope's normal and not the flat sheet's

    # Both handles move on from there, each with its own vertices.
    second.location.x += 0.2
    update()
    moved = evaluated(ob) - before
    assert np.abs(moved[spot] - (0.2, 0, 0)).max() < 1e-5
    held = np.linalg.norm(own(ob)[:, :2], axis=1) < 0.2
    assert np.abs(moved[held]).max() < 1e-5
    first.location.z += 0.1
    update()
    assert np.abs(evaluated(ob)[held] - before[held] - (0, 0, 0.1)).max() < 1e-5


def test_the_start_is_as_smooth_as_a_pose_from_rest():
    """A shape made by two pulls is near the shape that both handles in the same places give to the flat sheet at
    once."""
    ob, first = pulled_sheet(lift=0.3)
    spot = on_slope(ob)
    second = pull(ob, spot)
    second.location.z += 0.1
    update()
    twice, places = evaluated(ob), [empty.matrix_world.copy() for empty in (first, second)]
    activate(ob)
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6
    for empty, place in zip((first, second), places):
        empty.matrix_world = place
    update()
    once = evaluated(ob)
    held = spot | (np.linalg.norm(own(ob)[:, :2], axis=1) < 0.2)
    assert np.linalg.norm(twice - once, axis=1)[held].max() < 0.05
    assert np.linalg.norm(twice - once, axis=1).max() < 0.1


def test_handles_added_by_plus_and_then_bound_again():
    ob, _ = pulled_sheet()
    before, spot = evaluated(ob), on_slope(ob)
    handle = add_from(ob, spot)
    update()
    assert np.abs(evaluated(ob) - before).max() < SIZE
    assert on_surface(ob, handle.target, spot) < SIZE
    bind(ob, keep_rest=True)
    update()
    assert np.abs(evaluated(ob) - before).max() < SIZE


def test_a_handle_of_one_vertex():
    ob, _ = pulled_sheet()
    spot = np.zeros(len(ob.data.vertices), bool)
    spot[np.linalg.norm(own(ob)[:, :2] - (0.45, 0), axis=1).argmin()] = True
    before = evaluated(ob)
    empty = pull(ob, spot)
    assert np.abs(evaluated(ob) - before).max() < SIZE
    assert on_surface(ob, empty, spot) < SIZE
    home = np.array(ob.detail_deform.handles[-1].home_matrix).reshape(4, 4)[:3, 3]
    assert np.linalg.norm(home - own(ob)[spot][0]) < 0.05  # by the rigid motion of its neighbourhood


def pulled_square(side=1):
    ob = symmetric(41)
    empty = pull(ob, np.linalg.norm(own(ob)[:, :2] - (0.25 * side, 0), axis=1) < 0.06, radius=0.3)
    empty.location.z += 0.1
    empty.rotation_euler.rotate(Euler((0.3, 0.2, 0)))
    update()
    return ob, empty


def test_a_mirrored_handle_with_an_empty_of_its_own_moves_nothing():
    ob, _ = pulled_square()
    before = evaluated(ob)
    activate(ob)
    bpy.ops.object.detail_deform_handle_mirror(axis='X')
    bind(ob, keep_rest=True)
    update()
    assert np.abs(evaluated(ob) - before).max() < SIZE
    there = np.linalg.norm(own(ob)[:, :2] - (-0.25, 0), axis=1) < 0.06
    assert on_surface(ob, ob.detail_deform.handles[1].target, there) < 0.005  # the mean of rotated vertices, to 0.005


def test_a_handle_made_symmetric_later_gives_the_whole_mirrored_pose():
    """Also the part of its pose that it had before another handle was added."""
    ob, empty = pulled_square()
    p = own(ob)
    pull(ob, np.linalg.norm(p[:, :2] - (0, 0.2), axis=1) < 0.05)
    empty.location.x += 0.05
    update()
    bpy.ops.object.detail_deform_mesh_activate()
    bpy.ops.object.detail_deform_handle_mirror(index=0, axis='X', symmetric=True)
    bind(ob, keep_rest=True)
    update()
    image = np.array([np.linalg.norm(p - q * (-1, 1, 1), axis=1).argmin() for q in p])
    left, now = np.linalg.norm(p[:, :2] - (0.25, 0), axis=1) < 0.06, evaluated(ob)
    assert np.abs(now[left] - p[left]).max() > 0.09
    # To 0.01: the earlier part of the pose is carried over as the nearest rigid motion of an uneven deformation.
    assert np.abs(now[image][left] * (-1, 1, 1) - now[left]).max() < 0.01


def test_a_third_handle_keeps_a_symmetric_pose():
    """Two symmetric handles are posed, and a third is added: nothing moves, and the two stay mirror images."""
    ob, empty = pulled_square()
    activate(ob)
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    bpy.ops.object.detail_deform_handle_mirror(axis='X', symmetric=True)
    bind(ob, keep_rest=True)
    empty.location.z += 0.1
    empty.rotation_euler.rotate(Euler((0.3, 0.2, 0)))
    update()
    before, p = evaluated(ob), own(ob)
    pull(ob, np.linalg.norm(p[:, :2], axis=1) < 0.05)
    assert np.abs(evaluated(ob) - before).max() < SIZE
    empty.location.x += 0.05
    empty.rotation_euler.rotate(Euler((0.2, 0, 0.3)))
    update()
    image = np.array([np.linalg.norm(p - q * (-1, 1, 1), axis=1).argmin() for q in p])
    left = np.linalg.norm(p[:, :2] - (0.25, 0), axis=1) < 0.06
    now = evaluated(ob)
    assert np.abs(now[image][left] * (-1, 1, 1) - now[left]).max() < 1e-5
    assert np.abs(now[left] - before[left]).max() > 0.05


def with_key(ob, value=1.0):
    ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="Lift", from_mix=False)
    p = own(ob)
    key.data.foreach_set('co', (p + np.outer(0.4 * p[:, 0] ** 2, (0, 0, 1))).astype(np.float32).ravel())
    key.value = value
    update()
    return key


@pytest.mark.parametrize('value', [1.0, 0.5])
def test_the_shape_of_keys_is_the_start(value):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40)
    ob = bpy.context.active_object
    with_key(ob, value)
    before, spot = evaluated(ob), np.linalg.norm(own(ob)[:, :2] - (0.7, 0), axis=1) < 0.1
    empty = pull(ob, spot)
    assert np.abs(evaluated(ob) - before).max() < SIZE * box(ob)
    assert on_surface(ob, empty, spot) < SIZE * box(ob)
    empty.rotation_euler.rotate(Euler((0, 0, 0.5)))
    update()
    # The handle rotates the displayed shape, not the mesh without its keys.
    middle = before[spot].mean(0)
    turn = np.array(Euler((0, 0, 0.5)).to_matrix())
    assert np.abs(evaluated(ob)[spot] - (middle + (before[spot] - middle) @ turn.T)).max() < 1e-5


def test_keys_and_a_pose_and_another_pull():
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40)
    ob = bpy.context.active_object
    with_key(ob)
    empty = pull(ob, np.linalg.norm(own(ob)[:, :2], axis=1) < 0.2)
    empty.location.z += 0.5
    update()
    before = evaluated(ob)
    pull(ob, on_slope(ob))
    assert np.abs(evaluated(ob) - before).max() < SIZE * box(ob)


def test_back_to_rest_is_the_mesh_itself():
    ob, first = pulled_sheet(turn=0.4)
    second = pull(ob, on_slope(ob))
    second.location.x += 0.1
    update()
    activate(ob)
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6
    middle = own(ob)[np.linalg.norm(own(ob)[:, :2], axis=1) < 0.2].mean(0)
    assert np.abs(np.array(first.matrix_world.translation) - middle).max() < 1e-5
    assert abs(second.matrix_world.translation.z) < 0.02  # on the flat sheet
    assert not [name for name in ob.data.attributes.keys() if 'kept' in name]


def test_the_start_is_saved_and_loaded(tmp_path):
    ob, _ = pulled_sheet()
    second = pull(ob, on_slope(ob))
    second.location.x += 0.1
    update()
    before = evaluated(ob)
    path = str(tmp_path / 'start.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    ob = next(o for o in bpy.data.objects if o.type == 'MESH')
    second = ob.detail_deform.handles[1].target
    second.location.x += 0.1
    update()
    second.location.x -= 0.1
    update()
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    assert np.abs(evaluated(ob) - before).max() < SIZE


@pytest.mark.parametrize('mode', ['MESH', 'SHAPE_KEY'])
def test_apply_makes_all_of_it_part_of_the_mesh(mode):
    ob, _ = pulled_sheet()
    second = pull(ob, on_slope(ob))
    second.location.x += 0.1
    update()
    before = evaluated(ob)
    activate(ob)
    bpy.ops.object.detail_deform_apply(mode=mode)
    update()
    assert np.abs(evaluated(ob) - before).max() < SIZE
    assert not [name for name in ob.data.attributes.keys() if name.startswith('detail_deform')]


def test_unbind_shows_the_mesh():
    ob, _ = pulled_sheet()
    pull(ob, on_slope(ob))
    activate(ob)
    bpy.ops.object.detail_deform_unbind()
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() == 0
    bind(ob)  # a new binding, whose rest is the empties' present places
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6


def test_a_slow_result_also_starts_from_the_deformed_surface():
    ob, _ = pulled_sheet(lift=0.3)
    second = pull(ob, on_slope(ob))
    ob.detail_deform.steps = 3
    update()
    before = evaluated(ob)
    second.location.x += 0.1
    update()
    moved = evaluated(ob) - before
    assert np.abs(moved[on_slope(ob)] - (0.1, 0, 0)).max() < 1e-5


def test_a_handle_that_was_disabled_moves_nothing_when_enabled():
    ob, _ = pulled_sheet()
    pull(ob, np.linalg.norm(own(ob)[:, :2] - (-0.6, 0), axis=1) < 0.08)
    off = ob.detail_deform.handles[1]
    off.enabled = False
    bind(ob, keep_rest=True)
    pull(ob, on_slope(ob))
    before = evaluated(ob)
    ob.detail_deform.handles[1].enabled = True
    bind(ob, keep_rest=True)
    update()
    assert np.abs(evaluated(ob) - before).max() < SIZE


def test_make_base_object_is_refused_where_a_start_is_deformed():
    ob, _ = pulled_sheet()
    pull(ob, on_slope(ob))
    activate(ob)
    assert "put all handles back to rest" in refusal(bpy.ops.object.detail_deform_base_make)


def test_a_pull_on_an_undeformed_surface_keeps_no_start():
    ob = bind(make_strip())
    select(ob, (own(ob)[:, 0] > 0.4) & (own(ob)[:, 0] < 0.5))
    bpy.ops.object.detail_deform_pull()
    assert sorted(n for n in ob.data.attributes.keys() if n.startswith('detail_')) == ['detail_deform_offset']


@pytest.mark.parametrize('turn', [0.0, 0.4])
def test_a_symmetric_pull_on_the_slope_moves_nothing(turn):
    ob, empty = pulled_square()
    ob.data.use_mirror_x = True
    empty.rotation_euler.x += turn
    update()
    before = evaluated(ob)
    pull(ob, np.linalg.norm(own(ob)[:, :2] - (0.25, 0.15), axis=1) < 0.05, radius=0.3)
    assert len(ob.detail_deform.handles) == 3
    assert np.abs(evaluated(ob) - before).max() < SIZE
    activate(ob)
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6


def test_a_symmetric_handle_that_was_disabled_moves_nothing_when_enabled():
    ob = symmetric(41)
    ob.data.use_mirror_x = True
    pull(ob, np.linalg.norm(own(ob)[:, :2] - (0.25, 0), axis=1) < 0.06, radius=0.3)
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    ob.data.use_mirror_x = False
    ob.detail_deform.handles[1].enabled = False
    pull(ob, np.linalg.norm(own(ob)[:, :2] - (0, 0.3), axis=1) < 0.05, radius=0.3)
    before = evaluated(ob)
    ob.detail_deform.handles[1].enabled = True
    bind(ob, keep_rest=True)
    update()
    there = np.linalg.norm(own(ob)[:, :2] - (-0.25, 0), axis=1) < 0.06
    assert np.abs(evaluated(ob) - before)[there].max() < SIZE


@pytest.mark.parametrize('scale', [(2, 3, 0.5), (1, 1, 3), (2, 2, 2)])
def test_back_to_rest_in_any_scale_of_the_object(scale):
    ob, _ = pulled_sheet(turn=0.5)
    activate(ob)
    bpy.ops.object.detail_deform_remove()
    ob.scale = scale
    ob.rotation_euler = (0.3, 0.2, 0.5)
    update()
    first = pull(ob, np.linalg.norm(own(ob)[:, :2], axis=1) < 0.2)
    first.location.z += 0.4
    first.rotation_euler.x += 0.5
    update()
    before = evaluated(ob)
    pull(ob, on_slope(ob))
    assert np.abs(evaluated(ob) - before).max() < SIZE * 4
    activate(ob)
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5


@pytest.mark.parametrize('by', ['factor', 'influence'])
def test_a_pull_while_half_of_the_deformation_is_shown(part, by):
    ob, _ = pulled_sheet()
    if by == 'influence':
        ob.vertex_groups.new(name="half").add(range(len(ob.data.vertices)), 0.5, 'REPLACE')
        ob.detail_deform.influence = "half"
    else:
        set_factor(part, ob, 0.5)
    update()
    before, spot = evaluated(ob), on_slope(ob)
    second = pull(ob, spot)
    assert np.abs(evaluated(ob) - before).max() < SIZE
    assert on_surface(ob, second, spot) < SIZE
    activate(ob)
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert abs(second.matrix_world.translation.z) < 0.03


def test_a_base_object_gets_no_attributes_of_the_start():
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20)
    ob = bpy.context.active_object
    with_key(ob)
    pull(ob, np.linalg.norm(own(ob)[:, :2], axis=1) < 0.2)
    activate(ob)
    bpy.ops.object.detail_deform_base_make()
    assert not [n for n in ob.detail_deform.base_object.data.attributes.keys() if n.startswith('detail_')]
