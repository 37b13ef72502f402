# SPDX-License-Identifier: GPL-3.0-or-later
"""Returns to Edit Mode after a drag that began there. The drag itself is in Object Mode, where empties are moved."""

import bpy

from ..scene import selection

_edited = []  # names of the objects that were in Edit Mode, the active one first
_window = None  # in which they were


def remember_edit_mode(context):
    """Stores the window and the objects in Edit Mode at the beginning of a drag."""
    global _window
    active, _window = context.active_object, context.window
    names = [ob.name for ob in context.objects_in_mode] if active and active.mode == 'EDIT' else []
    _edited[:] = sorted(names, key=lambda name: name != active.name)


def began_in_edit_mode():
    return bool(_edited)


class OBJECT_OT_detail_deform_edit_again(bpy.types.Operator):
    bl_idname = 'object.detail_deform_edit_again'
    bl_label = "Back to Edit Mode"
    bl_description = "Go on in Edit Mode, if the drag began there"
    bl_options = {'INTERNAL'}

    def execute(self, context):
        # After the macro has ended, as the drag in Object Mode and the change of mode are two steps of undo.
        if _edited and not bpy.app.background:
            bpy.app.timers.register(_edit_again)
        return {'FINISHED'}


def _edit_again():
    """Timer."""
    names = list(_edited)
    _edited.clear()
    if not names or _window not in list(bpy.context.window_manager.windows):
        return
    with bpy.context.temp_override(window=_window):
        context = bpy.context
        there = [ob for ob in map(context.view_layer.objects.get, names) if ob and ob.type == 'MESH']
        if not there or context.mode != 'OBJECT':
            return
        selection.activate(context, there[0])
        for ob in there:
            ob.select_set(True)
        bpy.ops.object.mode_set('EXEC_DEFAULT', True, mode='EDIT')  # True: with an undo step


def register():
    bpy.utils.register_class(OBJECT_OT_detail_deform_edit_again)


def unregister():
    if bpy.app.timers.is_registered(_edit_again):
        bpy.app.timers.unregister(_edit_again)
    _edited.clear()
    bpy.utils.unregister_class(OBJECT_OT_detail_deform_edit_again)
