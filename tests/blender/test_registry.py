# SPDX-License-Identifier: GPL-3.0-or-later
"""The registry of bound objects and followers: an update doesn't search the scene, so its cost doesn't depend on the
number of other objects; and each new member is found."""

import contextlib
import os
import sys

import bpy
import numpy as np
import pytest

from conftest import activate, add_empty, bind, evaluated, make_strip, own, script_copy, update


@contextlib.contextmanager
def steps_of(module):
    """Counts the bytecodes that the interpreter executes in the add-on's code."""
    folder = os.path.dirname(module.__file__)
    count = [0]

    def trace(frame, event, argument):
        if not frame.f_code.co_filename.startswith(folder):
            return None
        frame.f_trace_opcodes = True
        count[0] += event == 'opcode'
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        yield count
    finally:
        sys.settrace(before)


def fill_scene(count):
    """Adds objects that are not bound, with one mesh."""
    mesh = bpy.data.meshes.new("Pebble")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    collection = bpy.context.scene.collection
    for number in range(count):
        collection.objects.link(bpy.data.objects.new(f"Pebble {number}", mesh))
    update()
    update()


def steps_of_an_update(module, ob):
    with steps_of(module) as count:
        ob.location.x += 1
        update()
    return count[0]


def steps_of_a_frame(module):
    with steps_of(module) as count:
        bpy.context.scene.frame_set(bpy.context.scene.frame_current + 1)
    return count[0]


@pytest.mark.parametrize('bound', [False, True])
def test_an_update_does_not_go_through_the_scene(module, bound):
    """Not one bytecode more with 10,000 objects than with 10."""
    counts = []
    for objects in (10, 10000):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        if bound:
            bind(make_strip())
        mover = add_empty("Mover", (0, 0, 0))
        fill_scene(objects)
        steps_of_a_frame(module)
        counts.append((steps_of_an_update(module, mover), steps_of_a_frame(module)))
    assert counts[0] == counts[1]
    assert bound == (min(counts[0]) > 200)


def test_asking_again_whose_an_empty_is_does_not_go_through_the_scene(module, part):
    """Panels, gizmos and poll() ask at each redraw whose handle the active empty is: the first time all objects are
    searched, later none."""
    owners, counts = part('scene.handle_owners'), []
    for objects in (10, 1000):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        fill_scene(objects)
        foreign = add_empty("Foreign", (0, 0, 0))
        ob = bind(make_strip())
        mine = handle(ob)
        activate(foreign)
        assert not bpy.ops.object.detail_deform_mesh_activate.poll() and owners.handle_of(foreign) == (None, -1)
        with steps_of(module) as count:
            for _ in range(20):
                assert owners.handle_of(foreign) == (None, -1)
        counts.append(count[0])
        # A change of any handle's empty is noticed at once.
        ob.detail_deform.handles[0].target = foreign
        assert owners.handle_of(foreign) == (ob, 0) and owners.handle_of(mine)[0] is None
        ob.detail_deform.handles[0].target = mine
        assert owners.handle_of(foreign)[0] is None and owners.handle_of(mine) == (ob, 0)
        ob.name = "Renamed"
        assert owners.handle_of(mine) == (ob, 0)
        ob.detail_deform.handles.clear()
        assert owners.handle_of(mine)[0] is None
    assert counts[0] == counts[1]


def test_with_nothing_bound_an_update_does_not_go_through_the_changed_objects(module):
    counts = []
    for objects in (10, 1000):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        fill_scene(objects)
        with steps_of(module) as count:
            for ob in bpy.context.scene.objects:
                ob.location.x += 1
            bpy.context.scene.objects[0].data.update_tag()
            update()
        counts.append(count[0])
    assert counts[0] == counts[1]


def handle(ob):
    return ob.detail_deform.handles[0].target


def follows(ob):
    """Whether the surface follows its handle at a change of frame, which doesn't tell which objects have changed."""
    heights = []
    for step in (0.1, -0.1):
        handle(ob).location.z += step
        bpy.context.scene.frame_set(bpy.context.scene.frame_current + 1)
        heights.append(evaluated(ob)[-1, 2])
    return abs(heights[0] - heights[1] - 0.1) < 1e-5


