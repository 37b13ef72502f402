# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions by which make_manual.py arranges Blender's window, drives it and takes pictures of it."""

import os
import subprocess
import traceback
from pathlib import Path

import bpy
from mathutils import Vector

OUT = Path(__file__).resolve().parents[2] / 'addon' / 'manual'
PANEL_WIDTH = 440  # of the Properties editor, pixels
PATH_HEIGHT = 26  # the object's name above the panels
VIEW_ONLY = ('-shave', '0x150', '-resize', '560x', '-quality', '75')  # without its header


def window():
    return bpy.context.window_manager.windows[0]


def area(kind):
    return next(a for a in window().screen.areas if a.type == kind)


def in_area(kind):
    where = area(kind)
    return bpy.context.temp_override(window=window(), area=where,
                                     region=next(r for r in where.regions if r.type == 'WINDOW'))


def picture(name, kinds, options):
    """A picture of areas that lie side by side, cut at the highest of their lower edges. options: of convert."""
    areas = [area(kind) for kind in kinds]
    left, bottom = min(a.x for a in areas), max(a.y for a in areas)
    width, height = max(a.x + a.width for a in areas) - left, max(a.y + a.height for a in areas) - bottom
    shot = subprocess.run(['import', '-window', 'root', 'png:-'], check=True, capture_output=True).stdout
    crop = f'{width}x{height}+{left}+{window().height - bottom - height}'
    subprocess.run(['convert', 'png:-', '-crop', crop, '+repage', *options, '-strip', str(OUT / name)], check=True,
                   input=shot)


def panel_picture(name):
    """A picture of the panels alone, without the tabs, the search field, the path and the empty rest."""
    region = next(r for r in area('PROPERTIES').regions if r.type == 'WINDOW')
    top = window().height - region.y - region.height + PATH_HEIGHT
    shot = subprocess.run(['import', '-window', 'root', 'png:-'], check=True, capture_output=True).stdout
    crop = f'{region.width}x{region.height - PATH_HEIGHT - 20}+{region.x}+{top}'
    trim = ('-trim', '+repage')  # twice: beside the scroll bar's edge, and below the panels
    subprocess.run(['convert', 'png:-', '-crop', crop, '+repage', *trim, *trim, '+dither', '-colors', '128',
                    '-strip', str(OUT / name)], check=True, input=shot)


def number(name, places):
    """Writes 1, 2, ... beside a picture, at these heights of it."""
    path, drawn = str(OUT / name), []
    font = subprocess.run(['fc-match', '-f', '%{file}', 'sans'], check=True, capture_output=True, text=True).stdout
    for count, y in enumerate(places, 1):
        drawn += ['-fill', '#4772b3', '-draw', f'circle 18,{y} 18,{y - 11}', '-fill', 'white', '-pointsize', '15',
                  '-annotate', f'+{13 if count < 10 else 9}+{y - 8}', str(count)]
    subprocess.run(['convert', path, '-background', '#1d1d1d', '-gravity', 'West', '-splice', '36x0', '-gravity',
                    'NorthWest', '-font', font, *drawn, '+dither', '-colors', '128', '-strip',
                    path], check=True)


def run(steps):
    """Runs a script's steps and ends Blender. steps: a generator of the seconds to wait before the next one, in which
    Blender handles its events."""
    def go_on():
        try:
            return next(steps)
        except StopIteration:
            os._exit(0)
        except Exception:
            traceback.print_exc()
            os._exit(1)

    bpy.app.timers.register(go_on, first_interval=1.0, persistent=True)


def settle():
    """Waits until the window shows the present state."""
    for _ in range(3):
        for shown in window().screen.areas:
            shown.tag_redraw()
        yield 0.3


def drag(start, end):
    """Drags with the mouse. Places are counted from the bottom left corner of the window."""
    for words in (('mousemove', *start), ('mousedown', 1), ('mousemove', *end), ('mouseup', 1)):
        if words[0] == 'mousemove':
            words = (*words[:2], window().height - words[2])
        subprocess.run(['xdotool', *map(str, words)], check=True)
        yield 0.3


def arrange():
    """A wide Properties editor under a low outliner."""
    side = area('PROPERTIES')
    yield from drag((side.x - 1, side.y + 100), (side.x + side.width - PANEL_WIDTH, side.y + 100))
    side = area('PROPERTIES')
    yield from drag((side.x + 200, side.y + side.height), (side.x + 200, window().height - 60))
    area('PROPERTIES').spaces[0].context = 'MODIFIER'
    view = area('VIEW_3D').spaces[0]
    view.show_region_toolbar = view.show_region_ui = view.show_gizmo = False
    view.overlay.show_cursor = view.overlay.show_floor = view.overlay.show_axis_y = view.overlay.show_axis_x = False


def _below(cls):
    return [found for one in cls.__subclasses__() for found in (one, *_below(one))]


def show_only(*classes):
    """Shows these panels alone, open, below the path."""
    for cls in _below(bpy.types.Panel):
        if cls.is_registered and getattr(cls, 'bl_context', "") in {'modifier', 'object'}:
            bpy.utils.unregister_class(cls)
    for cls in classes:
        if getattr(cls, 'bl_parent_id', "") and cls.bl_parent_id not in {c.__name__ for c in classes}:
            del cls.bl_parent_id
        bpy.utils.register_class(cls)


def activate(ob):
    bpy.context.view_layer.update()
    for other in bpy.context.view_layer.objects:
        other.select_set(other == ob)
    bpy.context.view_layer.objects.active = ob


def look(eye, at, lens=60):
    view = area('VIEW_3D').spaces[0]
    region = view.region_3d
    turn = (Vector(eye) - Vector(at)).to_track_quat('Z', 'Y')
    region.view_perspective, view.lens = 'PERSP', lens
    region.view_location, region.view_rotation = at, turn
    region.view_distance = (Vector(eye) - Vector(at)).length
