# SPDX-License-Identifier: GPL-3.0-or-later
"""Examples made from an armature's poses: the choice of poses, and the state of the scene afterwards."""

import bpy
import numpy as np
import pytest

from conftest import add_empty, bind, evaluated, own, refusal, update
from rigs import LENGTH, SIDES, add_handles, at, from_poses, key, make_library, names, posed


# ---- which poses

def test_a_range_by_a_step(rigged):
    ob, _ = rigged
    expected = {frame: posed(ob, frame) for frame in (6, 11, 31)}
    at(4)
    from_poses(frames='RANGE', frame_start=1, frame_end=31, step=5)
    # Frames 1 and 21 are at rest, and 16 has the same pose as 6.
    assert names(ob) == ["Frame 6", "Frame 11", "Frame 26", "Frame 31"]
    for frame, shape in expected.items():
        assert np.abs(key(ob, f"Frame {frame}") - shape).max() < 1e-6
    assert bpy.context.scene.frame_current == 4
    assert all(block.value == 0 for block in ob.data.shape_keys.key_blocks[1:])


@pytest.mark.parametrize('scale, reverse, expected', [
    (1.0, False, ["Frame 20", "Frame 40"]), (2.0, False, ["Frame 30", "Frame 70"]),
    (1.0, True, ["Frame 10", "Frame 30"])])
def test_keys_in_nla_strips(rigged, scale, reverse, expected):
    """At the frames in which a strip plays them; a muted track doesn't count."""
    ob, rig = rigged
    shapes = [posed(ob, frame) for frame in (11, 31)]
    action = rig.animation_data.action
    rig.animation_data.action = None
    for name, begin in (("Played", 10), ("Muted", 100)):
        track = rig.animation_data.nla_tracks.new()
        strip = track.strips.new(name, begin, action)
        strip.scale, strip.use_reverse = scale, reverse
        track.mute = name == "Muted"
    bpy.context.scene.frame_end = 200
    from_poses(frames='KEYS')
    assert names(ob) == expected
    for name, shape in zip(expected, reversed(shapes) if reverse else shapes):
        assert np.abs(key(ob, name) - shape).max() < 1e-5


def test_keys_markers_and_poses_of_a_library(rigged):
    ob, rig = rigged
    from_poses(frames='KEYS')
    assert names(ob) == ["Frame 11", "Frame 31"]
    bend, twist = key(ob, "Frame 11"), key(ob, "Frame 31")

    ob.detail_deform.examples.clear()
    assert "no markers" in refusal(bpy.ops.object.detail_deform_examples_from_poses, frames='MARKERS')
    for name, frame in (("Twist", 31), ("Rest", 21), ("Bend", 11)):
        bpy.context.scene.timeline_markers.new(name, frame=frame)
    from_poses(frames='MARKERS')
    assert names(ob) == ["Bend", "Twist"]
    assert np.abs(key(ob, "Twist") - twist).max() < 1e-6

    ob.detail_deform.examples.clear()
    assert "no action with one pose" in refusal(bpy.ops.object.detail_deform_examples_from_poses, frames='LIBRARY')
    played = rig.animation_data.action
    rig.animation_data.action = None
    lower = rig.pose.bones["Lower"]
    lower["switch"] = 1.0
    lower.keyframe_insert('["switch"]', frame=7)
    lower.rotation_euler = (np.pi / 2, 0, 0)
    lower.keyframe_insert('rotation_euler', frame=7)
    rig.animation_data.action.name = "Bent"
    rig.animation_data.action.use_fake_user = True
    rig.animation_data.action = played
    at(25)
    lower.rotation_euler = (0.1, 0.2, 0.3)  # not keyed
    lower["switch"] = 0.5
    rig.pose.bones["Upper"].location = (0, 0.5, 0)
    update()
    from_poses(frames='LIBRARY')
    assert names(ob) == ["Bent"]
    assert np.abs(key(ob, "Bent") - bend).max() < 1e-5
    assert rig.animation_data.action == played and bpy.context.scene.frame_current == 25
    assert np.allclose(lower.rotation_euler, (0.1, 0.2, 0.3), atol=1e-6) and lower["switch"] == 0.5
    assert np.allclose(rig.pose.bones["Upper"].location, (0, 0.5, 0), atol=1e-6)


def selection(rig):
    return [(bone, bone.select) for bone in (rig.pose.bones if bpy.app.version >= (5, 0) else rig.data.bones)]


