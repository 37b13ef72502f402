# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose mixed of examples, kept as a shape key, as keyed sliders and as keyed values of shape keys."""

import re

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import add_empty, add_handle, bind, evaluated, group, own, refusal, update
from rigs import LENGTH, add_handles, at, from_poses, key


@pytest.mark.parametrize('weights_by', ['HANDLES', 'SLIDERS'])
def test_the_displayed_shape_is_saved_as_a_key(rigged, weights_by):
    ob, rig = rigged
    add_handles(ob, rig if weights_by == 'SLIDERS' else None)
    from_poses(frames='KEYS')
    bind(ob)
    settings = ob.detail_deform
    if weights_by == 'SLIDERS':
        settings.weights_by = 'SLIDERS'
        settings.examples[0].weight, settings.examples[1].weight = 0.7, 0.3
    else:
        settings.handles[0].target.matrix_world = Matrix.Translation((1.9, 0, 1)) @ Matrix.Rotation(-0.8, 4, 'Y')
    update()
    shape = evaluated(ob)
    assert np.abs(shape - own(ob)).max() > 0.3
    assert bpy.ops.object.detail_deform_save_key(name="Mixed") == {'FINISHED'}
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5
    assert np.abs(key(ob, "Mixed") - shape).max() < 1e-5
    ob.data.shape_keys.key_blocks["Mixed"].value = 1
    update()
    assert np.abs(evaluated(ob) - shape).max() < 1e-5


def test_found_weights_are_baked(rigged):
    ob, rig = rigged
    bake = bpy.ops.object.detail_deform_bake
    add_handles(ob, rig)
    from_poses(frames='KEYS')
    bind(ob)
    expected = {}
    for frame in (1, 6, 11, 31):
        at(frame)
        expected[frame] = evaluated(ob), [e.found_weight for e in ob.detail_deform.examples]
    at(4)
    assert bake(mode='SLIDERS') == {'FINISHED'}
    assert ob.detail_deform.weights_by == 'SLIDERS' and bpy.context.scene.frame_current == 4
    ob.detail_deform.handles[0].target.parent = None  # it no longer follows the bone
    for frame, (shape, weights) in expected.items():
        at(frame)
        assert np.allclose([e.weight for e in ob.detail_deform.examples], weights, atol=1e-5)
        assert np.abs(evaluated(ob) - shape).max() < 2e-2 * LENGTH
    assert "Only weights that handles ask for" in refusal(bake, mode='SLIDERS')


def test_found_weights_are_baked_as_values_of_keys(rigged):
    ob, rig = rigged
    add_handles(ob, rig)
    from_poses(frames='KEYS')
    bind(ob)
    at(11)
    bent = evaluated(ob)
    assert bpy.ops.object.detail_deform_bake(mode='KEY_VALUES') == {'FINISHED'}
    update()
    assert np.abs(evaluated(ob) - bent).max() < 1e-2 * LENGTH
    at(1)
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-3 * LENGTH
    for frame in (1, 31):
        at(frame)
        assert "are played in its place" in ob.detail_deform.status
        assert "examples are shown too" not in ob.detail_deform.status
    assert ob.data.shape_keys.key_blocks["Frame 31"].value == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize('mode', ['SLIDERS', 'KEY_VALUES'])
def test_the_difference_that_weights_alone_leave_is_reported(rigged, mode, capfd):
    """The root is held by a resting handle, and weights alone don't hold it."""
    ob, rig = rigged
    add_handles(ob, rig)
    ob.detail_deform.region = ''
    group(ob, 'root', np.flatnonzero(own(ob)[:, 0] < 0.3))
    add_handle(ob, 'root', add_empty("Root", (0, 0, 0)))
    from_poses(frames='KEYS')
    bind(ob)
    shapes = []
    for frame in range(1, 32):
        at(frame)
        shapes.append(evaluated(ob))
    assert bpy.ops.object.detail_deform_bake(mode=mode) == {'FINISHED'}
    said = re.search(r"In frame (\d+) 'Limb' is up to ([\d.]+)% of its size", capfd.readouterr().out)
    off = []
    for frame in range(1, 32):
        at(frame)
        off.append(np.linalg.norm(evaluated(ob) - shapes[frame - 1], axis=1).max())
    size = np.linalg.norm(np.ptp(own(ob), axis=0))
    assert int(said[1]) == 1 + np.argmax(off)
    assert float(said[2]) == pytest.approx(100 * max(off) / size, abs=0.06)


@pytest.mark.parametrize('mode', ['SLIDERS', 'KEY_VALUES'])
def test_weights_that_are_driven_are_not_baked(rigged, mode):
    ob, rig = rigged
    add_handles(ob, rig)
    from_poses(frames='KEYS')
    bind(ob)
    owner = ob.detail_deform.examples[1] if mode == 'SLIDERS' else ob.data.shape_keys.key_blocks["Frame 31"]
    prop = 'weight' if mode == 'SLIDERS' else 'value'
    owner.driver_add(prop).driver.expression = "0.0"
    sentence = refusal(bpy.ops.object.detail_deform_bake, mode=mode)
    assert "'Frame 31'" in sentence and "driver" in sentence
    assert ob.modifiers["Detail Deform"].show_viewport and ob.detail_deform.weights_by == 'HANDLES'
    owner.driver_remove(prop)
    assert bpy.ops.object.detail_deform_bake(mode=mode) == {'FINISHED'}


@pytest.mark.parametrize('mode', ['SLIDERS', 'KEY_VALUES'])
def test_baked_weights_replace_earlier_keyframes(rigged, mode, part, monkeypatch):
    ob, rig = rigged
    add_handles(ob, rig)
    from_poses(frames='KEYS')
    bind(ob)
    at(11)
    expected = [example.found_weight for example in ob.detail_deform.examples]
    owners = ob.detail_deform.examples if mode == 'SLIDERS' else ob.data.shape_keys.key_blocks[1:]
    prop = 'weight' if mode == 'SLIDERS' else 'value'
    for owner in owners:
        for frame, weight in ((5.5, 0.9), (11, 0.1), (50, 0.5)):
            setattr(owner, prop, weight)
            owner.keyframe_insert(prop, frame=frame)
    at(1)
    refreshed, life = [], part('follow.lifecycle')
    refresh = life.refresh
    monkeypatch.setattr(life, 'refresh', lambda *given, **more: (refreshed.append(1), refresh(*given, **more)))
    assert bpy.ops.object.detail_deform_bake(mode=mode) == {'FINISHED'}
    # Two refreshes a frame in each pass over the frames, of which sliders need two, but none for each keyframe.
    assert len(refreshed) < (5 if mode == 'SLIDERS' else 3) * 31
    animation = (ob if mode == 'SLIDERS' else ob.data.shape_keys).animation_data
    for curve in part('scene.actions').curves(animation.action):
        assert [point.co.x for point in curve.keyframe_points] == [*range(1, 32), 50]
    at(11)
    assert [getattr(owner, prop) for owner in owners] == pytest.approx(expected, abs=1e-5)
