# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull with Edit Mode's symmetry, across the midline: vertices on the mirror plane stay on it, and both sides deform as
mirror images."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, bind, evaluated, own, pull, symmetric, update

SELECTIONS = {
    'both sides': lambda p, d: d < 0.1,
    'more of one side': lambda p, d: (d < 0.1) & (p[:, 0] > -0.05),
    'the line': lambda p, d: (np.abs(p[:, 0]) < 1e-6) & (d < 0.1),
    'a vertex on it': lambda p, d: d < 0.01,
    'one side with the line': lambda p, d: (p[:, 0] > -1e-6) & (d < 0.1),
    'one side without': lambda p, d: (p[:, 0] > 0.15) & (d < 0.3),
}
MOTIONS = {
    'up': Matrix.Translation((0, 0, 0.2)),
    'aside': Matrix.Translation((0.1, 0.05, 0.2)),
    'turned about the plane': Matrix.Translation((0, 0, 0.1)) @ Matrix.Rotation(0.5, 4, 'X'),
    'turned any way': Matrix.Translation((0.05, 0, 0.1)) @ Matrix.Rotation(0.7, 4, (1, 2, 3)),
    'scaled': Matrix.Translation((0, 0, 0.1)) @ Matrix.Diagonal((1.5, 0.7, 1, 1)),
}


@pytest.fixture
def square():
    ob = symmetric()
    ob.data.use_mirror_x = True
    return ob


def mirrored(ob, vectors):
    """(n, 3): for each vertex the mirror image of its counterpart's vector."""
    p = own(ob)
    number = {tuple(row): k for k, row in enumerate(np.round(p, 5) + 0.0)}
    return vectors[[number[tuple(row)] for row in np.round(p * (-1, 1, 1), 5) + 0.0]] * (-1, 1, 1)


def assert_symmetric(ob):
    moved = evaluated(ob) - own(ob)
    assert np.abs(moved).max() > 0.05
    assert np.abs(moved - mirrored(ob, moved)).max() < 2e-6
    assert np.abs(moved[np.abs(own(ob)[:, 0]) < 1e-6, 0]).max() < 1e-6


def distances(ob):
    return np.linalg.norm(own(ob)[:, :2], axis=1)


@pytest.mark.parametrize('motion', MOTIONS)
@pytest.mark.parametrize('selection', SELECTIONS)
def test_both_sides_are_mirror_images(square, selection, motion):
    chosen = SELECTIONS[selection](own(square), distances(square))
    empty = pull(square, chosen, radius=0.35)
    handles = square.detail_deform.handles
    assert empty == handles[0].target and [h.mirrors for h in handles if not h.symmetric] == (
        ["", handles[0].name] if selection.startswith('one side') else [])
    place = empty.matrix_world.copy()
    empty.matrix_world = place @ MOTIONS[motion]
    update()
    assert_symmetric(square)


def test_whole_turns_about_the_plane(square):
    """Two whole turns about the plane's normal are kept when the motion is made symmetric."""
    square.detail_deform.base_deformer = 'MOTIONS'
    empty = pull(square, distances(square) < 0.1, radius=0.4)
    empty.rotation_euler.x += 4 * np.pi
    empty.location.z += 0.1
    update()
    assert_symmetric(square)
    turned = evaluated(square)
    empty.rotation_euler.x -= 4 * np.pi
    update()
    assert np.abs(evaluated(square) - turned).max() > 0.01


def test_a_second_pull_and_the_next_bind_keep_the_symmetry(square):
    empty = pull(square, SELECTIONS['one side with the line'](own(square), distances(square)), radius=0.35)
    empty.matrix_world = empty.matrix_world @ MOTIONS['turned any way']
    update()
    before = evaluated(square)
    far = np.abs(own(square)[:, 1] - 0.35) + np.abs(own(square)[:, 0]) < 0.08
    second = pull(square, far, radius=0.2)
    assert np.abs(evaluated(square) - before).max() < 1e-4
    second.location.z += 0.1
    update()
    assert_symmetric(square)
    activate(square)
    bpy.context.scene.cursor.location = (0, 0.2, 0.3)
    bpy.ops.object.origin_set(type='ORIGIN_CURSOR')
    update()
    before = evaluated(square)
    bind(square, keep_rest=True)
    assert np.abs(evaluated(square) - before).max() < 1e-4


def test_a_handles_symmetry_can_be_switched_off(square):
    empty = pull(square, distances(square) < 0.1, radius=0.35)
    handle = square.detail_deform.handles[0]
    assert handle.symmetric == {'X'}
    empty.location.x += 0.2
    update()
    assert np.abs(evaluated(square) - own(square)).max() < 1e-6
    handle.symmetric = set()
    update()
    assert np.abs(evaluated(square) - own(square))[:, 0].max() > 0.19


def test_across_two_planes(square):
    square.data.use_mirror_y = True
    empty = pull(square, distances(square) < 0.1, radius=0.35)
    assert square.detail_deform.handles[0].symmetric == {'X', 'Y'}
    empty.matrix_world = empty.matrix_world @ MOTIONS['turned any way']
    update()
    moved = (evaluated(square) - own(square))[distances(square) < 0.1]
    # Symmetric across both planes, the middle can only move along z.
    assert np.allclose(moved, moved[0], atol=1e-6) and np.abs(moved[0, :2]).max() < 1e-6


def test_without_symmetry_nothing_is_held(square):
    square.data.use_mirror_x = False
    empty = pull(square, distances(square) < 0.1, radius=0.35)
    empty.location.x += 0.1
    update()
    assert np.abs(evaluated(square) - own(square))[:, 0].max() > 0.09
