# SPDX-License-Identifier: GPL-3.0-or-later
"""What the walks share: where things are in the window, events that are sent to it, screenshots and checks."""

import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[3]
OUT = Path(sys.argv[sys.argv.index('--') + 1]).resolve()
# The engine that came with 4.2 had another name until it was the only one.
EEVEE = 'BLENDER_EEVEE_NEXT' if (4, 2) <= bpy.app.version < (5, 0) else 'BLENDER_EEVEE'
_LIMIT_SECONDS = 180  # for what takes a moment, on a machine that is as busy as can be
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


def arrange():
    """The desk as the walks expect it: Blender's reports in view, and nothing in the way."""
    preferences = bpy.context.preferences
    preferences.view.show_splash = False
    preferences.view.smooth_view = 0  # ms that a view takes to get where it is asked to
    preferences.system.viewport_aa = 'OFF'  # without a graphics card smooth edges take longer than all else
    for each in bpy.context.window_manager.windows[0].screen.areas:
        if each.type == 'OUTLINER':
            each.type = 'INFO'


def new_scene():
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    arrange()  # whether this brings its own desk depends on what was opened before
    yield from settle()


def show_modifiers(ob):
    """The tab is there only once the mesh has been drawn."""
    activate(ob)
    area('PROPERTIES').spaces[0].context = 'MODIFIER'


def is_drawn(panel):
    """Whether a panel of the add-on is seen, and open: what of another tab or closed isn't drawn."""
    kind, drawn = getattr(bpy.types, panel), []
    draw = kind.draw

    def noted(self, context):
        drawn.append(self)
        draw(self, context)

    kind.draw = noted
    for each in bpy.context.window_manager.windows[0].screen.areas:
        each.tag_redraw()
    yield from settle()
    kind.draw = draw
    return bool(drawn)


def show_sidebar(panel):
    """The viewport's, with the tab of this panel. Blender tells nobody where a tab is, and 5.2 has one more, named
    Animation, above the add-on's: each is tried in turn."""
    area('VIEW_3D').spaces.active.show_region_ui = True
    yield from settle()
    for y in range(80, 400, 30):
        if (yield from is_drawn(panel)):
            return
        yield from click_in_view(13, y)


def click_in_view(x, y):
    """x, y: pixels from the viewport's right upper corner."""
    where, window = area('VIEW_3D'), bpy.context.window_manager.windows[0]
    xdotool('mousemove', where.x + where.width - x, window.height - where.y - where.height + y)
    yield from settle()
    xdotool('click', 1)
    yield from settle()


def in_view():
    window, view = bpy.context.window_manager.windows[0], area('VIEW_3D')
    return bpy.context.temp_override(window=window, area=view,
                                     region=next(r for r in view.regions if r.type == 'WINDOW'))


def activate(ob):
    for other in bpy.context.view_layer.objects:
        other.select_set(other == ob)
    bpy.context.view_layer.objects.active = ob


def settle():
    """Until what was sent or set is acted on and drawn: each of these takes a turn of Blender's loop, or two, and on a
    busy machine a turn takes longer than the pause that is asked for."""
    for _ in range(5):
        yield 0.04


def wait_until(condition):
    end = time.monotonic() + _LIMIT_SECONDS
    while not condition() and time.monotonic() < end:
        yield 0.05


def expect(what, condition):
    """A check of what comes about in a while."""
    yield from wait_until(condition)
    check(what, condition())


def call_pull():
    with in_view():
        bpy.ops.object.detail_deform_pull('INVOKE_DEFAULT')
    yield from settle()


def in_hand():
    """Whether Pull has ended, with the empty going with the mouse."""
    ob = bpy.context.active_object
    return ob is not None and ob.type == 'EMPTY' and surface()[0].detail_deform.is_bound
