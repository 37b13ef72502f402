# SPDX-License-Identifier: GPL-3.0-or-later
"""What the walks share: where things are in the window, events that are sent to it, screenshots and checks."""

import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[3]
OUT = Path(sys.argv[sys.argv.index('--') + 1]).resolve()
failures = []


def check(what, holds):
    print(('ok    ' if holds else 'FAILED ') + what, flush=True)
    if not holds:
        failures.append(what)


def xdotool(*words):
    subprocess.run(['xdotool', *map(str, words)], check=True)


def screenshot(name):
    subprocess.run(['import', '-window', 'root', str(OUT / f'{name}.png')], check=True)


def surface():
    """The mesh with the handle, and its empty. Python references don't outlive undo and loading."""
    ob = next(o for o in bpy.data.objects if o.type == 'MESH' and o.detail_deform.handles)
    return ob, ob.detail_deform.handles[0].target


def coordinates(mesh):
    values = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get('co', values)
    return values.reshape(-1, 3).astype(float)


def evaluated(ob):
    return coordinates(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data)


def offsets():
    ob, _ = surface()
    return evaluated(ob) - coordinates(ob.data)


def held():
    """(n,) bool: the handle's vertices."""
    ob, _ = surface()
    index = ob.vertex_groups[ob.detail_deform.handles[0].vertex_group].index
    return np.array([any(g.group == index and g.weight > 0.5 for g in v.groups) for v in ob.data.vertices])


def area(kind):
    return next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == kind)


def point_at(kind):
    where = area(kind)
    window = bpy.context.window_manager.windows[0]
    xdotool('mousemove', where.x + where.width // 2, window.height - where.y - where.height // 2)


def show_sidebar():
    area('VIEW_3D').spaces.active.show_region_ui = True


def click_in_view(x, y):
    """x, y: pixels from the viewport's right upper corner."""
    where, window = area('VIEW_3D'), bpy.context.window_manager.windows[0]
    xdotool('mousemove', where.x + where.width - x, window.height - where.y - where.height + y)
    yield 0.3
    xdotool('click', 1)
    yield 0.5


def in_view():
    window, view = bpy.context.window_manager.windows[0], area('VIEW_3D')
    return bpy.context.temp_override(window=window, area=view,
                                     region=next(r for r in view.regions if r.type == 'WINDOW'))


def activate(ob):
    for other in bpy.context.view_layer.objects:
        other.select_set(other == ob)
    bpy.context.view_layer.objects.active = ob


def wait_until(condition, seconds=30):
    for _ in range(int(10 * seconds)):
        if condition():
            return
        yield 0.1


def call_pull():
    with in_view():
        bpy.ops.object.detail_deform_pull('INVOKE_DEFAULT')
    yield 0.4


def in_hand():
    """Whether Pull has ended, with the empty going with the mouse."""
    ob = bpy.context.active_object
    return ob is not None and ob.type == 'EMPTY' and surface()[0].detail_deform.is_bound
