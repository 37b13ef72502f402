# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows, 3D views and panels."""

import bpy


def local_views(ob, depsgraph):
    """[SpaceView3D]: the views that show this object in Local View. In 3.4 Object.local_view_get() always returns
    False."""
    evaluated = ob.evaluated_get(depsgraph)
    spaces = (area.spaces.active for window in bpy.context.window_manager.windows for area in window.screen.areas
              if area.type == 'VIEW_3D')
    return [space for space in spaces if space.local_view and evaluated.visible_in_viewport_get(space)]


def redraw_panels():
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {'PROPERTIES', 'VIEW_3D'}:
                area.tag_redraw()
