# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user sees."""

import bpy


def redraw_panels():
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {'PROPERTIES', 'VIEW_3D'}:
                area.tag_redraw()