def test_poses_of_a_library_reach_bones_that_are_not_selected(rigged):
    ob, rig = rigged
    root = rig.pose.bones["Upper"]
    root.rotation_mode = 'XYZ'
    played, rig.animation_data.action = rig.animation_data.action, None
    root.rotation_euler = (0, 0, 1)
    root.keyframe_insert('rotation_euler', frame=7)
    rig.animation_data.action.name = "Turned"
    at(7)
    turned = posed(ob, 7)
    rig.animation_data.action.use_fake_user = True
    rig.animation_data.action = played
    root.rotation_euler = (0, 0, 0)
    at(1)
    for bone, _ in selection(rig):
        bone.select = bone.name == "Lower"
    before = [chosen for _, chosen in selection(rig)]
    from_poses(frames='LIBRARY')
    assert np.abs(key(ob, "Turned") - turned).max() < 1e-5
    assert [chosen for _, chosen in selection(rig)] == before


def test_poses_of_a_library_restore_keyed_properties_and_constraints(rigged):
    ob, rig = rigged
    lower = rig.pose.bones["Lower"]
    constraint = lower.constraints.new('COPY_ROTATION')
    constraint.target, constraint.influence = add_empty("Aim", (0, 0, 5)), 0.25
    constraint.target.rotation_euler = (1, 0, 0)
    lower["numbers"] = [1.0, 2.0]
    make_library(rig, Held=(0, 0, 0.5))
    from_poses(frames='LIBRARY')
    assert names(ob) == ["Held"]
    held = key(ob, "Held")

    ob.detail_deform.examples.clear()
    ob.shape_key_clear()
    ob.modifiers["Armature"].show_viewport = True
    make_library(rig, Bent=(np.pi / 2, 0, 0))
    played, rig.animation_data.action = rig.animation_data.action, bpy.data.actions["Bent"]
    constraint.influence, lower["numbers"] = 1, [3.0, 4.0]
    constraint.keyframe_insert('influence', frame=7)
    lower.keyframe_insert('["numbers"]', frame=7)
    rig.animation_data.action = played
    constraint.influence, lower["numbers"] = 0.25, [1.0, 2.0]
    at(1)
    from_poses(frames='LIBRARY')
    assert names(ob) == ["Bent", "Held"]
    assert np.abs(key(ob, "Held") - held).max() < 1e-5  # the pose before, "Bent", leaves no trace
    assert constraint.influence == 0.25 and list(lower["numbers"]) == [1, 2]


def test_the_poses_that_differ_most(rigged):
    ob, rig = rigged
    root = rig.pose.bones["Upper"]
    root.rotation_mode = 'XYZ'
    for frame, far in ((1, 0), (25, 5)):  # a motion of the whole mesh, which makes no other pose
        root.location, root.rotation_euler = (far, 0, -far), (far, 0.5 * far, 0)
        root.keyframe_insert('location', frame=frame)
        root.keyframe_insert('rotation_euler', frame=frame)
    from_poses(frames='DIFFERENT', count=5, step=10)
    assert names(ob) == ["Frame 11", "Frame 31"]
    ob.detail_deform.examples.clear()
    from_poses(frames='DIFFERENT', count=1)
    assert names(ob) == ["Frame 11"]


def test_equal_poses_are_one_and_none_is_refused(rigged):
    ob, rig = rigged
    rig.data.pose_position = 'REST'
    assert "rest position" in refusal(bpy.ops.object.detail_deform_examples_from_poses)
    assert ob.data.shape_keys is None and ob.modifiers["Armature"].show_viewport
    rig.data.pose_position = 'POSE'
    from_poses(frames='KEYS')
    assert "already" in refusal(bpy.ops.object.detail_deform_examples_from_poses, frames='KEYS')
    assert names(ob) == ["Frame 11", "Frame 31"]
    ob.modifiers.clear()
    assert "No modifier poses 'Limb'" in refusal(bpy.ops.object.detail_deform_examples_from_poses)


# ---- modifiers, handles and the scene afterwards

def test_an_armature_that_poses_a_second_time_is_reported_and_can_be_switched_off(rigged):
    ob, rig = rigged
    bent = posed(ob, 11)
    add_handles(ob, rig)
    from_poses(frames='KEYS', switch_off=False)
    bind(ob)
    at(11)
    assert "'Armature' poses the result once more" in ob.detail_deform.status
    assert bpy.ops.object.detail_deform_posers_off() == {'FINISHED'}
    assert not ob.modifiers["Armature"].show_viewport and not ob.modifiers["Armature"].show_render
    update()
    assert "once more" not in ob.detail_deform.status
    assert np.abs(evaluated(ob) - bent).max() < 5e-3 * LENGTH
    assert not bpy.ops.object.detail_deform_posers_off.poll()


