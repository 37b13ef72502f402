# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user sees."""

import bpy


def local_views(ob, depsgraph):
    """The 3D views that show this object and few others alone. What local_view_get() says is no in 3.4, always."""
    evaluated = ob.evaluated_get(depsgraph)
    spaces = (area.spaces.active for window in bpy.context.window_manager.windows for area in window.screen.areas
              if area.type == 'VIEW_3D')
    return [space for space in spaces if space.local_view and evaluated.visible_in_viewport_get(space)]


def redraw_panels():
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {'PROPERTIES', 'VIEW_3D'}:
                area.tag_redraw()
