# SPDX-License-Identifier: GPL-3.0-or-later
"""Limbs beside Blender's own tools: limbs_beside.jpg beside this file.

    blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_limbs_beside.py

A tentacle bent by 120°, twisted by 360°, and its tip led down, by columns; by rows Detail Deform, an armature of six
bones with automatic weights and Preserve Volume, Simple Deform (which leads nothing), and Laplacian Deform. Needs a
release build; takes a minute.
"""
import sys
from math import pi, radians
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "addon")]

import detail_deform  # noqa: E402
import shapes  # noqa: E402
import studio  # noqa: E402

LENGTH, ROOT, TIP = shapes.LIMB_LENGTH, 0.1, 0.9  # the latter two: fractions of the length that are held
BONES = 6
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


def main():
    detail_deform.register()
    rows = []
    for tool in (by_detail_deform, by_armature, by_simple_deform, by_laplacian_deform):
        row = []
        for pose in ('BENT', 'TWISTED', 'LED'):
            bpy.ops.wm.read_factory_settings(use_empty=True)
            studio.prepare_limbs()
            ob = limb()
            if tool(ob, pose) is False:
                bpy.data.objects.remove(ob)
            bpy.context.view_layer.update()
            studio.look((1.3, -6.6, 2.9), (1.3, 0, 1.95), 45)
            row.append(studio.on_paper(studio.picture(SIZE)))
        rows.append(row)
    studio.save(studio.sheet(rows), HERE / "limbs_beside.jpg")


main()
