# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for drags in the viewport: a handle is made or selected, Blender's own Move runs until the button is
released, and Edit Mode is entered again if the drag began there; for Pull, only Move and that return. They are macros,
as only macros pass on the event from which Move knows the button."""

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty

from ..scene import selection
from ..setup import handle_setup
from . import edit_again
from .operator_base import HandleEmptyOperator, told
from .pull_operator import FALLOFF, RADIUS, PullOperator


class OBJECT_OT_detail_deform_pull_begin(PullOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_pull_begin'
    bl_label = "Pull Selected"
    bl_description = "Pull the selected vertices with Detail Deform; where none is selected, box select"
    bl_options = {'REGISTER', 'UNDO', 'INTERNAL'}

    radius: FloatProperty(**RADIUS)
    falloff: EnumProperty(**FALLOFF)

    def invoke(self, context, event):
        if context.active_object.type != 'MESH' or selection.selected(context.active_object).any():
            return self.execute(context)
        bpy.ops.view3d.select_box('INVOKE_DEFAULT', wait_for_input=False)
        return {'CANCELLED'}

    def execute(self, context):
        edit_again.remember_edit_mode(context)
        try:
            return bpy.ops.object.detail_deform_pull(radius=self.radius, falloff=self.falloff)
        except RuntimeError as problem:
            self.report({'ERROR'}, told(problem))
            return {'CANCELLED'}


class OBJECT_OT_detail_deform_handle_take(HandleEmptyOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_handle_take'
    bl_label = "Take Handle"
    bl_description = "Select the empty of a handle alone, also from another handle's empty"
    bl_options = {'REGISTER', 'UNDO', 'INTERNAL'}

    index: IntProperty(name="Index", default=0, min=0, options={'SKIP_SAVE'}, description="Number of the handle")

    def run(self, context, ob):
        empty = handle_setup.empty_of(ob, self.index)
        ob.detail_deform.handle_index = self.index
        edit_again.remember_edit_mode(context)
        if edit_again.began_in_edit_mode():
            selection.change_mode(ob, 'OBJECT')
        selection.activate(context, empty)


class OBJECT_OT_detail_deform_pull_drag(bpy.types.Macro):
    bl_idname = 'object.detail_deform_pull_drag'
    bl_label = "Pull"
    bl_description = "Pull the selected vertices with Detail Deform by a drag"
    bl_options = {'REGISTER', 'UNDO'}


class OBJECT_OT_detail_deform_handle_drag(bpy.types.Macro):
    bl_idname = 'object.detail_deform_handle_drag'
    bl_label = "Move Handle"
    bl_description = "Select the handle's empty, and move it by a drag"
    bl_options = {'REGISTER', 'UNDO'}


class OBJECT_OT_detail_deform_move_pulled(bpy.types.Macro):
    bl_idname = 'object.detail_deform_move_pulled'
    bl_label = "Move"
    bl_description = "Move the empty of what was pulled, and go on in Edit Mode"
    bl_options = {'REGISTER', 'UNDO', 'INTERNAL'}


_BEGINNINGS = {OBJECT_OT_detail_deform_pull_drag: OBJECT_OT_detail_deform_pull_begin,
               OBJECT_OT_detail_deform_handle_drag: OBJECT_OT_detail_deform_handle_take}
CLASSES = (*_BEGINNINGS.values(), *_BEGINNINGS, OBJECT_OT_detail_deform_move_pulled)
_register_classes, _unregister_classes = bpy.utils.register_classes_factory(CLASSES)


def register():
    edit_again.register()
    _register_classes()
    for macro, beginning in _BEGINNINGS.items():
        macro.define(beginning.__name__)
        macro.define('TRANSFORM_OT_translate').properties.release_confirm = True
        macro.define(edit_again.OBJECT_OT_detail_deform_edit_again.__name__)
    OBJECT_OT_detail_deform_move_pulled.define('TRANSFORM_OT_translate')
    OBJECT_OT_detail_deform_move_pulled.define(edit_again.OBJECT_OT_detail_deform_edit_again.__name__)


def unregister():
    _unregister_classes()
    edit_again.unregister()
