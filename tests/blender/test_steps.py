# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps: large motions are split into several updates. In background mode the result is there at once."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, bind, evaluated, make_strip, own, update


@pytest.fixture
def strip():
    return bind(make_strip())


def bend(ob, degrees):
    """Turns the right side along an arc about an axis parallel to y."""
    target = ob.detail_deform.handles[0].target
    pivot = Matrix.Translation((0.5, 0, 0.3))
    rest = Matrix.Translation((1, 0.5, 0))
    target.matrix_world = pivot @ Matrix.Rotation(math.radians(degrees), 4, 'Y') @ pivot.inverted() @ rest
    update()


def test_steps_change_a_large_bend_and_the_status_names_them(strip):
    bend(strip, -120)
    quick = evaluated(strip)
    strip.detail_deform.steps = 6
    update()
    stepped = evaluated(strip)
    assert np.isfinite(stepped).all() and np.abs(stepped - quick).max() > 0.01
    assert 'The result in 6 steps is shown' in strip.detail_deform.status
    strip.detail_deform.steps = 1
    update()
    assert np.array_equal(evaluated(strip), quick)
    assert 'steps' not in strip.detail_deform.status


def test_the_handle_arrives_and_the_rest_shape_is_kept(strip):
    strip.detail_deform.steps = 4
    update()
    assert np.abs(evaluated(strip) - own(strip)).max() < 1e-6
    bend(strip, -100)
    moved = evaluated(strip)
    target = strip.detail_deform.handles[0].target
    motion = np.array(target.matrix_world @ Matrix.Translation((1, 0.5, 0)).inverted())
    columns = np.repeat(np.arange(25), 25)
    expected = own(strip) @ motion[:3, :3].T + motion[:3, 3]
    assert np.abs((moved - expected)[columns >= 22]).max() < 1e-5
    assert np.abs((moved - own(strip))[columns < 3]).max() == 0
    bend(strip, 0)
    assert np.abs(evaluated(strip) - own(strip)).max() < 1e-5


def test_whole_turns_of_an_euler_rotation_count():
    strip = make_strip()
    narrow = own(strip)
    narrow[:, 1] = 0.5 + 0.15 * (narrow[:, 1] - 0.5)
    narrow[:, 2] *= 0.2
    strip.data.vertices.foreach_set('co', narrow.astype(np.float32).ravel())
    bind(strip)
    strip.detail_deform.steps = 8
    target = strip.detail_deform.handles[0].target
    target.rotation_euler.x = 2 * math.pi
    update()
    wound = evaluated(strip)
    # The strip's columns are twisted from one to the next, by a whole turn in all.
    across = wound.reshape(25, 25, 3)[:, -1] - wound.reshape(25, 25, 3)[:, 0]
    angles = np.unwrap(np.arctan2(across[:, 2], across[:, 1]))
    assert abs(angles[-1] - angles[0] - 2 * math.pi) < 0.02
    assert (np.diff(angles) > -0.02).all()
    target.rotation_euler.x = 0
    update()
    assert np.abs(evaluated(strip) - own(strip)).max() < 1e-5


def test_a_motion_that_cannot_be_split_is_named(strip):
    strip.detail_deform.steps = 3
    strip.detail_deform.handles[0].target.scale = (-1, 1, 1)
    update()
    assert "can't be split" in strip.detail_deform.status
    strip.detail_deform.handles[0].target.scale = (1, 1, 1)
    update()
    assert 'Bound' in strip.detail_deform.status


def test_apply_takes_the_result_in_steps(strip):
    bend(strip, -120)
    strip.detail_deform.steps = 5
    update()
    stepped = evaluated(strip)
    assert bpy.ops.object.detail_deform_apply(mode='MESH') == {'FINISHED'}
    assert np.abs(own(activate(strip)) - stepped).max() < 1e-6


