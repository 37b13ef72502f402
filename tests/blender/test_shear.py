# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources and targets whose world matrix scales their axes differently, shears or mirrors: a transfer goes by the
shapes in the world."""

import bpy
import numpy as np
import pytest

from conftest import activate, add_empty, evaluated, group, own, update
from test_mirror_images import glove, set_own, twisted
from test_transfer import add_key, coordinates

transfer = bpy.ops.object.detail_deform_transfer
live = bpy.ops.object.detail_deform_transfer_live

PARENTS = {'SHEARED': ((1, 3, 0.8), 1), 'SHEARED_AND_MIRRORED': ((1, 2, 0.7), -1), 'TURNED': ((1, 1, 1), 1),
           'ONLY_LARGER': ((2.5, 2.5, 2.5), 1)}


def sheared(ob, kind):
    """Gives an object a scaled and rotated parent, and rotates it; returns the linear part of its world matrix,
    (3, 3)."""
    scale, sign = PARENTS[kind]
    parent = add_empty(f"Parent of {ob.name}", (1, -2, 0.5))
    parent.scale, parent.rotation_euler = scale, (0.2, -0.4, 1.0)
    ob.parent = parent
    ob.rotation_euler, ob.location, ob.scale = (0.5, 0.3, -0.7), (0.2, 0.1, 3), (sign, 1, 1)
    update()
    return np.array(ob.matrix_world, float)[:3, :3]


def seen(ob, positions):
    """Local positions in the world, without the object's location."""
    return positions @ np.array(ob.matrix_world, float)[:3, :3].T


def in_place(positions):
    return positions - positions.mean(0)


@pytest.mark.parametrize('kind', PARENTS)
def test_a_source_in_a_sheared_space(kind):
    source, target = glove("Source"), glove("Target")
    rest, pose = own(target), twisted(own(target))
    into = np.linalg.inv(sheared(source, kind)).T
    set_own(source, rest @ into)
    add_key(source, "Bend", pose @ into)
    activate(target)
    transfer(source="Source", what='ALL_KEYS')
    found = coordinates(target.data.shape_keys.key_blocks["Bend"])
    assert np.abs(in_place(found) - in_place(pose)).max() < 1e-4


@pytest.mark.parametrize('kind', PARENTS)
def test_a_target_in_a_sheared_space(kind):
    source, target = glove("Source"), glove("Target")
    rest, pose = own(source), twisted(own(source))
    set_own(target, rest @ np.linalg.inv(sheared(target, kind)).T)
    key = add_key(source, "Bend", pose)
    activate(target)
    transfer(source="Source", what='ALL_KEYS')
    made = target.data.shape_keys.key_blocks["Bend"]
    assert np.abs(in_place(seen(target, coordinates(made))) - in_place(pose)).max() < 1e-4
    # The same for live transfer, while the target's parent moves.
    target.shape_key_clear()
    target.detail_deform.transfer.source = source
    assert live() == {'FINISHED'}
    target.parent.location = (5, 6, 7)
    for value in (0.4, 1.0):
        key.value = value
        update()
        assert np.abs(in_place(seen(target, evaluated(target))) - in_place(evaluated(source))).max() < 1e-3


def test_both_in_different_sheared_spaces():
    """Their local spaces differ, but in the world they look alike, and are deformed alike."""
    source, target = glove("Source"), glove("Target")
    rest, pose = own(source), twisted(own(source))
    into = np.linalg.inv(sheared(source, 'SHEARED')).T
    set_own(source, rest @ into)
    add_key(source, "Bend", pose @ into)
    target.parent = source.parent
    target.rotation_euler, target.scale = (-0.3, 1.0, 0.2), (1, 0.5, -2)
    update()
    set_own(target, rest @ np.linalg.inv(np.array(target.matrix_world, float)[:3, :3]).T)
    activate(target)
    transfer(source="Source", what='ALL_KEYS')
    found = coordinates(target.data.shape_keys.key_blocks["Bend"])
    assert np.abs(in_place(seen(target, found)) - in_place(pose)).max() < 1e-4


def test_objects_are_matched_in_their_proportions_in_the_world(part):
    """A mesh that its object scales along y by 3 fits one whose own vertices are scaled so."""
    proportions = part('scene.proportions')
    source, target = glove("Source", 21), glove("Target", 31)
    rest = own(target)
    set_own(source, own(source) / (1, 3, 0.8))
    source.scale = (1, 3, 0.8)
    for number, (x, y) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1)), 1):
        for ob, n in ((source, 20), (target, 30)):
            group(ob, f"Marker {number}", [x * n * (n + 1) + y * n])
    update()
    assert np.allclose(proportions.of(source), np.diag([1 / 3, 1, 0.8 / 3]), atol=1e-6)
    add_key(source, "Bend", twisted(own(source) * (1, 3, 0.8)) / (1, 3, 0.8))
    activate(target).detail_deform.transfer.source = source
    bpy.ops.object.detail_deform_transfer_match()
    kept = np.array(target.data['detail_deform_match']['arrays']['confidence'])
    assert kept.min() > 0.5
    transfer(what='ALL_KEYS', correspondence='STORED')
    found = coordinates(target.data.shape_keys.key_blocks["Bend"])
    assert np.abs(in_place(found) - in_place(twisted(rest))).max() < 0.02


@pytest.mark.parametrize('scale', [(0, 0, 0), (1, 1, 0), (1e-5, 1, 1), (-1, 1, 1), (float('inf'), 1, 1), (7, 7, 7)])
def test_proportions_have_an_inverse(part, scale):
    proportions = part('scene.proportions')
    ob = glove("Source", 5)
    for turn in (0.0, 0.3, 1.1, 2.9):
        ob.rotation_euler, ob.scale = (turn, 2 * turn, 0), scale
        update()
        found = proportions.of(ob)
        assert np.isfinite(np.linalg.inv(found)).all() and np.allclose(found, found.T, atol=1e-6)
        # Independent of the object's rotation.
        ob.rotation_euler = (0, 0, turn)
        update()
        if np.isfinite(scale).all():
            assert np.allclose(proportions.of(ob), found, atol=1e-5)
    assert scale != (7, 7, 7) or np.array_equal(proportions.of(ob), np.eye(3))
