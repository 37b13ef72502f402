# SPDX-License-Identifier: GPL-3.0-or-later
"""Limbs beside Blender's own tools: limbs_beside.jpg beside this file.

    xvfb-run -a blender --factory-startup --python tests/figures/make_limbs_beside.py

A tentacle bent by 120°, twisted by 360°, and its tip led down, by columns; by rows Detail Deform, an armature of six
bones with automatic weights and Preserve Volume, Simple Deform (which leads nothing), Laplacian Deform, and Sculpt
Mode's brush Pose, which needs a window. Needs a release build; takes a minute.
"""
import sys
from math import pi, radians
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Matrix, Vector

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "addon")]

import detail_deform  # noqa: E402
import manual_window  # noqa: E402
import shapes  # noqa: E402
import studio  # noqa: E402

LENGTH, ROOT, TIP = shapes.LIMB_LENGTH, 0.1, 0.9  # the latter two: fractions of the length that are held
BONES = 6
RINGS, SIDES = 121, 64  # as shapes.limb() has them
SIZE = (360, 420)
BENT, TWISTED, LED = Matrix.Rotation(radians(120), 4, 'Y'), 2 * pi, Vector((0.7 * LENGTH, 0, -0.7 * LENGTH))
PIVOT = Vector((0.76, 0, 0.5 * LENGTH))


def limb():
    points, faces, colours = shapes.limb(0.5, 0.06, 0.06)
    ob = studio.add_object("Limb", points, faces, colours)
    share = points[:, 2] / LENGTH
    for name, chosen in (("region", share > ROOT), ("tip", share > TIP), ("held", (share <= ROOT) | (share > TIP))):
        ob.vertex_groups.new(name=name).add(np.flatnonzero(chosen).tolist(), 1.0, 'REPLACE')
    return ob


def move(empty, pose):
    """Poses the empty of the tip."""
    if pose == 'BENT':
        about = Matrix.Translation(PIVOT)
        empty.matrix_world = about @ BENT @ about.inverted() @ empty.matrix_world
    elif pose == 'TWISTED':
        empty.rotation_euler.z += TWISTED
    else:
        empty.location += LED
    bpy.context.view_layer.update()


def by_detail_deform(ob, pose):
    bpy.ops.object.detail_deform_add()
    ob.detail_deform.region = "region"
    bpy.ops.object.detail_deform_handle_add(vertex_group="tip")
    bpy.ops.object.detail_deform_bind(wait=True)
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    bpy.context.view_layer.update()
    move(ob.detail_deform.handles[0].target, pose)


def by_armature(ob, pose):
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    studio.activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    joints = [0, *np.linspace(ROOT, TIP, BONES - 1), 1]
    bone = None
    for number, (low, high) in enumerate(zip(joints, joints[1:])):
        made = rig.data.edit_bones.new(f"Bone {number}")
        made.head, made.tail, made.parent = (0, 0, low * LENGTH), (0, 0, high * LENGTH), bone
        made.use_connect, bone = number > 0, made
    bpy.ops.object.mode_set(mode='OBJECT')
    ob.vertex_groups.clear()
    ob.select_set(True)
    bpy.ops.object.parent_set(type='ARMATURE_AUTO')
    ob.modifiers[-1].use_deform_preserve_volume = True
    moved = list(rig.pose.bones)[1:]
    if pose == 'LED':
        target = bpy.data.objects.new("Target", None)
        bpy.context.scene.collection.objects.link(target)
        target.location = Vector((0, 0, LENGTH)) + LED
        solver = moved[-1].constraints.new('IK')
        solver.target, solver.chain_count = target, len(moved)
        moved[0].rotation_mode, moved[0].rotation_euler = 'XYZ', (0, 0, -0.2)  # which way it bends
    for bone in moved if pose != 'LED' else ():
        bone.rotation_mode = 'XYZ'
        if pose == 'BENT':
            bone.rotation_euler.z = -radians(120) / len(moved)
        else:
            bone.rotation_euler.y = TWISTED / len(moved)


def by_simple_deform(ob, pose):
    if pose == 'LED':
        return False
    modifier = ob.modifiers.new("Deform", 'SIMPLE_DEFORM')
    modifier.limits = ROOT, TIP
    if pose == 'TWISTED':
        modifier.deform_method, modifier.deform_axis, modifier.angle = 'TWIST', 'Z', TWISTED
    else:
        modifier.deform_method, modifier.deform_axis, modifier.angle = 'BEND', 'Y', radians(120)
    return True


