# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh with an armature, and examples made of its poses."""

import bpy
import numpy as np
from mathutils import Matrix

from conftest import activate, add_empty, add_handle, evaluated, group, own, update

LENGTH, RINGS, SIDES = 3.0, 49, 12


def make_rigged():
    """(mesh, armature object): a tube along x with two bones, "Upper" to 1.5 and "Lower" from there. Lower bends by
    90 degrees at frame 11, is straight again at 21, and turns about its own length by 90 degrees at 31."""
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
    """Positions at this frame with the armature as the only modifier."""
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
    """Makes an action for each name, with one pose: "Lower" has the given rotation at frame 7. The rig goes on playing
    the action that it had."""
    played, lower = rig.animation_data.action, rig.pose.bones["Lower"]
    for name, turn in poses.items():
        rig.animation_data.action = None
        lower.rotation_euler = turn
        lower.keyframe_insert('rotation_euler', frame=7)
        rig.animation_data.action.name = name
        rig.animation_data.action.use_fake_user = True
    rig.animation_data.action = played
    at(1)
