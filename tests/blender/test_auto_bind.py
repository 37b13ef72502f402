# SPDX-License-Identifier: GPL-3.0-or-later
"""An object whose mesh, settings or handles have changed since Bind is bound again automatically, where binding is
quick."""

import bpy
import numpy as np
import pytest

from conftest import activate, add_from, bind, evaluated, make_strip, own, refusal, update


@pytest.fixture
def tick(part, as_in_a_window):
    """tick() does the timer's work; returns whether the timer was registered."""
    as_in_a_window('follow.auto_bind')
    module = part('follow.auto_bind')

    def call():
        waiting = bpy.app.timers.is_registered(module._bind_again)
        module._timer.stop()
        if waiting:
            module._bind_again()
            part('follow.lifecycle').wait(bpy.context.active_object, bpy.context.evaluated_depsgraph_get())
            update()
        return waiting

    yield call
    module._timer.stop()


def posed():
    ob = bind(make_strip())
    ob.detail_deform.handles[0].target.location.z += 0.3
    update()
    return ob


def raise_one(ob, vertex=300):
    ob.data.vertices[vertex].co.z += 0.02
    ob.data.update()
    update()


def test_an_edited_mesh_is_bound_again_with_its_pose(tick):
    ob = posed()
    raise_one(ob)
    assert "were moved since Bind" in ob.detail_deform.stale
    assert tick()
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    moved = evaluated(ob) - own(ob)
    assert np.allclose(moved[-1], (0, 0, 0.3), atol=1e-5)
    assert not tick()  # and no second time


def test_changed_settings_or_handles_are_bound_again(tick):
    ob = posed()
    ob.detail_deform.smoothness = 1
    assert tick() and ob.detail_deform.is_bound
    before = evaluated(ob)
    add_from(ob, (own(ob)[:, 0] > 0.4) & (own(ob)[:, 0] < 0.5))
    update()
    assert tick() and ob.detail_deform.is_bound
    assert np.abs(evaluated(ob) - before).max() < 1e-5


@pytest.mark.parametrize('why', ['off', 'not live', 'slow'])
def test_nothing_is_bound_again_when_off_not_live_or_slow(tick, part, monkeypatch, why):
    ob = posed()
    if why == 'slow':
        monkeypatch.setattr(part('follow.auto_bind'), '_LIMIT_SECONDS', 0)
    else:
        setattr(ob.detail_deform, {'off': 'auto_bind', 'not live': 'live'}[why], False)
    raise_one(ob)
    tick()
    assert "were moved since Bind" in ob.detail_deform.stale and not ob.detail_deform.is_bound


def test_in_the_midst_of_a_change_nothing_is_lost(tick):
    """While a handle has no vertices the object can't be bound, and its status says so; it is bound again when the
    handle has vertices."""
    ob = posed()
    group = ob.vertex_groups['right']
    members = [v.index for v in ob.data.vertices if v.groups and any(g.group == group.index for g in v.groups)]
    group.remove(members)
    ob.data.update()
    update()
    tick()
    assert ob.detail_deform.signature and not ob.detail_deform.is_bound
    assert "'right'" in ob.detail_deform.status
    group.add(members[:30], 1.0, 'REPLACE')
    ob.data.update()
    update()
    assert tick() and ob.detail_deform.is_bound, ob.detail_deform.status


def test_without_a_window_scripts_have_to_bind_again(part):
    ob = posed()
    raise_one(ob)
    assert not bpy.app.timers.is_registered(part('follow.auto_bind')._bind_again)
    assert "Re-bind to go on" in ob.detail_deform.status
    activate(ob)
    assert "were moved" in refusal(bpy.ops.object.detail_deform_update)
