# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for example poses; scripts call these as bpy.ops.object.detail_deform_example..."""

import bpy
from bpy.props import IntProperty

from ..follow import lifecycle
from ..scene import examples
from .operator_base import MeshOperator


class OBJECT_OT_detail_deform_examples_from_keys(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_examples_from_keys'
    bl_label = "Examples from Shape Keys"
    bl_description = "Make an example of each shape key of this mesh that is none yet. Their values should be 0"

    def run(self, context, ob):
        count = examples.add_keys(ob)
        lifecycle.compare(ob)
        self.report({'INFO'}, f"{count:,} {'example' if count == 1 else 'examples'} added")


class OBJECT_OT_detail_deform_examples_from_objects(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_examples_from_objects'
    bl_label = "Examples from Selected Objects"
    bl_description = "Make an example of each other selected object: copies of this mesh in other poses"

    def run(self, context, ob):
        examples.add_objects(ob, context.selected_objects)
        lifecycle.compare(ob)


class OBJECT_OT_detail_deform_example_remove(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_example_remove'
    bl_label = "Remove Example"
    bl_description = "Take the active example off the list. The shape key or object itself stays"

    index: IntProperty(name="Index", default=-1, options={'SKIP_SAVE'},
                       description="Which one; the active one unless given")

    @classmethod
    def poll_object(cls, ob):
        if not ob.detail_deform.examples:
            cls.poll_message_set("There are no examples")
            return False
        return True

    def run(self, context, ob):
        settings = ob.detail_deform
        index = self.index if self.index >= 0 else settings.example_index
        settings.examples.remove(min(index, len(settings.examples) - 1))
        settings.example_index = min(settings.example_index, max(0, len(settings.examples) - 1))
        lifecycle.compare(ob)


CLASSES = (OBJECT_OT_detail_deform_examples_from_keys, OBJECT_OT_detail_deform_examples_from_objects,
           OBJECT_OT_detail_deform_example_remove)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
