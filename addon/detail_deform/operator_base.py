# SPDX-License-Identifier: GPL-3.0-or-later
"""What all operators share."""

import bpy

from . import mesh_data, native


class MeshOperator:
    """Undo, a poll message, and a report for every sentence the user should see."""
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        ob = context.active_object
        if ob is None or ob.type != 'MESH':
            cls.poll_message_set("Select a mesh object")
            return False
        return cls.poll_object(ob)

    @classmethod
    def poll_object(cls, ob):
        return True

    def execute(self, context):
        ob = context.active_object
        try:
            mesh_data.check_editable(ob)
            result = self.run(context, ob) or {'FINISHED'}
        except (mesh_data.MeshProblem, native.NativeError) as problem:
            self.report({'ERROR'}, str(problem))
            return {'CANCELLED'}
        if context.active_object and context.active_object.mode == 'EDIT':
            # A step of undo in Edit Mode holds the mesh alone, unless data-blocks have come or gone: the
            # settings must go back with it.
            bpy.data.texts.remove(bpy.data.texts.new("."))
        return result


    @classmethod
    def in_edit_mode(cls, ob):
        """For poll_object of what takes the vertices selected in Edit Mode."""
        if ob.mode != 'EDIT':
            cls.poll_message_set("Select vertices in Edit Mode")
            return False
        return True