def by_laplacian_deform(ob, pose):
    empty = bpy.data.objects.new("Hook", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.location = (0, 0, 0.95 * LENGTH)
    bpy.context.view_layer.update()
    hook = ob.modifiers.new("Hook", 'HOOK')
    hook.object, hook.vertex_group = empty, "tip"
    hook.matrix_inverse = empty.matrix_world.inverted()
    modifier = ob.modifiers.new("Laplacian", 'LAPLACIANDEFORM')
    modifier.vertex_group, modifier.iterations = "held", 10
    studio.activate(ob)
    bpy.ops.object.laplaciandeform_bind(modifier=modifier.name)
    assert modifier.is_bind
    move(empty, pose)


def by_pose_brush(ob, pose):
    """One stroke from the tip, with as many segments as the armature has bones. With Ctrl it twists, so far by the
    pixel in the view's plane."""
    full_turn = 636
    with manual_window.in_area('VIEW_3D'):
        bpy.ops.view3d.view_axis(type='FRONT')
        bpy.ops.view3d.view_all()
    yield from manual_window.settle()
    with manual_window.in_area('VIEW_3D'):
        bpy.ops.object.mode_set(mode='SCULPT')
        bpy.ops.wm.tool_set_by_id(name='builtin_brush.Pose')
    yield from manual_window.settle()
    tools = bpy.context.scene.tool_settings
    tools.sculpt.brush.pose_ik_segments, tools.sculpt.brush.pose_smooth_iterations = BONES, 100
    tools.unified_paint_settings.size = 40
    tip = Vector((0, -0.05, 0.97 * LENGTH))
    end = tip + LED if pose == 'LED' else PIVOT + BENT @ (tip - PIVOT)
    with manual_window.in_area('VIEW_3D'):
        region, view = bpy.context.region, bpy.context.space_data.region_3d
        begins, ends = (location_3d_to_region_2d(region, view, place) for place in (tip, end))
        if pose == 'TWISTED':
            ends = begins + Vector((full_turn, 0))
        stroke = [{'name': "", 'location': tip.lerp(end, share), 'mouse': begins.lerp(ends, share),
                   'mouse_event': begins.lerp(ends, share), 'pressure': 1, 'size': 40, 'pen_flip': False, 'x_tilt': 0,
                   'y_tilt': 0, 'time': share, 'is_start': share == 0} for share in np.linspace(0, 1, 40).tolist()]
        bpy.ops.sculpt.brush_stroke(stroke=stroke, mode='INVERT' if pose == 'TWISTED' else 'NORMAL')
        bpy.ops.object.mode_set(mode='OBJECT')


def least_section(ob):
    """The least area of a ring's polygon over that at rest."""
    def areas(points):
        rings = np.array(points)[:RINGS * SIDES].reshape(RINGS, SIDES, 3)
        rings = rings - rings.mean(axis=1, keepdims=True)
        return np.linalg.norm(np.cross(rings, np.roll(rings, -1, axis=1)).sum(axis=1), axis=1)

    posed = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return (areas([v.co for v in posed.vertices]) / areas(shapes.limb(0.5, 0.06, 0.06)[0])).min()


def pictures():
    """Yields the seconds to wait before going on, in which Blender handles its events."""
    detail_deform.register()
    yield 0.1
    rows = []
    for tool in (by_detail_deform, by_armature, by_simple_deform, by_laplacian_deform, by_pose_brush):
        row = []
        for pose in ('BENT', 'TWISTED', 'LED'):
            studio.prepare_limbs()
            yield from manual_window.settle()
            ob = limb()
            if tool is by_pose_brush:
                yield from by_pose_brush(ob, pose)
            elif tool(ob, pose) is False:
                bpy.data.objects.remove(ob)
                ob = None
            bpy.context.view_layer.update()
            if ob:
                print(f"{tool.__name__}, {pose}: least section {least_section(ob):.2f}", flush=True)
            studio.look((1.3, -6.6, 2.9), (1.3, 0, 1.95), 45)
            with manual_window.in_area('VIEW_3D'):
                row.append(studio.on_paper(studio.picture(SIZE)))
        rows.append(row)
    studio.save(studio.sheet(rows), HERE / "limbs_beside.jpg")


manual_window.run(pictures())
