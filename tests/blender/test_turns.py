# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations of handles beside the simple one about a single Euler angle: tilted empties, mirrored objects and handles,
handles that turn against each other or together, and other Euler angles of the same rotation."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from conftest import activate, add_empty, add_handle, bind, evaluated, group, members, own, update
from test_shape import FREE, HEIGHT, bar_mesh, largest_rate, make, make_bar, target_of, turn


def largest_jump(ob, values, set_to):
    """The largest move of a vertex from one value to the next, as a fraction of the largest move of a held vertex."""
    held = np.any([members(ob, handle.vertex_group) for handle in ob.detail_deform.handles], axis=0)
    seen = []
    for value in values:
        set_to(value)
        update()
        seen.append(evaluated(ob))
    steps = np.linalg.norm(np.diff(seen, axis=0), axis=2)
    return (steps.max(1) / steps[:, held].max(1)).max()


def by_two():
    """(unbound object, upper empty, lower empty): a bar with a handle at each end and no fixed vertex."""
    positions, triangles = bar_mesh()
    z = positions[:, 2]
    ob = make("Bar", positions, triangles, z > FREE[0] + 1e-6, z > FREE[1] - 1e-6, (0, 0, HEIGHT))
    group(ob, 'low', np.flatnonzero(z < FREE[0] + 1e-6))
    add_handle(ob, 'low', add_empty("Low", (0, 0, 0)))
    ob.detail_deform.region = ''
    return ob, *(handle.target for handle in ob.detail_deform.handles)


def test_a_turn_the_other_way_is_the_mirror_image():
    ob = make_bar(*bar_mesh())
    rates = [largest_rate(turn(ob, degrees)) for degrees in (360, -360)]
    assert rates[1][1] == pytest.approx(-360, abs=1) and rates[0][0] == pytest.approx(rates[1][0], abs=0.01)


@pytest.mark.parametrize('tilt', [0.1, 5, 20])
def test_a_tilt_takes_no_whole_turn_away(tilt):
    ob = make_bar(*bar_mesh())
    target_of(ob).rotation_euler.x = math.radians(tilt)
    rate, turned = largest_rate(turn(ob, 360))
    assert turned == pytest.approx(360, abs=5) and rate <= 1.5, (turned, rate)


def test_a_tilted_turn_is_continuous():
    ob = make_bar(*bar_mesh())
    target_of(ob).rotation_euler.x = math.radians(10)
    assert largest_jump(ob, np.linspace(180, 540, 201), lambda degrees: turn(ob, degrees)) <= 3


def test_a_mirrored_object_turns_continuously_beyond_half_a_turn():
    positions, triangles = bar_mesh()
    z = positions[:, 2]
    ob = make("Bar", positions, triangles, z > FREE[0] + 1e-6, z > FREE[1] - 1e-6, (0, 0, HEIGHT))
    ob.scale = (-1, 1, 1)
    update()
    bind(ob)
    assert largest_jump(ob, np.linspace(0, 360, 201), lambda degrees: turn(ob, degrees)) <= 3


def test_handles_that_turn_against_each_other_are_as_one_that_turns_twice_as_far():
    ob, high, low = by_two()
    bind(ob)

    def turn_both(degrees):
        high.rotation_euler.z, low.rotation_euler.z = math.radians(degrees), -math.radians(degrees)

    assert largest_jump(ob, np.linspace(0, 180, 201), turn_both) <= 3
    turn_both(90)
    update()
    rate, turned = largest_rate(evaluated(ob))
    assert turned == pytest.approx(180, abs=1) and rate <= 1.5, (turned, rate)


def test_all_handles_together_move_the_mesh_rigidly():
    ob, high, low = by_two()
    bind(ob)
    for degrees in (100, 150, 180, 200, 400):
        high.rotation_euler.z = low.rotation_euler.z = math.radians(degrees)
        update()
        turned = np.array(Matrix.Rotation(math.radians(degrees), 3, 'Z'))
        assert np.abs(evaluated(ob) - own(ob) @ turned.T).max() < 1e-5, degrees


def test_a_handle_mirrored_by_its_scale_is_not_taken_for_a_half_turn():
    ob = make_bar(*bar_mesh())
    shapes = {}
    for deformer in ('AUTOMATIC', 'LINEAR'):
        ob.detail_deform.base_deformer = deformer
        for scale in (-0.99, -1.01):
            target_of(ob).scale.x = scale
            update()
            shapes[deformer, scale] = evaluated(ob)
    for scale in (-0.99, -1.01):
        assert np.abs(shapes['AUTOMATIC', scale] - shapes['LINEAR', scale]).max() < 1e-3, scale


# ---- other Euler angles of the same rotation

TILTS = [(-2, 0.9, 2.5), (2, 0.5, -2), (3, 0.3, 3), (2.5, 0.2, 0.5), (2.5, -0.7, 2.5)]
ORDERS = ['XYZ', 'XZY', 'YXZ', 'YZX', 'ZXY', 'ZYX']


def tilted_bar(tilt, order='XYZ'):
    """(object, empty): a bar that was bound while its empty was rotated by these Euler angles."""
    positions, triangles = bar_mesh()
    z = positions[:, 2]
    ob = make("Bar", positions, triangles, z > FREE[0] + 1e-6, z > FREE[1] - 1e-6, (0, 0, HEIGHT))
    empty = target_of(ob)
    empty.rotation_mode, empty.rotation_euler = order, tilt
    update()
    return bind(ob), empty


