# SPDX-License-Identifier: GPL-3.0-or-later
"""Turns beside the simple one about a single channel: tilted ones, mirrored objects and handles, handles that turn
against each other or all together."""

import math

import numpy as np
import pytest
from mathutils import Matrix

from conftest import add_empty, add_handle, bind, evaluated, group, members, own, update
from test_shape import FREE, HEIGHT, bar_mesh, largest_rate, make, make_bar, target_of, turn


def largest_jump(ob, values, set_to):
    """The largest move of a vertex from one value to the next, as a share of the largest one of a held vertex."""
    held = np.any([members(ob, handle.vertex_group) for handle in ob.detail_deform.handles], axis=0)
    seen = []
    for value in values:
        set_to(value)
        update()
        seen.append(evaluated(ob))
    steps = np.linalg.norm(np.diff(seen, axis=0), axis=2)
    return (steps.max(1) / steps[:, held].max(1)).max()


def by_two():
    """A bar with a handle at each end and nothing that is fixed, and the empties of its upper and its lower end."""
    positions, triangles = bar_mesh()
    z = positions[:, 2]
    ob = make("Bar", positions, triangles, z > FREE[0] + 1e-6, z > FREE[1] - 1e-6, (0, 0, HEIGHT))
    group(ob, 'low', np.flatnonzero(z < FREE[0] + 1e-6))
    add_handle(ob, 'low', add_empty("Low", (0, 0, 0)))
    ob.detail_deform.region = ''
    return ob, *(handle.target for handle in ob.detail_deform.handles)


def test_the_other_way_is_the_mirror_image():
    ob = make_bar(*bar_mesh())
    rates = [largest_rate(turn(ob, degrees)) for degrees in (360, -360)]
    assert rates[1][1] == pytest.approx(-360, abs=1) and rates[0][0] == pytest.approx(rates[1][0], abs=0.01)


@pytest.mark.parametrize('tilt', [0.1, 5, 20])
def test_a_tilt_takes_no_whole_turn_away(tilt):
    ob = make_bar(*bar_mesh())
    target_of(ob).rotation_euler.x = math.radians(tilt)
    rate, turned = largest_rate(turn(ob, 360))
    assert turned == pytest.approx(360, abs=5) and rate <= 1.5, (turned, rate)


def test_a_tilted_turn_has_no_pop():
    ob = make_bar(*bar_mesh())
    target_of(ob).rotation_euler.x = math.radians(10)
    assert largest_jump(ob, np.linspace(180, 540, 201), lambda degrees: turn(ob, degrees)) <= 3


def test_a_mirrored_object_turns_on_beyond_half_a_turn():
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


def test_a_mirrored_handle_is_no_half_turn():
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


def test_bend_length_without_refinement_says_why_not(part):
    options = part('library.options')
    bend_length = next(option for option in options.SETTINGS if option.name == 'rotation_smoothing')
    ob = make_bar(*bar_mesh())
    ob.detail_deform.refine = 0
    before = turn(ob, 90)
    ob.detail_deform.rotation_smoothing = 0.05
    update()
    assert np.array_equal(evaluated(ob), before)
    assert not options.is_shown(bend_length, ob.detail_deform) or options.why_not(bend_length, ob.detail_deform)
