# SPDX-License-Identifier: GPL-3.0-or-later
"""Examples that an armature makes: which poses, what is left alone, which one is missing."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, add_empty, add_handle, bind, evaluated, group, own, refusal, update

LENGTH, RINGS, SIDES = 3.0, 49, 12


@pytest.fixture
def rigged():
    """A tube along x with two bones, "Upper" to 1.5 and "Lower" from there. Lower bends by 90 degrees at frame 11, is
    straight again at 21, and turns about its own length by 90 degrees at 31."""
    i, j = np.meshgrid(np.linspace(0, LENGTH, RINGS), np.arange(SIDES) * 2 * np.pi / SIDES, indexing='ij')
    p = np.stack([i, 0.3 * np.cos(j), 0.2 * np.sin(j)], -1).reshape(-1, 3)
    faces = [(r * SIDES + k, (r + 1) * SIDES + k, (r + 1) * SIDES + (k + 1) % SIDES, r * SIDES + (k + 1) % SIDES)
             for r in range(RINGS - 1) for k in range(SIDES)]
    mesh = bpy.data.meshes.new("Limb")
    mesh.from_pydata(p.tolist(), [], faces)
    ob = bpy.data.objects.new("Limb", mesh)
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    for made in (ob, rig):
        bpy.context.scene.collection.objects.link(made)
    activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    for name, start, end in (("Upper", 0, 1.5), ("Lower", 1.5, 3)):
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = (start, 0, 0), (end, 0, 0)
        bone.parent = rig.data.edit_bones.get("Upper") if name == "Lower" else None
    bpy.ops.object.mode_set(mode='OBJECT')
    weights = np.clip((p[:, 0] - 1.0) / 1.0, 0, 1)
    for name, of_group in (("Upper", 1 - weights), ("Lower", weights)):
        made = ob.vertex_groups.new(name=name)
        for vertex, weight in enumerate(of_group):
            if weight > 0:
                made.add([vertex], weight, 'REPLACE')
    modifier = ob.modifiers.new("Armature", 'ARMATURE')
    modifier.object = rig
    lower = rig.pose.bones["Lower"]
    lower.rotation_mode = 'XYZ'
    for frame, turn in ((1, (0, 0, 0)), (11, (np.pi / 2, 0, 0)), (21, (0, 0, 0)), (31, (0, np.pi / 2, 0))):
        lower.rotation_euler = turn
        lower.keyframe_insert('rotation_euler', frame=frame)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 31
    scene.frame_set(1)
    activate(ob)
    return ob, rig


def add_handles(ob, rig=None):
    """The root is held; the tip is a handle, whose empty is carried by the bone where a rig is given."""
    p = own(ob)
    group(ob, 'region', np.flatnonzero(p[:, 0] > 0.3))
    group(ob, 'tip', np.flatnonzero(p[:, 0] > LENGTH - 0.2))
    ob.detail_deform.region = 'region'
    empty, place = add_empty("Tip", (0, 0, 0)), p[p[:, 0] > LENGTH - 0.2].mean(axis=0)
    if rig:
        empty.parent, empty.parent_type, empty.parent_bone = rig, 'BONE', "Lower"
        update()
    empty.matrix_world = Matrix.Translation(place)
    handle = add_handle(ob, 'tip', empty)
    ob.detail_deform.method = 'EXAMPLES'
    update()
    return handle


def at(frame):
    bpy.context.scene.frame_set(frame)


def posed(ob, frame):
    """What the armature alone makes of the mesh there."""
    shown = [(m, m.show_viewport) for m in ob.modifiers]
    for m, _ in shown:
        m.show_viewport = m.type == 'ARMATURE'
    present = bpy.context.scene.frame_current
    at(frame)
    found = evaluated(ob)
    at(present)
    for m, was in shown:
        m.show_viewport = was
    return found


def key(ob, name):
    block = ob.data.shape_keys.key_blocks[name]
    values = np.empty(3 * len(block.data), np.float32)
    block.data.foreach_get('co', values)
    return values.reshape(-1, 3).astype(float)


def names(ob):
    return [example.name for example in ob.detail_deform.examples]


def from_poses(**options):
    assert bpy.ops.object.detail_deform_examples_from_poses(**options) == {'FINISHED'}


def make_library(rig, **poses):
    """Actions of these names, each one pose: at its only frame, 7, "Lower" has that rotation. Leaves the action that is
    played."""
    played, lower = rig.animation_data.action, rig.pose.bones["Lower"]
    for name, turn in poses.items():
        rig.animation_data.action = None
        lower.rotation_euler = turn
        lower.keyframe_insert('rotation_euler', frame=7)
        rig.animation_data.action.name = name
        rig.animation_data.action.use_fake_user = True
    rig.animation_data.action = played
    at(1)


# Which poses

def test_a_range_by_a_step(rigged):
    ob, _ = rigged
    expected = {frame: posed(ob, frame) for frame in (6, 11, 31)}
    at(4)
    from_poses(frames='RANGE', frame_start=1, frame_end=31, step=5)
    # Frames 1 and 21 are the rest, 16 is 6 again.
    assert names(ob) == ["Frame 6", "Frame 11", "Frame 26", "Frame 31"]
    for frame, shape in expected.items():
        assert np.abs(key(ob, f"Frame {frame}") - shape).max() < 1e-6
    assert bpy.context.scene.frame_current == 4
    assert all(block.value == 0 for block in ob.data.shape_keys.key_blocks[1:])


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
    lower.rotation_euler = (0.1, 0.2, 0.3)  # in no key
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


def test_poses_of_a_library_leave_what_they_key_beside_places(rigged):
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
    assert np.abs(key(ob, "Held") - held).max() < 1e-5  # nothing is left of the pose before
    assert constraint.influence == 0.25 and list(lower["numbers"]) == [1, 2]


def test_those_that_differ_most(rigged):
    ob, rig = rigged
    root = rig.pose.bones["Upper"]
    root.rotation_mode = 'XYZ'
    for frame, far in ((1, 0), (25, 5)):  # what moves the mesh as a whole makes no other pose
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


# What is left alone, and what is not

def test_the_armature_is_switched_off_or_said(rigged):
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
    ob.modifiers.new("Armature", 'CAST')  # another one of the old name
    assert "'Skeleton' poses the result once more" in ob.detail_deform.status
    assert bpy.ops.object.detail_deform_posers_off() == {'FINISHED'}
    assert not ob.modifiers["Skeleton"].show_viewport and ob.modifiers["Armature"].show_viewport
    assert "once more" not in ob.detail_deform.status


def test_the_deformation_is_not_taken_for_nodes_that_are_gone(rigged):
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
    at(8)  # where the bone is posed, and the mesh at rest
    bind(ob)
    for frame in (1, 11, 31) if turns == 'TARGET' else (1, 11):  # a twist moves no tip
        at(frame)
        assert np.abs(evaluated(ob) - expected[frame]).max() < 1e-2 * LENGTH, frame
    assert ob.detail_deform.examples[0].found_weight == pytest.approx(float(frame == 11), abs=0.05)


def test_an_empty_that_was_put_on_the_mesh_beside_a_posed_bone_starts_there(rigged):
    ob, rig = rigged
    from_poses(frames='KEYS')
    at(11)
    handle = add_handles(ob, rig)  # on the mesh at rest
    bind(ob)
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5
    assert handle.rest_matrix[3] == pytest.approx(handle.target.matrix_world.translation.x)


def test_modifiers_that_make_vertices_and_those_behind_go_on(rigged):
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


def test_shape_keys_that_are_seen_are_part_of_the_examples(rigged):
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


def test_a_cancelled_walk_and_one_that_fails_leave_all_as_it_was(rigged, part):
    ob, rig = rigged
    add_handles(ob, rig)
    from_poses(frames='RANGE', frame_start=11, frame_end=11)
    bind(ob)
    at(5)
    lower = rig.pose.bones["Lower"]
    lower.rotation_euler.z = 0.7  # in no key
    update()
    before = (names(ob), len(ob.data.shape_keys.key_blocks), [(m.show_viewport, m.show_render) for m in ob.modifiers],
              tuple(lower.rotation_euler), bpy.context.scene.frame_current)
    shape, frames = evaluated(ob), part('results.pose_frames')
    work = part('results.posed_examples').add(bpy.context, ob, frames.in_range(1, 31, 1))
    for _ in range(12):
        next(work)
    assert bpy.context.scene.frame_current == 12
    work.close()  # as by Esc
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


# Which one is missing

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
    worst = np.abs(own(ob)[:, 0] - 2).argmin()  # where it is twisted and no handle holds it
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
    """Two rows of one name: the twist at frame 31, and a bend the other way at 41."""
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


def test_errors_are_of_their_row_and_stay_when_the_object_is_renamed(searched, part):
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
    part('results.missing_examples').forget()  # as another file does
    assert preview.vertex_colours(searched) is None
    settings.preview = True
    assert preview.vertex_colours(searched) is not None


def test_numbers_are_old_once_an_example_was_added(searched, part):
    is_old = part('results.missing_examples').is_old
    assert not is_old(searched)
    assert bpy.ops.object.detail_deform_example_add_missing() == {'FINISHED'}
    assert rows(searched) == ["Pose"] and is_old(searched)
    assert bpy.ops.object.detail_deform_examples_find_missing(frames='MARKERS') == {'FINISHED'}
    assert not is_old(searched)


# Limits

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
    assert np.abs(evaluated(ob)[-SIDES:] - tip).max() < 1e-5  # the handle is met
    example.largest_weight = 0.25
    assert example.found_weight == 0.25
    example.limited = False
    assert example.found_weight > 1.2


# Kept

@pytest.mark.parametrize('weights_by', ['HANDLES', 'SLIDERS'])
def test_what_is_seen_is_saved_as_a_key(rigged, weights_by):
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
    ob.detail_deform.handles[0].target.parent = None  # let go
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
    at(31)
    assert ob.data.shape_keys.key_blocks["Frame 31"].value == pytest.approx(1, abs=0.02)


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
def test_keyed_weights_take_the_place_of_what_was_keyed(rigged, mode, part, monkeypatch):
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
    refreshed, life = [], part('follow.life')
    refresh = life.refresh
    monkeypatch.setattr(life, 'refresh', lambda *given: (refreshed.append(1), refresh(*given)))
    assert bpy.ops.object.detail_deform_bake(mode=mode) == {'FINISHED'}
    assert len(refreshed) < 3 * 31  # twice a frame, and not for each key
    animation = (ob if mode == 'SLIDERS' else ob.data.shape_keys).animation_data
    for curve in part('scene.actions').curves(animation.action):
        assert [point.co.x for point in curve.keyframe_points] == [*range(1, 32), 50]
    at(11)
    assert [getattr(owner, prop) for owner in owners] == pytest.approx(expected, abs=1e-5)