def test_an_armature_that_was_renamed_still_poses_twice(rigged):
    ob, rig = rigged
    add_handles(ob, rig)
    from_poses(frames='KEYS', switch_off=False)
    bind(ob)
    ob.modifiers["Armature"].name = "Skeleton"
    assert "'Skeleton' poses the result once more" in ob.detail_deform.status
    ob.modifiers.new("Armature", 'CAST')  # another modifier with the old name
    assert "'Skeleton' poses the result once more" in ob.detail_deform.status
    assert bpy.ops.object.detail_deform_posers_off() == {'FINISHED'}
    assert not ob.modifiers["Skeleton"].show_viewport and ob.modifiers["Armature"].show_viewport
    assert "once more" not in ob.detail_deform.status


def test_detail_deforms_nodes_are_not_taken_for_removed_nodes(rigged):
    ob, _ = rigged
    ob.modifiers.clear()
    ob.modifiers.new("Bend", 'NODES')
    nodes = bpy.data.node_groups.new("Move", 'GeometryNodeTree')
    if bpy.app.version >= (4, 0):
        nodes.interface.new_socket("Geometry", in_out='INPUT', socket_type='NodeSocketGeometry')
        nodes.interface.new_socket("Geometry", in_out='OUTPUT', socket_type='NodeSocketGeometry')
    else:
        nodes.inputs.new('NodeSocketGeometry', "Geometry")
        nodes.outputs.new('NodeSocketGeometry', "Geometry")
    moved = nodes.nodes.new('GeometryNodeSetPosition')
    moved.inputs['Offset'].default_value = (0, 0, 1)
    nodes.links.new(nodes.nodes.new('NodeGroupInput').outputs[0], moved.inputs[0])
    nodes.links.new(moved.outputs[0], nodes.nodes.new('NodeGroupOutput').inputs[0])
    ob.modifiers["Bend"].node_group = nodes
    from_poses(frames='RANGE', switch_off=False)
    add_handles(ob)
    bind(ob)
    assert "'Bend' poses the result once more" in ob.detail_deform.status
    ob.modifiers.remove(ob.modifiers["Bend"])
    assert "once more" not in ob.detail_deform.status
    assert not bpy.ops.object.detail_deform_posers_off.poll()


@pytest.mark.parametrize('turns', ['TARGET', 'FREE'])
def test_an_empty_that_a_bone_carries_pulls_to_the_poses(rigged, turns):
    ob, rig = rigged
    expected = {frame: posed(ob, frame) for frame in (1, 11, 31)}
    add_handles(ob, rig).turns = turns
    from_poses(frames='KEYS')
    at(8)  # the bone is posed here, and the mesh at rest, because its armature modifier is off
    bind(ob)
    # A twist doesn't move the tip, so a free handle can't ask for it.
    for frame in (1, 11, 31) if turns == 'TARGET' else (1, 11):
        at(frame)
        assert np.abs(evaluated(ob) - expected[frame]).max() < 1e-2 * LENGTH, frame
    assert ob.detail_deform.examples[0].found_weight == pytest.approx(float(frame == 11), abs=0.05)


def test_an_empty_on_the_resting_mesh_with_a_posed_bone_rests_where_it_is(rigged):
    ob, rig = rigged
    from_poses(frames='KEYS')
    at(11)
    handle = add_handles(ob, rig)  # on the mesh at rest
    bind(ob)
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5
    assert handle.rest_matrix[3] == pytest.approx(handle.target.matrix_world.translation.x)


def test_modifiers_that_pose_nothing_stay_on(rigged):
    ob, _ = rigged
    bent = posed(ob, 11)
    made = ob.modifiers.new("Subdivision", 'SUBSURF')
    ob.modifiers.new("Cast", 'CAST').factor = 0.3
    with bpy.context.temp_override(object=ob, active_object=ob):
        bpy.ops.object.modifier_move_to_index(modifier="Subdivision", index=0)
    from_poses(frames='KEYS')
    assert np.abs(key(ob, "Frame 11") - bent).max() < 1e-6
    assert made.show_viewport and ob.modifiers["Cast"].show_viewport and not ob.modifiers["Armature"].show_viewport

    ob.modifiers["Armature"].show_viewport = True
    ob.modifiers.new("Mirror", 'MIRROR')
    with bpy.context.temp_override(object=ob, active_object=ob):
        bpy.ops.object.modifier_move_to_index(modifier="Mirror", index=0)
    assert "'Mirror' copies the mesh before 'Armature'" in refusal(bpy.ops.object.detail_deform_examples_from_poses)


