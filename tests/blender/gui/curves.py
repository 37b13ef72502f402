# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull by Curve: a tentacle along a curve whose points are moved, tilted and scaled by keys."""

import bpy
import numpy as np

from desk import (activate, check, expect, in_view, new_scene, offsets, point_at, screenshot, settle, show_modifiers,
                  surface, xdotool)

ROOT = 0.6  # of the tentacle, 4 long along X; its vertices up to ROOT aren't selected


def tentacle(rings=160, around=48):
    x, angle = np.meshgrid(np.linspace(0, 4, rings), np.arange(around) * 2 * np.pi / around, indexing='ij')
    radius = (0.5 - 0.11 * x) * (1 + 0.08 * np.sin(22 * x) * np.cos(6 * angle))
    places = np.stack([x, radius * np.cos(angle), radius * np.sin(angle)], -1).reshape(-1, 3)
    faces = [(i * around + j, i * around + (j + 1) % around, (i + 1) * around + (j + 1) % around, (i + 1) * around + j)
             for i in range(rings - 1) for j in range(around)]
    mesh = bpy.data.meshes.new("Tentacle")
    mesh.from_pydata(places.tolist(), [], [*faces, tuple(range(around - 1, -1, -1)),
                                           tuple(range((rings - 1) * around, rings * around))])
    mesh.polygons.foreach_set('use_smooth', np.ones(len(mesh.polygons), bool))
    ob = bpy.data.objects.new("Tentacle", mesh)
    bpy.context.scene.collection.objects.link(ob)
    return ob


def tip():
    """How far the tentacle's tip has moved."""
    ob = surface()[0]
    return np.linalg.norm(offsets()[[v.co.x > 3.9 for v in ob.data.vertices]], axis=1).max()


def by_curve():
    """Makes a curve along a tentacle and bends it by its last point, undoes that, and twists it by tilt."""
    yield from new_scene()
    ob = tentacle()
    with in_view():
        bpy.context.view_layer.objects.active = ob
        ob.select_set(True)
        bpy.ops.view3d.view_axis(type='FRONT')
        bpy.ops.view3d.view_selected()
    ob.data.polygons.foreach_set('select', np.zeros(len(ob.data.polygons), bool))
    ob.data.edges.foreach_set('select', np.zeros(len(ob.data.edges), bool))
    ob.data.vertices.foreach_set('select', np.array([v.co.x > ROOT for v in ob.data.vertices]))
    yield from settle()
    show_modifiers(ob)
    point_at('VIEW_3D')
    yield from settle()
    xdotool('key', 'Tab')
    yield from settle()
    screenshot('curve-selected')
    with in_view():
        bpy.ops.object.detail_deform_pull_curve('INVOKE_DEFAULT')
    yield from settle()
    curve = bpy.context.active_object
    check("its curve is active", curve.type == 'CURVE')
    yield from expect("and it is bound in the background", lambda: surface()[0].detail_deform.is_bound)
    choose(curve, -1)
    point_at('VIEW_3D')
    xdotool('key', 'Tab')
    yield from settle()
    screenshot('curve-made')
    point_at('VIEW_3D')
    xdotool('key', 'g')
    yield from settle()
    for _ in range(12):
        xdotool('mousemove_relative', '--', -16, -14)
        yield 0.02
    yield from expect("the tentacle follows while its point is in the hand", lambda: tip() > 0.5)
    screenshot('curve-in-hand')
    xdotool('click', 1)
    yield from settle()
    bent = tip()
    xdotool('key', 'ctrl+z')
    yield from expect("undo straightens it", lambda: tip() < 1e-4)
    xdotool('key', 'ctrl+shift+z')
    yield from expect("redo bends it again", lambda: abs(tip() - bent) < 1e-3)
    xdotool('key', 'ctrl+t')
    yield from settle()
    for _ in range(12):
        xdotool('mousemove_relative', '--', 0, 16)
        yield 0.02
    xdotool('click', 1)
    yield from settle()
    curve = bpy.context.active_object
    check("its tilt twists", abs(curve.data.splines[0].bezier_points[-1].tilt) > 0.2 and tip() != bent)
    xdotool('key', 'alt+s')
    yield from settle()
    xdotool('key', '2', 'Return')
    yield from settle()
    xdotool('key', 'Tab')
    yield from settle()
    screenshot('curve-bent')
    activate(surface()[0])
    yield from settle()
    show_modifiers(surface()[0])
    yield from settle()
    screenshot('curve-panel')


def choose(curve, number):
    """Selects one control point, whole."""
    for point in curve.data.splines[0].bezier_points:
        point.select_control_point = point.select_left_handle = point.select_right_handle = False
    point = curve.data.splines[0].bezier_points[number]
    point.select_control_point = point.select_left_handle = point.select_right_handle = True
