# SPDX-License-Identifier: GPL-3.0-or-later
"""A drag on a heavy mesh shows a quick result with fewer refinement passes, and the whole result when it pauses.
Scripts, frames and renders get the whole result alone."""

import time

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, bind, evaluated, make_strip, members, own, update


@pytest.fixture
def heavy(part, as_in_a_window):
    """A bound strip in a window, for which the add-on believes that a whole update takes a second."""
    as_in_a_window('follow.lifecycle')
    ob = bind(make_strip())
    part('follow.handle_follower').cache.find(ob.detail_deform.signature).full_ms = 1000.0
    yield ob
    part('session').ended(part('session').Until.DISABLED)


def bend(ob, turn):
    """Moves the handle as a script does, without a turn of the window's event loop before."""
    target = ob.detail_deform.handles[0].target
    target.rotation_euler.y = turn
    target.location.z = 0.3
    update()
    return evaluated(ob)


@pytest.fixture
def drag(part):
    """drag(ob, turn): as bend(), but in the midst of a drag in the window."""
    def to(ob, turn):
        part('follow.drag').updated()
        part('follow.drag')._tick()
        return bend(ob, turn)
    return to


def whole(part, ob, turn=-1.2, refine=None):
    """The shape that bend() gives with all passes that the settings ask for, or as many as `refine` says, by a deformer
    of the library that is made here."""
    native, look = part('library.native'), part('follow.update_options')
    rest, held, fixed = own(ob), members(ob, 'right'), ~members(ob, 'region')
    roles = np.where(held, 0, np.where(fixed, native.ROLE_FIXED, native.ROLE_FREE)).astype(np.int32)
    deformer = native.Bind(rest.astype(np.float32), part('scene.mesh_data').triangles(ob.data), roles, 1).finish()
    pivot = Matrix.Translation((1, 0.5, 0))
    motion = Matrix.Translation((0, 0, 0.3)) @ pivot @ Matrix.Rotation(turn, 4, 'Y') @ pivot.inverted()
    asked = {**look.arguments(ob.detail_deform), 'turns': np.array([[0, turn, 0]])}
    if refine is not None:
        asked['refine'] = refine
    shape = rest + deformer.offsets(np.array(motion)[None, :3], **asked).reshape(-1, 3)
    assert np.abs(shape - rest @ np.array(motion)[:3, :3].T - np.array(motion)[:3, 3])[held].max() < 1e-5
    assert (shape == rest)[fixed].all()
    return shape


def slow_results_under_way(part, ob):
    return part('follow.slow_results').progress(part('scene.offset_attribute').token(ob.data)) is not None


def test_a_drag_shows_the_quick_result_and_then_the_whole_one(part, heavy, drag):
    quick = drag(heavy, -1.2)
    assert slow_results_under_way(part, heavy)
    assert heavy.detail_deform.status.startswith("Bound") and "quick" not in heavy.detail_deform.status
    part('follow.lifecycle').settle(heavy)
    update()
    arrived = evaluated(heavy)
    assert np.abs(arrived - quick).max() > 1e-3
    assert np.abs(arrived - whole(part, heavy)).max() < 1e-5
    assert np.abs(quick - whole(part, heavy, refine=0)).max() < 1e-5


def test_as_many_passes_as_there_is_time_for(part):
    look = part('follow.update_options')
    told = {'method': 'TRANSFER', 'refine': 4, 'steps': 1}
    assert [look.quick(told, share)['refine'] for share in (1.0, 0.9, 0.5, 0.1)] == [4, 3, 1, 0]
    assert 'refine' not in look.quick({'method': 'NORMAL'}, 0.1)


def test_the_whole_result_starts_when_the_drag_pauses(part, heavy, drag):
    drag(heavy, -1.2)
    slow_results = part('follow.slow_results')
    slow_results._tick()
    assert slow_results_under_way(part, heavy)
    deadline = time.monotonic() + 20
    while slow_results_under_way(part, heavy) and time.monotonic() < deadline:
        time.sleep(0.05)
        slow_results._tick()
    update()
    arrived = evaluated(heavy)
    assert np.abs(arrived - whole(part, heavy)).max() < 1e-5


@pytest.mark.parametrize('times', [1, 3])
def test_scripts_get_the_whole_result(part, heavy, times):
    for number in range(times):
        moved = bend(heavy, -1.2 - 0.1 * number)
        assert not slow_results_under_way(part, heavy)
        assert np.abs(moved - whole(part, heavy, -1.2 - 0.1 * number)).max() < 1e-5
        part('follow.handle_follower').cache.find(heavy.detail_deform.signature).full_ms = 1000.0


def test_a_light_mesh_is_shown_whole(part, heavy, drag):
    part('follow.handle_follower').cache.find(heavy.detail_deform.signature).full_ms = 20.0
    moved = drag(heavy, -1.2)
    assert not slow_results_under_way(part, heavy)
    assert np.abs(moved - whole(part, heavy)).max() < 1e-5


def test_a_dense_mesh_is_shown_whole_because_its_passes_cost_nothing(part, drag, as_in_a_window):
    as_in_a_window('follow.lifecycle')
    ob = bind(make_strip(180))
    entry = part('follow.handle_follower').cache.find(ob.detail_deform.signature)
    assert 1000 < entry.made.info.coarse_vertex_count < 0.6 * entry.made.info.free_count
    entry.full_ms = 1000.0
    moved = drag(ob, -1.2)
    assert not slow_results_under_way(part, ob)
    assert np.abs(moved - whole(part, ob)).max() < 1e-5
    part('session').ended(part('session').Until.DISABLED)