def test_a_lattice_poses_too(rigged):
    ob, _ = rigged
    ob.modifiers.clear()
    lattice = bpy.data.objects.new("Lattice", bpy.data.lattices.new("Lattice"))
    bpy.context.scene.collection.objects.link(lattice)
    lattice.scale = (4, 4, 4)
    ob.modifiers.new("Cage", 'LATTICE').object = lattice
    for frame, angle in ((1, 0), (10, 0.5)):
        lattice.rotation_euler.z = angle
        lattice.keyframe_insert('rotation_euler', frame=frame)
    lattice.data.points[0].co_deform.z -= 0.4
    from_poses(frames='KEYS')
    assert names(ob) == ["Frame 1", "Frame 10"]
    assert not ob.modifiers["Cage"].show_viewport


def test_displayed_shape_keys_are_part_of_the_examples(rigged):
    ob, rig = rigged
    ob.shape_key_add(name="Basis", from_mix=False)
    fat = ob.shape_key_add(name="Fat", from_mix=False)
    values = own(ob)
    values[:, 1:] *= 1.3
    fat.data.foreach_set('co', values.astype(np.float32).ravel())
    fat.value = 0.5
    at(1)
    bent, straight = posed(ob, 11), posed(ob, 1)
    add_handles(ob, rig)
    from_poses(frames='KEYS')
    assert np.abs(key(ob, "Frame 11") - bent).max() < 1e-6
    bind(ob)
    for frame, shape in ((1, straight), (11, bent)):
        at(frame)
        assert np.abs(evaluated(ob) - shape).max() < 1e-2 * LENGTH


def test_cancelled_or_failed_the_operator_leaves_all_as_it_was(rigged, part):
    ob, rig = rigged
    add_handles(ob, rig)
    from_poses(frames='RANGE', frame_start=11, frame_end=11)
    bind(ob)
    at(5)
    lower = rig.pose.bones["Lower"]
    lower.rotation_euler.z = 0.7  # not keyed
    update()
    before = (names(ob), len(ob.data.shape_keys.key_blocks), [(m.show_viewport, m.show_render) for m in ob.modifiers],
              tuple(lower.rotation_euler), bpy.context.scene.frame_current)
    shape, frames = evaluated(ob), part('results.pose_frames')
    work = part('results.posed_examples').add(bpy.context, ob, frames.in_range(1, 31, 1))
    for _ in range(12):
        next(work)
    assert bpy.context.scene.frame_current == 12
    work.close()  # cancels it, as Esc does
    bad = rig.pose.bones["Upper"]
    bad.keyframe_insert('scale', frame=1)
    bad.scale = (float('inf'),) * 3
    bad.keyframe_insert('scale', frame=20)
    bad.scale = (1, 1, 1)
    at(5)
    lower.rotation_euler.z = 0.7
    update()
    assert "not finite" in refusal(bpy.ops.object.detail_deform_examples_from_poses, frames='RANGE')
    after = (names(ob), len(ob.data.shape_keys.key_blocks), [(m.show_viewport, m.show_render) for m in ob.modifiers],
             tuple(lower.rotation_euler), bpy.context.scene.frame_current)
    assert after == before
    assert np.abs(evaluated(ob) - shape).max() < 1e-6


# ---- limits of weights

def test_a_limited_example_is_not_exaggerated(rigged):
    ob, rig = rigged
    add_handles(ob, rig)
    from_poses(frames='RANGE', frame_start=6, frame_end=6)
    bind(ob)
    at(11)
    example, tip = ob.detail_deform.examples[0], evaluated(ob)[-SIDES:]
    assert example.found_weight > 1.2
    example.limited = True
    assert example.found_weight == 1 and ob.detail_deform.is_bound
    assert np.abs(evaluated(ob)[-SIDES:] - tip).max() < 1e-5  # the handle's vertices still follow it
    example.largest_weight = 0.25
    assert example.found_weight == 0.25
    example.limited = False
    assert example.found_weight > 1.2