def otherwise(empty):
    """Gives the empty the other triple of Euler angles of its rotation."""
    middle = 'XYZ'.index(empty.rotation_mode[1])
    angles = [angle - math.copysign(math.pi, angle) for angle in empty.rotation_euler]
    angles[middle] = math.copysign(math.pi, empty.rotation_euler[middle]) - empty.rotation_euler[middle]
    empty.rotation_euler = angles
    update()


@pytest.mark.parametrize('order', ORDERS)
@pytest.mark.parametrize('tilt', [(0, 0, 0), *TILTS])
def test_the_other_angles_of_a_rotation_turn_nothing(tilt, order):
    ob, empty = tilted_bar(tilt, order)
    before = empty.matrix_world.copy()
    otherwise(empty)
    assert np.abs(np.subtract(empty.matrix_world, before)).max() < 1e-5
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5


@pytest.mark.parametrize('tilt', [(0, 0, 0), *TILTS])
def test_other_angles_beyond_half_a_turn_turn_nothing(tilt):
    """(x + π, π − y, z + π), the same rotation, by angles beyond those that a matrix is decomposed into."""
    ob, empty = tilted_bar(tilt)
    x, y, z = empty.rotation_euler
    empty.rotation_euler = (x + math.pi, math.pi - y, z + math.pi)
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5


@pytest.mark.parametrize('tilt', TILTS)
def test_parented_and_freed_with_its_place_kept_nothing_moves(tilt):
    ob, empty = tilted_bar(tilt)
    parent = add_empty("Parent", (1, 2, 3))
    parent.rotation_euler = (0.3, 0, 0.4)
    update()
    activate(parent)
    empty.select_set(True)
    assert bpy.ops.object.parent_set(type='OBJECT', keep_transform=True) == {'FINISHED'}
    update()
    assert empty.parent == parent and np.abs(evaluated(ob) - own(ob)).max() < 1e-4
    activate(empty)
    assert bpy.ops.object.parent_clear(type='CLEAR_KEEP_TRANSFORM') == {'FINISHED'}
    update()
    assert empty.parent is None and np.abs(evaluated(ob) - own(ob)).max() < 1e-4


@pytest.mark.parametrize('tilt', TILTS)
def test_a_matrix_turns_a_tilted_empty_like_one_without_a_tilt(tilt):
    """By 0.6 rad, 34 degrees, about the bar."""
    shapes = []
    for angles in ((0, 0, 0), tilt):
        ob, empty = tilted_bar(angles)
        turned = Matrix.Rotation(0.6, 4, 'Z') @ Euler(angles).to_matrix().to_4x4()
        empty.matrix_world = Matrix.Translation(empty.matrix_world.translation) @ turned
        update()
        shapes.append(evaluated(ob))
    assert np.abs(shapes[1] - shapes[0]).max() < 1e-4


@pytest.mark.parametrize('degrees', [-720, -360, 340, 360, 720])
@pytest.mark.parametrize('told_otherwise', [False, True])
def test_whole_turns_of_an_euler_angle_count(degrees, told_otherwise):
    """Starting from either of the two triples of Euler angles of the rest rotation."""
    ob, empty = tilted_bar((0.4, 0.2, 0.5))
    if told_otherwise:
        otherwise(empty)
    empty.rotation_euler.z += math.radians(degrees)
    empty.keyframe_insert('rotation_euler')
    update()
    rate, turned = largest_rate(evaluated(ob))
    assert turned == pytest.approx(degrees, abs=1) and rate <= 1.5, (turned, rate)


@pytest.mark.parametrize('of_rest, now', [('XYZ', 'ZXY'), ('YXZ', 'XYZ'), ('QUATERNION', 'XYZ'), ('AXIS_ANGLE', 'ZYX')])
@pytest.mark.parametrize('tilt', TILTS)
def test_another_rotation_mode_turns_nothing(of_rest, now, tilt):
    ob, empty = tilted_bar((0, 0, 0))
    empty.rotation_mode = of_rest
    place = Matrix.Translation(empty.location) @ Euler(tilt).to_matrix().to_4x4()
    empty.matrix_world = place
    update()
    bpy.ops.object.detail_deform_unbind()
    bind(ob)
    empty.rotation_mode = now
    empty.matrix_world = place  # with another order, Blender keeps the angles and not the rotation
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-4


@pytest.mark.parametrize('mode', ['QUATERNION', 'AXIS_ANGLE', 'ZYX'])
def test_back_to_rest_puts_back_an_empty_whose_rotation_mode_was_changed(mode):
    ob, empty = tilted_bar((0.4, 0.2, 0.5))
    place = np.array(empty.matrix_world)
    empty.rotation_mode = mode
    empty.matrix_world = Matrix.Translation((0, 0, 1)) @ Matrix.Rotation(0.6, 4, 'Z') @ empty.matrix_world
    update()
    activate(ob)
    assert bpy.ops.object.detail_deform_handle_reset(everything=True) == {'FINISHED'}
    update()
    assert np.allclose(empty.matrix_world, place, atol=1e-5)
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-4


def test_turns_by_channels_have_no_jumps(part):
    """The rotation vector is a continuous function of the Euler angles, up to nearly half a turn in two or three angles
    from random rest angles."""
    rng = np.random.default_rng(7)
    channel_turns = part('scene.euler_angles').channel_turns
    for _ in range(200):
        rest, along = rng.uniform(-np.pi, np.pi, 3), rng.normal(size=3)
        along[rng.integers(3)] *= rng.integers(2)
        way = np.linspace(0, 0.8 * np.pi, 60)[:, None] * along / np.linalg.norm(along)
        turned = np.array([channel_turns(rest + step, rest, 'XYZ') for step in way])
        assert np.abs(np.diff(turned, axis=0)).max() < 0.1, (rest, along)