def test_a_drag_ends_when_nothing_has_moved_for_a_while(part, heavy):
    module = part('follow.drag')
    module.updated()
    assert module._tick() and module.share(1000.0) == 0.05
    for _ in range(100):
        if not module._tick():
            break
    assert module.share(1000.0) == 1.0


def test_undo_ends_a_drag(part, heavy, drag):
    drag(heavy, -1.2)
    part('session').ended(part('session').Until.REPLACED)
    assert not bpy.app.timers.is_registered(part('follow.drag')._tick)  # or it would go on
    assert part('follow.drag').share(1000.0) == 1.0


def test_a_frame_shows_the_whole_result_also_where_nothing_has_moved_since(part, heavy, drag):
    quick = drag(heavy, -1.2)
    bpy.context.scene.frame_set(2)
    shown = evaluated(heavy)
    assert np.abs(shown - quick).max() > 1e-3
    assert np.abs(shown - whole(part, heavy)).max() < 1e-5


def test_a_saved_file_has_the_whole_result(part, heavy, drag, tmp_path):
    quick = drag(heavy, -1.2)
    path = str(tmp_path / 'dragged.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    offsets = part('scene.offset_attribute')
    with bpy.data.libraries.load(path) as (_, found):
        found.meshes = [heavy.data.name]
    saved = offsets.read(found.meshes[0])
    shown = evaluated(heavy)
    assert np.abs(shown - quick).max() > 1e-3
    assert np.abs(shown - whole(part, heavy)).max() < 1e-5
    assert np.abs(saved - offsets.read(heavy.data)).max() < 1e-6


def test_another_update_leaves_the_whole_result_under_way(part, heavy, drag):
    quick = drag(heavy, -1.2)
    part('follow.drag').ended()
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Other", None))
    update()
    assert slow_results_under_way(part, heavy)
    assert np.abs(evaluated(heavy) - quick).max() < 1e-6


@pytest.fixture
def expected(part, heavy, drag):
    """The whole result, while the quick one of the same pose is shown."""
    drag(heavy, -1.0)
    expected = whole(part, heavy)
    assert np.abs(drag(heavy, -1.2) - expected).max() > 1e-3
    return expected


def test_a_change_that_asks_for_bind_leaves_the_whole_result(part, heavy, expected):
    heavy.detail_deform.smoothness = 3
    part('follow.lifecycle').compare(heavy)
    update()
    assert heavy.detail_deform.stale
    assert np.abs(evaluated(heavy) - expected).max() < 1e-5


def test_a_pull_right_after_a_drag_starts_from_the_whole_result(part, heavy, expected):
    activate(heavy)
    bpy.ops.object.mode_set(mode='EDIT')
    part('follow.slow_results')._tick()
    bpy.ops.mesh.select_all(action='DESELECT')
    bpy.ops.object.mode_set(mode='OBJECT')
    heavy.data.vertices[len(heavy.data.vertices) // 2].select = True
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.object.detail_deform_pull()
    update()
    assert np.abs(evaluated(heavy) - expected).max() < 1e-4


def test_a_render_shows_the_whole_result(part, heavy, drag, monkeypatch):
    quick = drag(heavy, -1.2)
    life = part('follow.lifecycle')
    monkeypatch.setattr(life, 'must_wait', lambda depsgraph: True)
    life.refresh(heavy, bpy.context.evaluated_depsgraph_get())
    update()
    shown = evaluated(heavy)
    assert np.abs(shown - quick).max() > 1e-3
    assert np.abs(shown - whole(part, heavy)).max() < 1e-5


def test_apply_takes_the_whole_result(part, heavy, drag):
    drag(heavy, -1.2)
    expected = whole(part, heavy)
    bpy.ops.object.detail_deform_apply(mode='MESH')
    assert np.abs(own(heavy) - expected).max() < 1e-5


# ---- binding in a window

def test_the_first_update_is_prepared_with_the_binding(part, as_in_a_window):
    as_in_a_window('follow.lifecycle')
    ob = make_strip(120)  # large enough for each stage to be seen by the loop below
    part('follow.binding').bind(ob, bpy.context.evaluated_depsgraph_get(), wait=False, keep_rest=False)
    cache, stages = part('follow.handle_follower').cache, set()
    while cache.poll(ob.detail_deform.signature):
        stages.add(cache.under_way(ob.detail_deform.signature).progress()[2])
    assert "preparing the first update" in stages
    part('follow.lifecycle')._poll()
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    moved = bend(ob, -1.2)
    assert np.abs(moved - whole(part, ob)).max() < 1e-5
    part('session').ended(part('session').Until.DISABLED)


@pytest.mark.parametrize('when', ["", "preparing the first update"])
def test_a_bind_can_be_cancelled_in_either_half(part, as_in_a_window, when):
    as_in_a_window('follow.lifecycle')
    ob = make_strip(120)
    binding, cache = part('follow.binding'), part('follow.handle_follower').cache
    binding.bind(ob, bpy.context.evaluated_depsgraph_get(), wait=False, keep_rest=False)
    content = ob.detail_deform.signature
    while when and cache.under_way(content).progress()[2] != when:
        pass
    binding.cancel(ob)
    while cache.poll(content):
        pass
    part('follow.lifecycle')._poll()
    assert not ob.detail_deform.is_bound and "ancelled" in ob.detail_deform.status, ob.detail_deform.status
    assert cache.find(content) is None
    part('session').ended(part('session').Until.DISABLED)
