# SPDX-License-Identifier: GPL-3.0-or-later
"""While a heavy mesh is being bound in the background, a draft follows the handles."""

import time

import bpy
import numpy as np
import pytest

from conftest import activate, add_empty, add_handle, evaluated, group, make_strip, moved, own, update

SIDE = 230  # vertices along a side: more than _DRAFT_FROM below in all


class Binding:
    """A strip that is being bound in a window. Its bind seems to be running until end()."""

    def __init__(self, part, monkeypatch):
        self.ob, self._part, self._held = make_strip(SIDE), part, True
        monkeypatch.setattr(part('follow.handle_follower'), '_DRAFT_FROM', 10_000)
        bind = part('library.native').Bind
        progress = bind.progress
        monkeypatch.setattr(bind, 'progress',
                            lambda job: (True, 0.4, 'BASE') if self._held else progress(job))
        self.life, self.shown = part('follow.lifecycle'), part('follow.frame_results')
        self.begin()

    def begin(self, keep_rest=False, tries=3000):
        self._held = True
        self._part('follow.binding').bind(self.ob, bpy.context.evaluated_depsgraph_get(), wait=False,
                                          keep_rest=keep_rest)
        self.shown.forget(self.ob.data)  # a draft of an earlier binding
        for _ in range(tries):
            self.life._poll()
            if self.shows_draft():
                return
            time.sleep(0.01)
        raise AssertionError("no draft came")

    def shows_draft(self):
        record = self.shown.by(self.ob.data)
        return record is not None and record.is_draft

    def end(self):
        """Lets the bind end, and waits for it."""
        self._held = False
        for _ in range(3000):
            if self.life._poll() is None:
                return
            time.sleep(0.01)
        raise AssertionError("the bind did not end")

    def bend(self, height=0.4):
        target = self.ob.detail_deform.handles[0].target
        target.rotation_euler.y = -0.7
        target.location.z = height
        update()
        return evaluated(self.ob)

    def whole(self):
        """The bound surface's result for the present pose."""
        self.life.refresh(self.ob, bpy.context.evaluated_depsgraph_get(), force=True)
        update()
        return evaluated(self.ob)


@pytest.fixture
def binding(part, monkeypatch, as_in_a_window):
    as_in_a_window('follow.handle_follower', 'follow.lifecycle')
    made = Binding(part, monkeypatch)
    yield made
    part('session').ended(part('session').Until.DISABLED)


def right(ob):
    group_index = ob.vertex_groups['right'].index
    return np.array([any(g.group == group_index for g in v.groups) for v in ob.data.vertices])


def test_a_draft_follows_until_the_result_takes_its_place(binding):
    ob = binding.ob
    assert moved(ob) < 1e-6 and not ob.detail_deform.is_bound
    draft = binding.bend()
    assert ob.detail_deform.status.endswith(" 28%. Meanwhile a draft follows the handles.")
    held = right(ob)
    target = ob.detail_deform.handles[0].target
    rest = np.array((1, 0.5, 0))
    turned = (own(ob)[held] - rest) @ np.array(target.matrix_world.to_3x3()).T + target.matrix_world.translation
    assert np.abs(draft[held] - turned).max() < 1e-5
    higher = binding.bend(0.6)
    assert np.abs(higher - draft).max() > 0.15
    binding.end()
    assert ob.detail_deform.is_bound and not binding.shows_draft()
    whole = evaluated(ob)
    assert np.abs(whole - binding.whole()).max() < 1e-6
    error = np.linalg.norm(whole - higher, axis=1)
    assert error.mean() < 0.003 and 1e-6 < error.max() < 0.02


def test_a_bind_that_is_cancelled_takes_its_draft_along(binding):
    ob = binding.ob
    binding.bend()
    activate(ob)
    assert bpy.ops.object.detail_deform_bind_cancel() == {'FINISHED'}
    binding.end()
    update()
    assert not ob.detail_deform.is_bound and ob.detail_deform.status == "It was cancelled."
    assert moved(ob) == 0
    binding.bend(0.5)
    assert moved(ob) == 0


def test_unbinding_meanwhile_shows_rest(binding):
    binding.bend()
    activate(binding.ob)
    bpy.ops.object.detail_deform_unbind()
    update()
    assert moved(binding.ob) == 0
    binding.end()
    assert moved(binding.ob) == 0 and binding.ob.detail_deform.status == "Not bound."


@pytest.mark.parametrize('keep', ['apply', 'save_key'])
def test_apply_and_save_key_take_the_whole_result(binding, keep):
    ob = binding.ob
    rest, draft = own(ob), binding.bend()
    binding._held = False
    activate(ob)
    if keep == 'apply':
        bpy.ops.object.detail_deform_apply()
        kept = own(ob)
    else:
        bpy.ops.object.detail_deform_save_key()
        key = ob.data.shape_keys.key_blocks[-1]
        values = np.empty(3 * len(rest), np.float32)
        key.data.foreach_get('co', values)
        kept = values.reshape(-1, 3)
    difference = np.abs(kept - draft).max()
    assert 1e-5 < difference < 0.02
    again = Binding.__new__(Binding)  # for its bend(), on a surface that is bound before it is bent
    again.ob, again.life = make_strip(SIDE, name="Again"), binding.life
    bpy.ops.object.detail_deform_bind(wait=True)
    assert np.abs(kept - again.bend()).max() < 1e-5


