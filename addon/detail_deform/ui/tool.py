# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull in Edit Mode's toolbar: a press selects, a drag pulls."""

import bpy

_PULL = 'object.detail_deform_pull_drag'
_SELECT = 'view3d.select'


class DetailDeformPull(bpy.types.WorkSpaceTool):
    bl_space_type = 'VIEW_3D'
    bl_context_mode = 'EDIT_MESH'
    bl_idname = 'detail_deform.pull'
    bl_label = "Pull (Detail Deform)"
    bl_description = ("Drag a vertex, or those that are selected: they become a handle, and the surface around follows "
                      "with its details")
    bl_icon = 'ops.gpencil.edit_bend'
    # As Blender's Tweak: a drag moves the element under the mouse, or the whole selection if the element is selected.
    bl_keymap = (
        (_SELECT, {'type': 'LEFTMOUSE', 'value': 'PRESS'},
         {'properties': [('deselect_all', True), ('select_passthrough', True)]}),
        (_SELECT, {'type': 'LEFTMOUSE', 'value': 'CLICK'}, {'properties': [('deselect_all', True)]}),
        (_SELECT, {'type': 'LEFTMOUSE', 'value': 'PRESS', 'shift': True}, {'properties': [('toggle', True)]}),
        (_PULL, {'type': 'LEFTMOUSE', 'value': 'CLICK_DRAG'}, None),
    )

    def draw_settings(context, layout, tool):
        properties = tool.operator_properties(_PULL).OBJECT_OT_detail_deform_pull_begin
        layout.prop(properties, 'radius')
        layout.prop(properties, 'falloff')


def is_active(context):
    """Whether this is the active tool of Edit Mode."""
    active = context.workspace and context.workspace.tools.from_space_view3d_mode('EDIT_MESH', create=False)
    return active is not None and active.idname == DetailDeformPull.bl_idname


def register():
    bpy.utils.register_tool(DetailDeformPull, separator=True)


def unregister():
    bpy.utils.unregister_tool(DetailDeformPull)