@pytest.fixture
def strip():
    return bind(make_strip())


def test_a_copy_made_by_a_script_is_known_in_the_next_frame(strip):
    copy = script_copy(strip)
    assert follows(copy) and follows(strip)


def test_a_duplicate_is_known(strip):
    activate(strip)
    bpy.ops.object.duplicate()
    copy = bpy.context.active_object
    assert copy != strip and follows(copy) and follows(strip)


def test_a_copy_made_while_another_is_deleted_is_known(strip):
    """The node group's number of users is the same as before."""
    copy = script_copy(strip)
    bpy.context.scene.frame_set(2)
    last = script_copy(strip)
    bpy.data.objects.remove(copy)
    assert follows(last) and follows(strip)


def test_renamed_and_deleted_objects_leave_the_others_known(strip):
    others = [script_copy(strip) for _ in range(3)]
    bpy.context.scene.frame_set(2)
    strip.name = "Other name"
    bpy.data.objects.remove(others[1])
    for ob in (strip, others[0], others[2]):
        assert follows(ob)


def test_after_undo_and_redo_objects_are_known(strip):
    bpy.ops.ed.undo_push(message="one")
    script_copy(strip).name = "Copy"
    bpy.ops.ed.undo_push(message="two")
    bpy.ops.ed.undo()
    assert follows(bpy.data.objects['Strip']) and 'Copy' not in bpy.data.objects
    bpy.ops.ed.redo()
    assert follows(bpy.data.objects['Copy']) and follows(bpy.data.objects['Strip'])


@pytest.mark.parametrize('link', [False, True])
def test_an_appended_or_linked_object_is_known(strip, tmp_path, link, part):
    blend = str(tmp_path / 'asset.blend')
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.context.scene.frame_set(2)
    assert part('follow.registry').members() == []
    with bpy.data.libraries.load(blend, link=link) as (_, wanted):
        wanted.objects = ['Strip', 'Right']
    for name in ('Strip', 'Right'):
        bpy.context.scene.collection.objects.link(bpy.data.objects[name])
    bpy.context.scene.frame_set(3)
    ob = bpy.data.objects['Strip']
    assert part('follow.registry').members() == [ob]
    assert link or follows(ob)
    assert link == ("is linked from another file" in ob.detail_deform.status)


def test_after_remove_an_update_costs_no_more_than_without_the_object(strip, module):
    mover = add_empty("Mover", (0, 0, 0))
    bpy.ops.object.detail_deform_remove()
    update()
    idle = steps_of_an_update(module, mover)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    mover = add_empty("Mover", (0, 0, 0))
    update()
    assert steps_of_an_update(module, mover) <= idle + 50 and idle < 200


def test_a_follower_is_known_with_its_copies(strip):
    follower = make_strip(name="Follower")
    follower.detail_deform.handles.clear()
    assert bpy.ops.object.detail_deform_transfer_live(source="Strip") == {'FINISHED'}
    copy = script_copy(follower)
    handle(strip).location.z += 0.3
    bpy.context.scene.frame_set(5)
    for ob in (follower, copy):
        assert np.abs(evaluated(ob) - own(ob)).max() > 0.29
        assert np.abs(evaluated(ob) - evaluated(strip)).max() < 1e-4


def test_the_record_of_a_deleted_copy_is_forgotten(part):
    """With a base object or a source a record is as large as the mesh."""
    ob = bind(make_strip())
    shown = part('follow.frame_results')
    known = len(shown._shown)
    for number in range(5):
        copy = ob.copy()
        copy.data = ob.data.copy()
        bpy.context.scene.collection.objects.link(copy)
        ob.detail_deform.handles[0].target.location.z = 0.1 * (1 + number)
        update()
        assert len(shown._shown) == known + 1
        bpy.data.objects.remove(copy)
        update()
    assert len(shown._shown) == known
