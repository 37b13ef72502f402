# SPDX-License-Identifier: GPL-3.0-or-later
"""Every object shows its own shape, also when objects and meshes are renamed, exchanged or copied."""

import bpy
import numpy as np
import pytest

from conftest import activate, bind, evaluated, make_strip, own, update


def handle(ob):
    return ob.detail_deform.handles[0].target


def lifted(ob):
    """The height by which the handle's last vertex is displaced."""
    return evaluated(ob)[-1, 2] - own(ob)[-1, 2]


def lift(ob, height):
    handle(ob).location.z = height


@pytest.fixture
def alike():
    """Two bound objects with the same signature, of which the first is lifted."""
    first, second = bind(make_strip(name="First")), bind(make_strip(name="Second"))
    assert first.detail_deform.signature == second.detail_deform.signature
    lift(first, 0.4)
    update()
    return first, second


def assert_shown(*pairs):
    update()
    for ob, height in pairs:
        assert lifted(ob) == pytest.approx(height, abs=1e-5), ob.name


def test_objects_that_swap_names_and_motions(alike):
    first, second = alike
    first.name, second.name, first.name = "Swap", "First", "Second"
    lift(first, 0.0)
    lift(second, 0.4)
    assert_shown((first, 0.0), (second, 0.4))


def test_a_mesh_copied_from_another_object(alike):
    first, second = alike
    second.data = first.data.copy()
    assert_shown((first, 0.4), (second, 0.0))
    lift(second, 0.2)
    assert_shown((first, 0.4), (second, 0.2))


def test_meshes_that_are_exchanged(alike):
    first, second = alike
    first.data, second.data = second.data, first.data
    assert_shown((first, 0.4), (second, 0.0))


def without_attribute(ob):
    ob.data.attributes.remove(ob.data.attributes['detail_deform_offset'])


def with_a_mesh_never_deformed(ob):
    mesh = ob.data.copy()
    mesh.attributes.remove(mesh.attributes['detail_deform_offset'])
    for name in list(mesh.keys()):
        del mesh[name]
    ob.data = mesh


@pytest.mark.parametrize('emptied', [without_attribute, with_a_mesh_never_deformed])
def test_a_mesh_without_offsets_gets_them_again(alike, emptied):
    first, second = alike
    emptied(first)
    first.update_tag()
    update()
    assert_shown((first, 0.4), (second, 0.0))


def test_a_new_object_under_an_old_name(alike):
    first, second = alike
    heir = first.copy()
    heir.data = second.data.copy()
    bpy.data.objects.remove(first)
    heir.name = "First"
    bpy.context.scene.collection.objects.link(heir)
    assert_shown((heir, 0.4), (second, 0.0))


def test_a_slow_result_goes_to_the_object_that_asked(alike, part, as_in_a_window):
    first, second = alike
    slow_results = part('follow.slow_results')
    as_in_a_window('follow.lifecycle')
    for ob in alike:
        ob.detail_deform.steps = 3
    lift(first, 0.5)
    update()
    assert "quick result" in first.detail_deform.status and "quick result" not in second.detail_deform.status
    handle(first).rotation_euler.y = 2.0
    update()
    first.name, second.name, first.name = "Swap", "First", "Second"
    for pending in slow_results._requests.values():
        pending.due = 0
    while slow_results._tick():
        pass
    update()
    assert "The result in 3 steps is shown" in first.detail_deform.status
    assert "in 3 steps" not in second.detail_deform.status
    assert lifted(second) == pytest.approx(0, abs=1e-6) and lifted(first) > 0.4


def test_a_slow_result_that_nobody_waits_for_ends(alike, part, as_in_a_window):
    first, _ = alike
    slow_results = part('follow.slow_results')
    as_in_a_window('follow.lifecycle')
    first.detail_deform.steps = 3
    lift(first, 0.5)
    update()
    assert slow_results._requests
    bpy.data.objects.remove(first)
    slow_results._tick()
    assert not slow_results._requests


def test_weights_of_examples_are_those_of_the_object(alike):
    """Found weights belong to the object, also after it is renamed."""
    first, second = alike
    for ob in alike:
        bpy.context.view_layer.objects.active = activate(ob)
        ob.shape_key_add(name="Basis")
        key = ob.shape_key_add(name="Up")
        rest = own(ob)
        key.data.foreach_set('co', (rest + np.c_[0 * rest[:, :2], rest[:, :1]]).astype(np.float32).ravel())
        key.value = 0.0
        bpy.ops.object.detail_deform_examples_from_keys()
        ob.detail_deform.method = 'EXAMPLES'
        bind(ob, keep_rest=True)
    lift(first, 0.9)
    update()
    found = [ob.detail_deform.examples[0].found_weight for ob in alike]
    assert found[0] > 0.5 and abs(found[1]) < 0.2
    first.name, second.name, first.name = "Swap", "First", "Second"
    assert [ob.detail_deform.examples[0].found_weight for ob in alike] == found


def test_an_edit_that_is_taken_back_by_hand_shows_what_the_handles_ask_for(alike):
    """The offsets are computed anew, because they may have been edited with the mesh."""
    first, _ = alike
    place = first.data.vertices[300].co.copy()
    first.data.vertices[300].co.z += 1
    nothing = np.zeros(3 * len(first.data.vertices), np.float32)
    first.data.attributes['detail_deform_offset'].data.foreach_set('vector', nothing)
    first.data.update_tag()
    update()
    assert "Re-bind" in first.detail_deform.status
    first.data.vertices[300].co = place
    first.data.update_tag()
    assert_shown((first, 0.4))
