# SPDX-License-Identifier: GPL-3.0-or-later
"""Pulls an ear of Suzanne with Multires, sculpts on the posed surface, and moves the handle on."""

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d

from everyday import select
from desk import (activate, area, call_pull, check, coordinates, evaluated, expect, in_hand, in_view, new_scene,
                  point_at, screenshot, settle, show_modifiers, surface, wait_until, xdotool)

_LEVELS = 3


def _sculpted():
    """Suzanne with three levels of Multires and a scaly relief, an ear selected in Edit Mode."""
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        ob = bpy.context.active_object
        ob.modifiers.new("Multires", 'MULTIRES')
        for _ in range(_LEVELS):
            bpy.ops.object.multires_subdivide(modifier="Multires", mode='CATMULL_CLARK')
        ob.data.polygons.foreach_set('use_smooth', [True] * len(ob.data.polygons))
        bpy.context.view_layer.update()
        mesh = bpy.data.meshes.new_from_object(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()))
        points, normals = coordinates(mesh), np.array([vertex.normal for vertex in mesh.vertices])
        bumps = 0.012 * np.prod(np.sin(25 * points), axis=1, keepdims=True) ** 2 * 6
        mesh.vertices.foreach_set('co', (points + bumps * normals).astype(np.float32).ravel())
        mesh.update()
        relief = bpy.data.objects.new("Relief", mesh)
        bpy.context.scene.collection.objects.link(relief)
        relief.select_set(True)
        bpy.context.view_layer.update()
        bpy.ops.object.multires_reshape(modifier="Multires")
        bpy.data.objects.remove(relief)
        bpy.context.view_layer.update()
        activate(ob)
        bpy.ops.view3d.view_axis(type='FRONT')
        bpy.ops.view3d.view_selected()
    select(ob, coordinates(ob.data)[:, 0] > 1.2)


def pulling_a_sculpt():
    yield from new_scene()
    _sculpted()
    point_at('VIEW_3D')
    yield from settle()
    screenshot('sculpt-editing')
    yield from call_pull()
    screenshot('sculpt-choosing')
    xdotool('key', 'Return')
    yield from wait_until(in_hand)
    yield from settle()
    xdotool('key', 'Escape')
    yield from settle()
    ob, empty = surface()
    rest = evaluated(ob)
    empty.location.z += 0.5
    empty.rotation_euler.y -= 0.9
    yield from expect("a key shows the pull", lambda: np.abs(evaluated(ob) - rest).max() > 0.4)
    check("and what was sculpted goes with it", ob.data.shape_keys.key_blocks[-1].name == 'Detail Deform')
    activate(ob)
    yield from settle()
    show_modifiers(ob)
    yield from settle()
    screenshot('sculpt-pulled')
    with in_view():
        bpy.ops.object.mode_set(mode='EDIT')
    yield from settle()
    screenshot('sculpt-pulled-editing')
    with in_view():
        bpy.ops.object.mode_set(mode='OBJECT')


def _ear():
    """The middle of the pulled ear, in pixels from the screen's upper left corner."""
    _, empty = surface()
    where, window = area('VIEW_3D'), bpy.context.window_manager.windows[0]
    region = next(region for region in where.regions if region.type == 'WINDOW')
    x, y = location_3d_to_region_2d(region, where.spaces.active.region_3d, empty.matrix_world.translation * 0.9)
    return region.x + x, window.height - region.y - y


def sculpting_on():
    """A stroke across the posed ear changes what is there, and goes with the ear when that is pulled on."""
    ob, empty = surface()
    activate(ob)
    before = evaluated(ob)
    with in_view():
        bpy.ops.object.mode_set(mode='SCULPT')
    yield from settle()
    x, y = _ear()
    xdotool('mousemove', int(x) - 20, int(y))
    yield from settle()
    xdotool('mousedown', 1)
    for step in range(8):
        xdotool('mousemove', int(x) - 20 + 4 * step, int(y))
        yield 0.05
    xdotool('mouseup', 1)
    yield from settle()
    screenshot('sculpt-brushed')
    with in_view():
        bpy.ops.object.mode_set(mode='OBJECT')
    yield from settle()
    brushed = np.linalg.norm(evaluated(ob) - before, axis=1)
    check("a brush works on the posed surface", 1e-3 < brushed.max() < 0.3)
    at = np.linalg.norm(before[brushed.argmax()] - np.array(empty.matrix_world.translation))
    check("where it is seen", at < 0.4)
    posed = evaluated(ob)
    empty.location.z -= 0.5
    empty.rotation_euler.y += 0.9
    yield from expect("and goes with it", lambda: np.abs(evaluated(ob) - posed).max() > 0.4)
    yield from settle()
    screenshot('sculpt-back')
    most = brushed.argsort()[-200:]
    rest, now = (points[most] - points[most].mean(axis=0) for points in (posed, evaluated(ob)))
    left, _, right = np.linalg.svd(now.T @ rest)
    check("turned and in its shape", np.abs(rest @ (left @ right).T - now).max() < 0.3 * np.ptp(rest, axis=0).max())
