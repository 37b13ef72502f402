# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual's pictures of the tool Pull in Sculpt Mode, made by the mouse."""

import bpy
import numpy as np

from detail_deform.scene import mesh_data, sculpted
from manual_start import shoot, xdotool
from manual_window import activate, area, in_area, look, settle, window

BRUSH = 165  # radius in pixels


def make(root):
    bpy.ops.wm.open_mainfile(filepath=str(root / 'blend_fixtures' / 'suzanne.blend'), load_ui=False)
    yield 1.0
    ob = bpy.data.objects["Suzanne"]
    activate(ob)
    bpy.ops.object.detail_deform_remove()
    for other in [other for other in bpy.data.objects if other.type in {'EMPTY', 'CAMERA'}]:
        bpy.data.objects.remove(other)
    view = area('VIEW_3D').spaces[0]
    overlay = view.overlay
    overlay.show_cursor = overlay.show_floor = overlay.show_axis_y = overlay.show_axis_x = overlay.show_text = False
    view.show_gizmo = view.show_region_toolbar = False
    look((-1.1, -3.4, 0.6), (-0.7, 0, 0.3), 62)
    with in_area('VIEW_3D'):
        bpy.ops.object.mode_set(mode='SCULPT')
        bpy.ops.wm.tool_set_by_id(name='detail_deform.brush_pull')
    bpy.context.tool_settings.unified_paint_settings.size = BRUSH
    yield from settle()
    with in_area('VIEW_3D'):
        bpy.ops.paint.mask_flood_fill(mode='VALUE', value=1.0)  # makes the mask's layer
    _mask_brow(ob)
    yield from settle()
    tip = ob.matrix_world @ ob.data.vertices[int(mesh_data.positions(ob.data)[:, 0].argmin())].co
    x, y = _on_screen(tip)
    xdotool('mousemove', x + 45, y)
    yield 0.5
    yield from shoot('sculpt-1.jpg')
    xdotool('mousedown', 1)
    yield 0.5
    for _ in range(10):
        xdotool('mousemove_relative', '--', -6, -7)
        yield 0.1
    yield from shoot('sculpt-2.jpg')
    xdotool('mouseup', 1)
    yield 0.5


def _mask_brow(ob):
    points = mesh_data.positions(ob.data)
    values = np.clip(8 * (points[:, 2] - 0.3) * (points[:, 0] > -0.8), 0, 1).astype(np.float32)
    ob.data.vertex_paint_masks[0].data.foreach_set('value', values)
    assert sculpted.are_fixed(ob.data).any()
    ob.data.update_tag()


def _on_screen(point):
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    where = area('VIEW_3D')
    region = next(r for r in where.regions if r.type == 'WINDOW')
    x, y = location_3d_to_region_2d(region, where.spaces.active.region_3d, point)
    return int(region.x + x), int(window().height - region.y - y)
