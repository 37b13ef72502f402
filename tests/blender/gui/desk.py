# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared by the walks: places in the window, events that are sent to it, screenshots and checks."""

import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[3]
OUT = Path(sys.argv[sys.argv.index('--') + 1]).resolve()
# EEVEE Next, which came with 4.2, has EEVEE's name from 5.0 on.
EEVEE = 'BLENDER_EEVEE_NEXT' if (4, 2) <= bpy.app.version < (5, 0) else 'BLENDER_EEVEE'
_LIMIT_SECONDS = 180  # for conditions that take a moment, on a very busy machine
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
    """(mesh object with a handle, its empty), looked up anew, because undo and loading invalidate references."""
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
    """Arranges the window for the walks: an Info editor with Blender's reports, and no splash screen."""
    preferences = bpy.context.preferences
    preferences.view.show_splash = False
    preferences.view.smooth_view = 0  # ms of a view's animated motion
    preferences.system.viewport_aa = 'OFF'  # without a graphics card anti-aliasing takes longer than all else
    for each in bpy.context.window_manager.windows[0].screen.areas:
        if each.type == 'OUTLINER':
            each.type = 'INFO'


def new_scene():
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    arrange()  # read_homefile() may have reset the window, depending on the file that was open
    yield from settle()


def show_modifiers(ob):
    """Shows the Modifiers tab. It exists only after the Properties editor has been drawn with the mesh."""
    activate(ob)
    area('PROPERTIES').spaces[0].context = 'MODIFIER'


def is_drawn(panel):
    """Whether a panel of the add-on is visible and open: Blender doesn't draw closed panels and those in other tabs."""
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
    """Opens the viewport's sidebar with the tab of this panel. The place of a tab is unknown to scripts, and 5.2 has
    one more, Animation, above the add-on's: each place is clicked in turn."""
    area('VIEW_3D').spaces.active.show_region_ui = True
    yield from settle()
    for y in range(80, 400, 30):
        if (yield from is_drawn(panel)):
            return
        yield from click_in_view(13, y)


def click_in_view(x, y):
    """Clicks. x, y: pixels from the viewport's upper right corner."""
    yield from point_in_view(x, y)
    xdotool('click', 1)
    yield from settle()


def click_button(x, operator):
    """Clicks the button of an operator in the sidebar, x pixels from its right side. The place of a button is unknown
    to scripts, and depends on how many lines the status above it takes; but Ctrl C copies its command."""
    manager = bpy.context.window_manager
    for y in range(100, area('VIEW_3D').height, 12):
        manager.clipboard = ""
        yield from point_in_view(x, y)
        xdotool('key', 'ctrl+c')
        yield from settle()
        if operator in manager.clipboard:
            yield from click_in_view(x, y)
            return
    check(f"there is a button for {operator}", False)


def point_in_view(x, y):
    """Moves the pointer. x, y: pixels from the viewport's upper right corner."""
    where, window = area('VIEW_3D'), bpy.context.window_manager.windows[0]
    xdotool('mousemove', where.x + where.width - x, window.height - where.y - where.height + y)
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
    """Waits until Blender has handled events and drawn: each takes one or two turns of its event loop. Counted in
    turns, as on a busy machine a turn takes longer than the pause."""
    for _ in range(5):
        yield 0.04


def wait_until(condition):
    end = time.monotonic() + _LIMIT_SECONDS
    while not condition() and time.monotonic() < end:
        yield 0.05


def expect(what, condition):
    """Checks a condition that may take a while to hold."""
    yield from wait_until(condition)
    check(what, condition())


def call_pull():
    with in_view():
        bpy.ops.object.detail_deform_pull('INVOKE_DEFAULT')
    yield from settle()


def in_hand():
    """Whether Pull has ended and its empty is being moved by the mouse."""
    ob = bpy.context.active_object
    return ob is not None and ob.type == 'EMPTY' and surface()[0].detail_deform.is_bound
