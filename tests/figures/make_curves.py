# SPDX-License-Identifier: GPL-3.0-or-later
"""A tentacle moved by one curve, through the add-on: addon/manual/curve.jpg.

    blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_curves.py

At rest; bent twice; coiled; twisted by a tilt of two turns, and thickened by the radius. Needs a release build; takes a
minute.
"""
import sys
from math import pi
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "addon")]

import detail_deform  # noqa: E402
import shapes  # noqa: E402
import studio  # noqa: E402

RINGS, SIDES, LENGTH, ROOT = 201, 64, 6.0, 0.6
COUNT = 9  # points of the curve
SIZE = (300, 440)


def tentacle():
    """A closed tapered tube along z with suckers: points, faces and colours."""
    points, faces = shapes.tube(RINGS, SIDES, LENGTH, lambda angle: shapes.circle(angle, 1.0))
    points = points[:, [1, 2, 0]]  # from the x axis to the z axis
    u, turn = points[:, 2] / LENGTH, np.arctan2(points[:, 1], points[:, 0])
    inside = np.abs(turn) < 0.5
    suckers, scales = np.maximum(np.cos(60 * pi * u**0.8), 0), np.cos(90 * pi * u) * np.cos(6 * turn)
    relief = np.where(inside, 0.25 * suckers, 0.04 * scales)
    points[:, :2] *= ((0.5 - 0.42 * u) * (1 + relief * (u < 0.98)))[:, None]
    return points, faces, np.where(inside[:, None], (0.85, 0.66, 0.5), (0.62, 0.24, 0.16))


def pulled():
    """(object, curve, its points at rest)"""
    points, faces, colours = tentacle()
    ob = studio.add_object("Tentacle", points, faces, colours)
    studio.activate(ob)
    ob.data.vertices.foreach_set('select', points[:, 2] > ROOT)
    ob.data.edges.foreach_set('select', np.zeros(len(ob.data.edges), bool))
    ob.data.polygons.foreach_set('select', np.zeros(len(ob.data.polygons), bool))
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.object.detail_deform_pull_curve(points=COUNT, radius=0.8)
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    curve = bpy.context.view_layer.objects.active
    return ob, curve, [curve.matrix_world @ p.co for p in curve.data.splines[0].bezier_points]


def along(curvature):
    """Places of the points where the curve has this curvature, a function of its length, in the plane of x and z."""
    lengths = np.linspace(0, LENGTH - ROOT, 400)
    angles = np.concatenate([[0], np.cumsum(curvature(lengths)[:-1] * np.diff(lengths))])
    steps = np.stack([np.sin(angles), np.cos(angles)]) * (lengths[1] - lengths[0])
    x, z = np.cumsum(steps, axis=1) - steps
    at = np.linspace(0, len(lengths) - 1, COUNT).astype(int)
    return [Vector((x[k], 0, ROOT + z[k])) for k in at]


def pose(curve, places, tilts=0.0, radii=1.0):
    points = curve.data.splines[0].bezier_points
    for point, place, tilt, radius in zip(points, places, np.broadcast_to(tilts, COUNT), np.broadcast_to(radii, COUNT)):
        point.co, point.tilt, point.radius = curve.matrix_world.inverted() @ place, tilt, radius
    bpy.context.view_layer.update()


def main():
    detail_deform.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    studio.prepare_limbs()
    _, curve, rest = pulled()
    whole = LENGTH - ROOT
    share = np.linspace(0, 1, COUNT)
    row = []
    for places, tilts, radii in (
            (rest, 0.0, 1.0),
            (along(lambda s: 1.6 * np.sin(2 * pi * s / whole)), 0.0, 1.0),
            (along(lambda s: 0.35 + 2.1 * (s / whole)**2), 0.0, 1.0),
            (rest, 4 * pi * share, 1.0),
            (rest, 0.0, 1 + 1.6 * np.exp(-((share - 0.55) / 0.15)**2))):
        pose(curve, places, tilts, radii)
        studio.look((1.3, -14, 3.6), (1.3, 0, 3.0), 74)
        row.append(studio.on_paper(studio.picture(SIZE)))
    studio.save(studio.sheet([row]), HERE.parents[1] / "addon" / "manual" / "curve.jpg")


main()
