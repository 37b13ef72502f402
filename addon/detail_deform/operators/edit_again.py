# SPDX-License-Identifier: GPL-3.0-or-later
"""Returns to Edit Mode after a drag that began there. The drag itself is in Object Mode, where empties are moved."""

import bpy

from .. import session, timers
from ..scene import selection

# names: of the objects that were in Edit Mode, the active one first. window: in which they were.
_edited = session.Values(session.Until.DISABLED, names=[], window=None)


def remember_edit_mode(context):
    """Stores the window and the objects in Edit Mode at the beginning of a drag."""
    active = context.active_object
    names = [ob.name for ob in context.objects_in_mode] if active and active.mode == 'EDIT' else []
    _edited.names, _edited.window = sorted(names, key=lambda name: name != active.name), context.window


def began_in_edit_mode():
    return bool(_edited.names)


class OBJECT_OT_detail_deform_edit_again(bpy.types.Operator):
    bl_idname = 'object.detail_deform_edit_again'
    bl_label = "Back to Edit Mode"
    bl_description = "Go on in Edit Mode, if the drag began there"
    bl_options = {'INTERNAL'}

    def execute(self, context):
        # After the macro has ended, as the drag in Object Mode and the change of mode are two steps of undo.
        if _edited.names:
            _timer.start()
        return {'FINISHED'}


def _edit_again():
    """Timer."""
    names, window = _edited.names, _edited.window
    _edited.clear()
    if not names or window not in list(bpy.context.window_manager.windows):
        return
    with bpy.context.temp_override(window=window):
        context = bpy.context
        there = [ob for ob in map(context.view_layer.objects.get, names) if ob and ob.type == 'MESH']
        if not there or context.mode != 'OBJECT':
            return
        selection.activate(context, there[0])
        for ob in there:
            ob.select_set(True)
        bpy.ops.object.mode_set('EXEC_DEFAULT', True, mode='EDIT')  # True: with an undo step


_timer = timers.Timer(_edit_again, 0.0)
register, unregister = bpy.utils.register_classes_factory([OBJECT_OT_detail_deform_edit_again])
