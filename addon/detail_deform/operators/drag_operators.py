# SPDX-License-Identifier: GPL-3.0-or-later
"""What a drag in the viewport begins: a handle is made or taken, Blender's own Move goes on until the button is let go,
and who began in Edit Mode is there again. Macros, as only these hand the event on by which Move knows which button that
is."""

import bpy
from bpy.props import FloatProperty, IntProperty

from ..scene import selection
from ..setup import handle_setup
from .operator_base import HandOperator
from .pull_operator import RADIUS, PullOperator

_edited = []  # names of the objects that were in Edit Mode, the active one first


def _note_edited(context):
    active = context.active_object
    names = [ob.name for ob in context.objects_in_mode] if active and active.mode == 'EDIT' else []
    _edited[:] = sorted(names, key=lambda name: name != active.name)


class OBJECT_OT_detail_deform_pull_begin(PullOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_pull_begin'
    bl_label = "Pull Selected"
    bl_description = "Pull the selected vertices with Detail Deform; where none is selected, box select"
    bl_options = {'REGISTER', 'UNDO', 'INTERNAL'}

    radius: FloatProperty(**RADIUS)

    def invoke(self, context, event):
        if context.active_object.type != 'MESH' or selection.selected(context.active_object).any():
            return self.execute(context)
        bpy.ops.view3d.select_box('INVOKE_DEFAULT', wait_for_input=False)
        return {'CANCELLED'}

    def execute(self, context):
        _note_edited(context)
        try:
            return bpy.ops.object.detail_deform_pull(radius=self.radius)
        except RuntimeError as problem:
            self.report({'ERROR'}, str(problem).replace("Error: ", "", 1).strip())
            return {'CANCELLED'}


class OBJECT_OT_detail_deform_handle_take(HandOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_handle_take'
    bl_label = "Take Handle"
    bl_description = "Select the empty of a handle alone, also from another handle's empty"
    bl_options = {'REGISTER', 'UNDO', 'INTERNAL'}

    index: IntProperty(name="Index", default=0, min=0, options={'SKIP_SAVE'}, description="Number of the handle")

    def run(self, context, ob):
        empty = handle_setup.empty_of(ob, self.index)
        ob.detail_deform.handle_index = self.index
        _note_edited(context)
        if _edited:
            selection.change_mode(ob, 'OBJECT')
        selection.activate(context, empty)


class OBJECT_OT_detail_deform_edit_again(bpy.types.Operator):
    bl_idname = 'object.detail_deform_edit_again'
    bl_label = "Back to Edit Mode"
    bl_description = "Go on in Edit Mode, if the drag began there"
    bl_options = {'INTERNAL'}

    def execute(self, context):
        # Once the macro has ended: undo takes what is made in Object Mode for a step of its own, and Tab for another.
        if _edited and not bpy.app.background:
            bpy.app.timers.register(_edit_again)
        return {'FINISHED'}


def _edit_again():
    """Timer."""
    windows, names = bpy.context.window_manager.windows, list(_edited)
    _edited.clear()
    if not (windows and names):
        return
    with bpy.context.temp_override(window=windows[0]):
        context = bpy.context
        there = [ob for ob in map(context.view_layer.objects.get, names) if ob and ob.type == 'MESH']
        if not there or context.mode != 'OBJECT':
            return
        selection.activate(context, there[0])
        for ob in there:
            ob.select_set(True)
        bpy.ops.object.mode_set('EXEC_DEFAULT', True, mode='EDIT')  # with a step of undo


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


_BEGINNINGS = {OBJECT_OT_detail_deform_pull_drag: OBJECT_OT_detail_deform_pull_begin,
               OBJECT_OT_detail_deform_handle_drag: OBJECT_OT_detail_deform_handle_take}
CLASSES = (*_BEGINNINGS.values(), OBJECT_OT_detail_deform_edit_again, *_BEGINNINGS)
_register_classes, _unregister_classes = bpy.utils.register_classes_factory(CLASSES)


def register():
    _register_classes()
    for macro, beginning in _BEGINNINGS.items():
        macro.define(beginning.__name__)
        macro.define('TRANSFORM_OT_translate').properties.release_confirm = True
        macro.define(OBJECT_OT_detail_deform_edit_again.__name__)


def unregister():
    if bpy.app.timers.is_registered(_edit_again):
        bpy.app.timers.unregister(_edit_again)
    _unregister_classes()