@pytest.mark.parametrize('ended', [False, True])
def test_a_handle_that_comes_meanwhile_starts_from_the_whole_result(binding, ended):
    ob = binding.ob
    draft = binding.bend()
    group(ob, 'middle', np.flatnonzero(np.abs(own(ob)[:, 0] - 0.5) < 0.02))
    add_handle(ob, 'middle', add_empty("Middle", (0.5, 0.5, 0.1)))
    update()
    if ended:
        binding.end()
        assert not binding.shows_draft()
    binding._held = False
    activate(ob)
    bpy.ops.object.detail_deform_bind(keep_rest=True, wait=True)
    update()
    assert 1e-5 < np.abs(evaluated(ob) - draft).max() < 0.02
    assert ob.detail_deform.is_bound


def test_a_handle_that_comes_meanwhile_waits_for_the_result(binding):
    ob = binding.ob
    binding.bend()
    group(ob, 'middle', np.flatnonzero(np.abs(own(ob)[:, 0] - 0.5) < 0.02))
    add_handle(ob, 'middle', add_empty("Middle", (0.5, 0.5, 0.1)))
    update()
    bind = binding._part('follow.binding').bind
    with pytest.raises(binding._part('scene.mesh_data').MeshProblem, match="is still being bound"):
        bind(ob, bpy.context.evaluated_depsgraph_get(), wait=False, keep_rest=True)
    assert binding.shows_draft() and ob.detail_deform.signature
    binding.end()
    bind(ob, bpy.context.evaluated_depsgraph_get(), wait=False, keep_rest=True)
    binding.end()
    assert ob.detail_deform.is_bound


def test_a_handle_that_goes_meanwhile_leaves_the_whole_result(binding):
    ob = binding.ob
    group(ob, 'middle', np.flatnonzero(np.abs(own(ob)[:, 0] - 0.5) < 0.02))
    add_handle(ob, 'middle', add_empty("Middle", (0.5, 0.5, 0.1)))
    binding.begin()
    ob.detail_deform.handles[1].target.location.z += 0.1
    draft = binding.bend()
    activate(ob)
    ob.detail_deform.handle_index = 1
    ob.detail_deform.handles.remove(1)
    update()
    binding.end()
    assert not binding.shows_draft()
    assert 1e-5 < np.abs(evaluated(ob) - draft).max() < 0.02
    assert "handles" in ob.detail_deform.status


def test_the_result_waits_for_the_end_of_edit_mode(binding):
    ob = binding.ob
    draft = binding.bend()
    activate(ob)
    bpy.ops.object.mode_set(mode='EDIT')
    binding.end()
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert not binding.shows_draft()
    assert 1e-5 < np.abs(evaluated(ob) - draft).max() < 0.02


def test_where_live_is_off_nothing_moves_by_itself(binding):
    ob = binding.ob
    binding.end()
    ob.detail_deform.live = False
    shown = binding.bend()
    binding.ob.data.vertices[0].co.z -= 0.01  # an edit, so that there is no cached binding for it
    ob.data.update()
    with pytest.raises(AssertionError, match="no draft came"):
        binding.begin(keep_rest=True, tries=100)
    update()
    assert np.abs(evaluated(ob) - shown)[1:].max() < 1e-6
    ob.detail_deform.live = True


def test_a_cancel_leaves_what_the_binding_starts_from(binding):
    ob = binding.ob
    binding.bend()
    binding.end()
    group(ob, 'middle', np.flatnonzero(np.abs(own(ob)[:, 0] - 0.5) < 0.02))
    add_handle(ob, 'middle', add_empty("Middle", (0.5, 0.5, 0.3)))
    start = evaluated(ob)
    binding.begin(keep_rest=True)
    higher = binding.bend(0.6)
    assert np.abs(higher - start).max() > 0.1
    activate(ob)
    bpy.ops.object.detail_deform_bind_cancel()
    binding.bend(0.7)  # a motion must not begin the cancelled bind anew
    binding.end()
    update()
    assert ob.detail_deform.status == "It was cancelled."
    assert np.abs(evaluated(ob) - start).max() < 1e-5


def test_posing_by_example_has_no_draft(binding):
    ob = binding.ob
    draft = binding.bend()
    ob.detail_deform.method = 'EXAMPLES'
    assert np.abs(binding.bend(0.6) - draft).max() == 0
    binding.end()
    assert np.abs(evaluated(ob) - draft).max() > 0.1


def test_a_render_waits_for_the_result(binding, part, monkeypatch):
    ob = binding.ob
    draft = binding.bend()
    binding._held = False
    monkeypatch.setattr(part('follow.lifecycle'), 'must_wait', lambda depsgraph: True)
    update()
    part('follow.lifecycle').refresh(ob, bpy.context.evaluated_depsgraph_get())
    update()
    assert ob.detail_deform.is_bound and not binding.shows_draft()
    assert 1e-5 < np.abs(evaluated(ob) - draft).max() < 0.02


def test_no_draft_is_written_to_a_mesh_that_was_replaced(binding):
    ob = binding.ob
    binding.bend()
    other = bpy.data.meshes.new('Other')
    other.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    ob.data = other
    binding.bend(0.5)
    assert len(ob.data.vertices) == 3 and moved(ob) == 0
    binding.end()
    assert moved(ob) == 0


def test_light_meshes_and_scripts_get_no_draft(part, as_in_a_window):
    bound = part('follow.handle_follower')
    assert not bound._has_draft(10_000_000)
    as_in_a_window('follow.handle_follower')
    assert bound._has_draft(100_000) and not bound._has_draft(99_999)
