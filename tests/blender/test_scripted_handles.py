# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts may change the list of handles without the add-on's operators: no handle is then moved by another's empty."""

import bpy
import numpy as np
import pytest

from conftest import add_empty, add_handle, bind, evaluated, group, make_strip, members, own, update


@pytest.fixture
def strip():
    ob = make_strip()
    group(ob, 'middle', np.flatnonzero(np.abs(own(ob)[:, 0] - 0.5) < 0.05))
    add_handle(ob, 'middle', add_empty("Middle", (0.5, 0.5, 0)))
    bind(ob)
    ob.detail_deform.handles[0].target.location.z += 0.4
    update()
    return ob


def lifted(ob, name):
    return (evaluated(ob) - own(ob))[members(ob, name), 2]


def assert_unchanged(ob):
    assert np.allclose(lifted(ob, 'right'), 0.4, atol=1e-5) and np.allclose(lifted(ob, 'middle'), 0, atol=1e-5)


def nudge(ob):
    ob.detail_deform.handles[0].target.location.x += 0.01
    update()


def test_handles_in_another_order(strip):
    """The change is noticed by its content, so that the binding is valid again when the order is restored."""
    strip.detail_deform.handles.move(0, 1)
    nudge(strip)
    assert_unchanged(strip)
    assert "handles" in strip.detail_deform.status and "Re-bind" in strip.detail_deform.status
    assert not strip.detail_deform.is_bound
    strip.detail_deform.handles[0].target.location.x -= 0.01
    strip.detail_deform.handles.move(0, 1)
    update()
    assert strip.detail_deform.is_bound
    assert_unchanged(strip)
    strip.detail_deform.handles.move(0, 1)
    bind(strip, keep_rest=True)
    assert_unchanged(strip)


def test_a_handle_removed(strip):
    strip.detail_deform.handles.remove(0)
    bpy.context.scene.frame_set(2)
    assert_unchanged(strip)
    assert "handles" in strip.detail_deform.status and "Re-bind" in strip.detail_deform.status
    assert "matri" not in strip.detail_deform.status


def test_all_handles_removed(strip):
    strip.detail_deform.handles.clear()
    bpy.context.scene.frame_set(2)
    assert_unchanged(strip)
    assert "There is no handle" in strip.detail_deform.status


def test_a_handle_added(strip):
    strip.detail_deform.handles.add()
    bpy.context.scene.frame_set(2)
    assert_unchanged(strip)
    assert "has no vertex group" in strip.detail_deform.status
    strip.detail_deform.handles.remove(2)
    bpy.context.scene.frame_set(3)
    assert strip.detail_deform.is_bound and strip.detail_deform.status.startswith("Bound")
