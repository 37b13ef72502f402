# SPDX-License-Identifier: GPL-3.0-or-later
"""Limbs without and with Solidity, through the add-on: limbs.jpg beside this file.

    blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_limbs.py

Above Solidity 0, below 1: a tentacle whose tip is led down, the same twisted by 120° and by two turns, bent by 170°,
and a horn with relief led down. Needs a release build; takes a minute.
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

LENGTH = shapes.LIMB_LENGTH
SIZE = (360, 420)


def bound(shape):
    """The limb with a handle at its tip, bound; its first tenth is fixed. (object, empty)"""
    points, faces, colours = shape
    ob = studio.add_object("Limb", points, faces, colours)
    for name, above in (("region", 0.1), ("tip", 0.9)):
        ob.vertex_groups.new(name=name).add(np.flatnonzero(points[:, 2] > above * LENGTH).tolist(), 1.0, 'REPLACE')
    bpy.ops.object.detail_deform_add()
    ob.detail_deform.region = "region"
    bpy.ops.object.detail_deform_handle_add(vertex_group="tip")
    bpy.ops.object.detail_deform_bind(wait=True)
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    return ob, ob.detail_deform.handles[0].target


def led_down(empty):
    empty.location += Vector((0.7 * LENGTH, 0, -0.7 * LENGTH))


def twisted(degrees):
    def turn(empty):
        empty.rotation_euler.z = radians(degrees)
    return turn


def bent(empty):
    pivot = Vector((0.76, 0, 0.5 * LENGTH))
    turn = Matrix.Rotation(radians(170), 4, 'Y')
    empty.location = pivot + turn @ (empty.location - pivot)
    empty.rotation_euler.y = radians(170)


def main():
    detail_deform.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    studio.prepare_limbs()
    rows = ([], [])
    for shape, pose in ((shapes.limb(0.5, 0.06), led_down), (shapes.limb(0.5, 0.06), twisted(120)),
                        (shapes.limb(0.5, 0.06), twisted(720)), (shapes.limb(0.5, 0.06), bent),
                        (shapes.limb(0.45, 0.12, 0.1), led_down)):
        ob, empty = bound(shape)
        pose(empty)
        for solidity, row in enumerate(rows):
            ob.detail_deform.solidity = solidity
            bpy.context.view_layer.update()
            studio.look((1.3, -6.6, 2.9), (1.3, 0, 1.95), 45)
            row.append(studio.on_paper(studio.picture(SIZE)))
        bpy.data.objects.remove(empty)
        bpy.data.objects.remove(ob)
    studio.save(studio.sheet(rows), HERE / "limbs.jpg")


main()
