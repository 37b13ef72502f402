# SPDX-License-Identifier: GPL-3.0-or-later
"""Free handles: they give their vertices a place; the vertices keep their shape, and turn as the surface does."""

import math

import bpy
import numpy as np
import pytest

from conftest import activate, add_handle, bind, evaluated, group, members, own, rigid_motion, update
from test_shape import FREE, HEIGHT, bar_mesh, make, make_bar, target_of


def fitted(ob, name):
    """The rotation that is nearest to the motion of a group's vertices, and the largest distance from it."""
    which = members(ob, name)
    rotation, off = rigid_motion(own(ob)[which], evaluated(ob)[which])
    return rotation, np.abs(off).max()


def turned(rotation):
    """The angle of a rotation, in degrees."""
    return math.degrees(math.acos(np.clip((np.trace(rotation) - 1) / 2, -1, 1)))


def stretch(ob, triangles):
    """Mean relative change of the edges' lengths."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    length = [np.linalg.norm(p[edges[:, 0]] - p[edges[:, 1]], axis=1) for p in (own(ob), evaluated(ob))]
    return np.abs(length[1] / length[0] - 1).mean()


@pytest.fixture
def pulled():
    """A bar whose end is moved to a side without being turned."""
    mesh = bar_mesh()
    ob = make_bar(*mesh)
    target_of(ob).location.x += 0.5
    target_of(ob).location.z -= 0.15
    update()
    return ob, mesh[1]


def test_a_free_handle_turns_with_the_limb(pulled):
    ob, triangles = pulled
    hand = ob.detail_deform.handles[0]
    as_told, stiff = evaluated(ob), stretch(ob, triangles)
    assert turned(fitted(ob, hand.vertex_group)[0]) < 0.01
    hand.turns = 'FREE'  # applies without a new Bind
    rotation, miss = fitted(ob, hand.vertex_group)
    assert miss < 1e-5 and turned(rotation) > 25 and rotation[0, 2] > 0, (miss, turned(rotation))
    assert stretch(ob, triangles) < 0.7 * stiff
    # The vertices turn about the empty's place; its own rotation and scale don't matter.
    which = members(ob, hand.vertex_group)
    pivot, place = np.array((0, 0, HEIGHT)), np.array(target_of(ob).location)
    assert np.abs(place + (own(ob)[which] - pivot) @ rotation.T - evaluated(ob)[which]).max() < 1e-5
    free = evaluated(ob)
    target_of(ob).rotation_euler.z = 1
    target_of(ob).scale = 2, 2, 2
    update()
    assert np.abs(evaluated(ob) - free).max() < 1e-6
    target_of(ob).rotation_euler.z, target_of(ob).scale = 0, (1, 1, 1)
    hand.turns = 'TARGET'
    assert np.abs(evaluated(ob) - as_told).max() < 1e-6


@pytest.mark.parametrize('method', ['TRANSFER', 'VARIATIONAL', 'NORMAL', 'GRADIENT', 'EXAMPLES'])
def test_by_any_method_a_limb_at_rest_stays_at_rest(method):
    ob = make_bar(*bar_mesh())
    ob.detail_deform.method = method
    ob.detail_deform.handles[0].turns = 'FREE'
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6
    target_of(ob).location.x += 0.1
    update()
    assert np.isfinite(evaluated(ob)).all() and np.abs(evaluated(ob) - own(ob)).max() > 0.09
    assert 'turns nothing' not in ob.detail_deform.status


def test_update_keeps_the_pose(pulled):
    ob, _ = pulled
    ob.detail_deform.handles[0].turns = 'FREE'
    before = evaluated(ob)
    assert bpy.ops.object.detail_deform_update() == {'FINISHED'}
    assert np.abs(evaluated(ob) - before).max() < 1e-6


def test_a_mirrored_free_handle_turns_as_the_mirror_image():
    positions, triangles = bar_mesh()
    positions = positions - (0, 0, HEIGHT / 2)  # about the origin
    z = positions[:, 2]
    ob = make("Bar", positions, triangles, np.abs(z) > 0.03, z > HEIGHT / 2 - 0.1, (0, 0, HEIGHT / 2))
    group(ob, 'low', np.flatnonzero(z < -HEIGHT / 2 + 0.1))
    add_handle(ob, 'low', None)
    low = ob.detail_deform.handles[1]
    low.mirrors, low.mirror_axis = ob.detail_deform.handles[0].name, 'Z'
    ob.detail_deform.handles[0].turns = 'FREE'
    bind(ob)
    target_of(ob).location.x += 0.2
    update()
    rotations = [fitted(ob, handle.vertex_group)[0] for handle in ob.detail_deform.handles]
    flip = np.diag([1, 1, -1])
    assert turned(rotations[0]) > 10
    # To 1e-2, and not to rounding, because the clusters of the surface by which turns are found are not symmetric.
    assert np.abs(flip @ rotations[0] @ flip - rotations[1]).max() < 1e-2


def test_by_examples_a_hand_that_is_placed_turns_as_the_example_does():
    positions, triangles = bar_mesh()
    ob = make_bar(positions, triangles)
    # The example is the bar bent along an arc by 90 degrees.
    angle = np.clip((positions[:, 2] - FREE[0]) / (FREE[1] - FREE[0]), 0, 1) * math.pi / 2
    radius = (FREE[1] - FREE[0]) / (math.pi / 2)
    arm, rest = radius - positions[:, 0], np.maximum(positions[:, 2] - FREE[1], 0)
    bent = np.stack([radius - arm * np.cos(angle) + np.sin(angle) * rest, positions[:, 1],
                     np.minimum(positions[:, 2], FREE[0]) + arm * np.sin(angle) + np.cos(angle) * rest], -1)
    ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="Bent")
    key.data.foreach_set('co', bent.ravel())
    key.value = 0
    of = ob.detail_deform
    of.method = 'EXAMPLES'
    activate(ob)
    assert bpy.ops.object.detail_deform_examples_from_keys() == {'FINISHED'}
    of.handles[0].turns = 'FREE'
    bind(ob)
    hand = members(ob, of.handles[0].vertex_group)
    target_of(ob).location = np.array(target_of(ob).location) + (bent - positions)[hand].mean(0)
    update()
    assert of.examples[0].found_weight == pytest.approx(1, abs=0.02)
    assert np.abs(evaluated(ob) - bent).max() < 0.01
