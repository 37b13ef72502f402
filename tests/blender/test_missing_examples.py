# SPDX-License-Identifier: GPL-3.0-or-later
"""Find Missing: the poses that the examples can't be mixed to, and their errors."""

import bpy
import numpy as np
import pytest

from conftest import bind, own, refusal
from rigs import add_handles, at, from_poses, make_library, names


def rows(ob):
    return [row.name for row in ob.detail_deform.missing_examples]


def test_the_twist_is_missing_beside_the_bend(rigged, part):
    ob, rig = rigged
    add_handles(ob, rig)
    find = bpy.ops.object.detail_deform_examples_find_missing
    assert "press Bind first" in refusal(find)
    ob.detail_deform.method = 'TRANSFER'
    assert "set Method to Examples" in refusal(find)
    ob.detail_deform.method = 'EXAMPLES'
    from_poses(frames='RANGE', frame_start=11, frame_end=11)
    bind(ob)
    at(3)
    assert bpy.ops.object.detail_deform_examples_find_missing(frames='RANGE', step=2) == {'FINISHED'}
    first = ob.detail_deform.missing_examples[0]
    assert first.name == "Frame 31" and first.largest_error > 1
    error = first.mean_error
    ob.detail_deform.show_error = True
    red, green = part('ui.preview').vertex_colours(ob)[:, :2].T
    worst = np.abs(own(ob)[:, 0] - 2).argmin()  # twisted, and not held by a handle
    assert red[worst] > 0.6 and (green[own(ob)[:, 0] < 0.5] > 0.7).all()
    assert bpy.context.scene.frame_current == 3
    assert bpy.ops.object.detail_deform_example_add_missing() == {'FINISHED'}
    assert names(ob) == ["Frame 11", "Frame 31"] and "Frame 31" not in rows(ob)
    assert ob.detail_deform.is_bound
    assert bpy.ops.object.detail_deform_examples_find_missing(frames='RANGE', frame_start=31, frame_end=31) == {
        'FINISHED'}
    assert not rows(ob)
    assert find(frames='RANGE') == {'FINISHED'}
    assert rows(ob) and all(row.mean_error < 0.5 * error for row in ob.detail_deform.missing_examples)


def test_a_listed_pose_whose_action_is_gone_is_refused(rigged):
    ob, rig = rigged
    add_handles(ob, rig)
    from_poses(frames='RANGE', frame_start=11, frame_end=11)
    bind(ob)
    make_library(rig, Twisted=(0, np.pi / 2, 0))
    assert bpy.ops.object.detail_deform_examples_find_missing(frames='LIBRARY') == {'FINISHED'}
    assert rows(ob) == ["Twisted"]
    bpy.data.actions["Twisted"].name = "Other"
    sentence = refusal(bpy.ops.object.detail_deform_example_add_missing)
    assert "no action 'Twisted'" in sentence and "Find Missing" in sentence
    assert names(ob) == ["Frame 11"] and rows(ob) == ["Twisted"]
    assert not ob.modifiers["Armature"].show_viewport


@pytest.fixture
def searched(rigged):
    """A mesh with two listed poses of the same name: the twist at frame 31, and the opposite bend at frame 41."""
    ob, rig = rigged
    lower = rig.pose.bones["Lower"]
    lower.rotation_euler = (-1.2, 0, 0)
    lower.keyframe_insert('rotation_euler', frame=41)
    at(1)
    add_handles(ob, rig)
    from_poses(frames='RANGE', frame_start=11, frame_end=11)
    bind(ob)
    for frame in (31, 41):
        bpy.context.scene.timeline_markers.new("Pose", frame=frame)
    assert bpy.ops.object.detail_deform_examples_find_missing(frames='MARKERS') == {'FINISHED'}
    assert rows(ob) == ["Pose", "Pose"]
    return ob


def test_each_row_has_its_errors_also_after_the_object_is_renamed(searched, part):
    errors_of, settings = part('results.missing_examples').errors_of, searched.detail_deform
    of_rows = []
    for settings.missing_index in (0, 1):
        row, found = settings.missing_examples[settings.missing_index], errors_of(searched)
        assert 100 * found.max() == pytest.approx(row.largest_error, rel=1e-3)
        of_rows.append(found)
    assert np.abs(of_rows[0] - of_rows[1]).max() > 0.01
    settings.missing_index, searched.name = 0, "Renamed"
    assert (errors_of(searched) == of_rows[0]).all()


def test_nothing_is_coloured_where_no_errors_are_known(searched, part):
    preview, settings = part('ui.preview'), searched.detail_deform
    settings.show_error = True
    assert preview.vertex_colours(searched) is not None
    part('session').ended(part('session').Until.LOADED)
    assert preview.vertex_colours(searched) is None
    settings.preview = True
    assert preview.vertex_colours(searched) is not None


def test_errors_are_out_of_date_once_an_example_was_added(searched, part):
    is_old = part('results.missing_examples').is_old
    assert not is_old(searched)
    assert bpy.ops.object.detail_deform_example_add_missing() == {'FINISHED'}
    assert rows(searched) == ["Pose"] and is_old(searched)
    assert bpy.ops.object.detail_deform_examples_find_missing(frames='MARKERS') == {'FINISHED'}
    assert not is_old(searched)
