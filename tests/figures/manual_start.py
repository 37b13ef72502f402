# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual's first deformation in six pictures, made by keys and the mouse as an artist makes it."""

import subprocess

import bpy
import numpy as np

from manual_window import activate, area, look, picture, settle, window

STEP = ('-shave', '2x2', '-resize', '480x', '-quality', '80')
PULL = (-90, 421)  # place of the menu's entry, pixels from where the menu was opened


def xdotool(*words):
    subprocess.run(['xdotool', *map(str, words)], check=True)


def to_mouse(x, y):
    """Moves the mouse to a place counted from the viewport's bottom left corner."""
    view = area('VIEW_3D')
    xdotool('mousemove', view.x + x, window().height - view.y - y)


def make(root):
    bpy.ops.wm.open_mainfile(filepath=str(root / 'blend_fixtures' / 'suzanne.blend'), load_ui=False)
    yield 1.0
    ob = bpy.data.objects["Suzanne"]
    activate(ob)
    ear = np.array([vertex.co.x < -1.2 for vertex in ob.data.vertices])
    bpy.ops.object.detail_deform_remove()
    for empty in [other for other in bpy.data.objects if other.type == 'EMPTY']:
        bpy.data.objects.remove(empty)
    ob.vertex_groups.clear()
    view = area('VIEW_3D').spaces[0]
    view.overlay.show_cursor = view.overlay.show_floor = view.overlay.show_axis_y = view.overlay.show_axis_x = False
    view.show_gizmo = view.show_region_toolbar = False
    bpy.context.preferences.themes[0].view_3d.wire_edit = (0.32, 0.32, 0.32)  # lighter, as the mesh is dense
    for camera in [other for other in bpy.data.objects if other.type == 'CAMERA']:
        camera.hide_set(True)
    look((-1.4, -4.2, 0.9), (-0.75, 0, 0.35), 62)
    bpy.context.scene.tool_settings.mesh_select_mode = (False, False, True)  # faces, which have no dots
    select(ob.data, ear)
    to_mouse(330, 700)
    yield 0.5
    xdotool('key', 'Tab')
    yield from shoot('start-1.jpg')
    xdotool('click', 3)
    yield 0.7
    xdotool('mousemove_relative', '--', *PULL)
    yield from shoot('start-2.jpg')
    xdotool('click', 1)
    yield 1.0
    yield from shoot('start-3.jpg')
    for _ in range(4):
        xdotool('mousemove_relative', '--', 12, 0)
        yield 0.1
    xdotool('click', 1)
    for _ in range(40):  # until it is bound
        yield 0.2
        if bpy.context.active_object != ob:
            break
    yield 0.5
    yield from shoot('start-4.jpg')
    for _ in range(8):
        xdotool('mousemove_relative', '--', -7, -11)
        yield 0.1
    xdotool('click', 1)
    yield 1.0
    yield from shoot('start-5.jpg')
    xdotool('key', 'r', '4', '5')
    yield 0.5
    yield from shoot('start-6.jpg')
    xdotool('key', 'Return')
    yield 0.5


def select(mesh, chosen):
    corners = [all(chosen[list(face.vertices)]) for face in mesh.polygons]
    edges = [all(chosen[list(edge.vertices)]) for edge in mesh.edges]
    for elements, flags in ((mesh.vertices, chosen), (mesh.edges, edges), (mesh.polygons, corners)):
        elements.foreach_set('select', flags)


def shoot(name):
    yield from settle()
    picture(name, ('VIEW_3D',), STEP)
