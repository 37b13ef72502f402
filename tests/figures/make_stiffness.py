# SPDX-License-Identifier: GPL-3.0-or-later
"""A tail with armour plates, bent and twisted, through the add-on: addon/manual/stiffness.jpg.

    blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_stiffness.py

At rest; bent without Stiff Parts, and with the plates painted; twisted by 200°, without and with. Needs a release
build; takes a minute.
"""
import sys
from math import radians
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "addon")]

import detail_deform  # noqa: E402
import shapes  # noqa: E402
import studio  # noqa: E402

RINGS, SIDES, LENGTH = 241, 96, 4.0
PLATES = (0.32, 0.48, 0.64, 0.8)  # their middles, as fractions of the length
SIZE = (300, 440)


def tail():
    """A closed tapered tube along z with plates that stand out: points, faces, colours, (n,) bool of the plates."""
    points, faces = shapes.tube(RINGS, SIDES, LENGTH, lambda angle: shapes.circle(angle, 1.0))
    points = points[:, [1, 2, 0]]  # from the x axis to the z axis
    u, turn = points[:, 2] / LENGTH, np.arctan2(points[:, 1], points[:, 0])
    turn = np.angle(np.exp(1j * (turn + 2.0)))  # about the side that is seen
    inside = np.max([1 - np.maximum(np.abs(u - at) / 0.055, np.abs(turn) / 0.85) for at in PLATES], axis=0)
    height = np.clip(inside / 0.12, 0, 1)
    rough = 0.02 * np.cos(14 * turn) * np.cos(70 * u)
    points[:, :2] *= ((0.5 - 0.3 * u) * (1 + 0.16 * height + rough * (height == 0)))[:, None]
    faces = [face[::-1] for face in faces]  # outwards
    return points, faces, np.where(height[:, None] > 0, (0.42, 0.45, 0.5), (0.8, 0.56, 0.34)), height > 0


def bent(empty):
    pivot = Vector((0.75, 0, 0.45 * LENGTH))
    turn = Matrix.Rotation(radians(120), 4, 'Y')
    empty.matrix_world = Matrix.Translation(pivot) @ turn @ Matrix.Translation(-pivot) @ empty.matrix_world


def twisted(empty):
    empty.rotation_euler.z += radians(200)


def pictures(shape, poses, stiff):
    """A picture of each pose of a newly bound tail."""
    points, faces, colours, plates = shape
    ob = studio.add_object("Tail", points, faces, colours)
    of_groups = (("region", points[:, 2] > 0.1 * LENGTH), ("tip", points[:, 2] > 0.93 * LENGTH), ("armour", plates))
    for name, chosen in of_groups:
        ob.vertex_groups.new(name=name).add(np.flatnonzero(chosen).tolist(), 1.0, 'REPLACE')
    bpy.ops.object.detail_deform_add()
    ob.detail_deform.region, ob.detail_deform.stiff_parts = "region", "armour" if stiff else ""
    bpy.ops.object.detail_deform_handle_add(vertex_group="tip")
    bpy.ops.object.detail_deform_bind(wait=True)
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    bpy.context.view_layer.update()
    empty, found = ob.detail_deform.handles[0].target, []
    rest = empty.matrix_world.copy()
    for pose in poses:
        empty.matrix_world = rest
        pose(empty)
        bpy.context.view_layer.update()
        studio.look((0.85, -7.6, 2.6), (0.85, 0, 1.9), 45)
        found.append(studio.on_paper(studio.picture(SIZE)))
    bpy.data.objects.remove(empty)
    bpy.data.objects.remove(ob)
    return found


def main():
    detail_deform.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    studio.prepare_limbs()
    shape = tail()
    rest, *soft = pictures(shape, (lambda empty: None, bent, twisted), stiff=False)
    stiff = pictures(shape, (bent, twisted), stiff=True)
    row = [rest, soft[0], stiff[0], soft[1], stiff[1]]
    studio.save(studio.sheet([row]), HERE.parents[1] / "addon" / "manual" / "stiffness.jpg")


main()