def test_steps_arrive_when_the_handles_pause(strip, part, as_in_a_window):
    """In a window the quick result comes first, then the steps by a timer, for the last pose alone."""
    slow_results, token = part('follow.slow_results'), part('scene.offset_attribute').token
    as_in_a_window('follow.lifecycle')
    strip.detail_deform.steps = 5
    bend(strip, -60)
    quick = evaluated(strip)
    assert 'quick result' in strip.detail_deform.status
    bend(strip, -120)
    quick = evaluated(strip)
    assert slow_results.progress(token(strip.data)) == 0.0
    slow_results._requests[token(strip.data)].due = 0
    while slow_results._tick():
        assert 'quick result' in strip.detail_deform.status or not slow_results._requests
    update()
    assert np.abs(evaluated(strip) - quick).max() > 0.01
    assert 'The result in 5 steps is shown' in strip.detail_deform.status
    # A cancelled result is started again by Update.
    bend(strip, -110)
    assert bpy.ops.object.detail_deform_bind_cancel() == {'FINISHED'}
    assert slow_results.progress(token(strip.data)) is None
    assert 'press Update' in strip.detail_deform.status
    assert bpy.ops.object.detail_deform_update() == {'FINISHED'}
    assert slow_results.progress(token(strip.data)) == 0.0
    # The steps of a pose that was changed before they were ready are dropped.
    bend(strip, -90)
    slow_results._requests[token(strip.data)].due = 0
    slow_results._tick()
    bend(strip, 0)
    while slow_results._tick():
        pass
    assert np.abs(evaluated(strip) - own(strip)).max() < 1e-5
    slow_results._requests.clear()


def test_a_frame_stops_slow_work_on_its_deformer_which_begins_again_later(strip, part):
    """Two objects with the same content share a deformer: neither waits for the other's slow result."""
    native, slow_results = part('library.native'), part('follow.slow_results')
    deformer = part('follow.handle_follower').cache.find(strip.detail_deform.signature).made
    endless = {'method': 'VOLUMES', 'volume_tolerance': 1e-300, 'volume_iterations': 10**9}

    class Work:
        pause = 0.3

        def __init__(self):
            self.deformer = deformer

        def start(self, wait):
            motion = np.array([[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.4]]])
            return native.Update(deformer, motion, wait=wait, **endless)

        def deliver(self, *_):
            raise AssertionError("it has no end")

        refuse = deliver

        def is_wanted(self):
            return True

        def tell(self):
            pass

    for name in ('first', 'second'):
        slow_results.request(name, Work())
        slow_results._requests[name].due = 0
    slow_results._tick()
    slow_results._tick()  # the second waits for its turn
    assert [bool(slow_results._requests[name].job) for name in ('first', 'second')] == [True, False]
    before = evaluated(strip)
    bend(strip, -40)
    assert np.abs(evaluated(strip) - before).max() > 0.1
    assert [slow_results.progress(name) for name in ('first', 'second')] == [0.0, 0.0]
    slow_results._requests['second'].due = 0
    slow_results._tick()
    assert slow_results._requests['second'].job
    slow_results._requests.clear()


def test_an_empty_with_zero_scale_is_refused_in_steps_and_gives_a_finite_result_in_one(strip):
    strip.detail_deform.steps = 2
    target = strip.detail_deform.handles[0].target
    target.rotation_euler.x = 7
    target.scale = (0, 0, 0)
    update()
    assert "can't be split" in strip.detail_deform.status
    strip.detail_deform.steps = 1
    update()
    assert 'Bound' in strip.detail_deform.status and np.isfinite(evaluated(strip)).all()


def test_a_failure_while_steps_start_is_reported_and_ends_them(strip, part, as_in_a_window, monkeypatch):
    """The timer's function raises nothing, and no request is left."""
    native, slow_results = part('library.native'), part('follow.slow_results')

    def fail(*_, **options):
        raise native.NativeError("There is no memory left.")

    monkeypatch.setattr(native.Deformer, 'update', fail)
    as_in_a_window('follow.lifecycle')
    strip.detail_deform.steps = 3
    bend(strip, -60)
    assert len(slow_results._requests) == 1
    for pending in slow_results._requests.values():
        pending.due = 0
    assert slow_results._tick() is None
    assert not slow_results._requests
    assert "no memory left" in strip.detail_deform.status


def test_failed_steps_are_reported_until_a_handle_moves(strip, part, monkeypatch):
    """And not only until the next frame."""
    native = part('library.native')

    def fail(*_, **options):
        raise native.NativeError("There is no memory left.")

    monkeypatch.setattr(native.Deformer, 'update', fail)
    strip.detail_deform.steps = 3
    bend(strip, -60)
    for frame in (2, 3):
        bpy.context.scene.frame_set(frame)
        assert "no memory left" in strip.detail_deform.status
    monkeypatch.undo()
    bend(strip, -50)
    assert 'The result in 3 steps is shown' in strip.detail_deform.status
