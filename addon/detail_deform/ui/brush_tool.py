# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull in Sculpt Mode's toolbar: a drag on the surface pulls what is under the brush."""

import bpy

from ..scene import brush_circle, brush_size

_PULL = 'object.detail_deform_brush_pull'


class DetailDeformBrushPull(bpy.types.WorkSpaceTool):
    bl_space_type = 'VIEW_3D'
    bl_context_mode = 'SCULPT'
    bl_idname = 'detail_deform.brush_pull'
    bl_label = "Pull (Detail Deform)"
    bl_description = ("Drag the surface: what is under the brush becomes a handle, and what is in the circle follows "
                      "with its details. What is masked stays")
    bl_icon = 'ops.gpencil.edit_bend'
    bl_keymap = ((_PULL, {'type': 'LEFTMOUSE', 'value': 'PRESS'}, None),)

    def draw_cursor(context, tool, place):
        brush_circle.draw(context, place)

    def draw_settings(context, layout, tool):
        properties = tool.operator_properties(_PULL)
        layout.prop(*brush_size.size_property(context), text="Size")
        for name in ('hold', 'handle_size', 'falloff', 'turns'):
            row = layout.row()
            row.active = name != 'handle_size' or properties.hold == 'BRUSH'
            row.prop(properties, name)
        ob = context.active_object
        if ob and ob.detail_deform.handles:
            button = layout.operator('object.detail_deform_apply', text="Apply", icon='CHECKMARK')
            button.mode, button.remove_handles = 'MESH', True
        else:
            layout.prop(properties, 'apply')


def register():
    bpy.utils.register_tool(DetailDeformBrushPull, separator=True)


def unregister():
    bpy.utils.unregister_tool(DetailDeformBrushPull)
