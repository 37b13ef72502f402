# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Examples: the list, buttons that add examples, and the missing ones."""

import bpy

from ..results import missing_examples
from ..scene import examples, posers
from .parts import ModifierPanel, ToggleListMixin, draw_options


class OBJECT_UL_detail_deform_examples(ToggleListMixin, bpy.types.UIList):
    @staticmethod
    def draw_content(row, settings, example):
        row.label(text=examples.title(example), icon='OBJECT_DATA' if example.object else 'SHAPEKEY_DATA')
        row.prop(example, 'weight' if settings.weights_by == 'SLIDERS' else 'found_weight', text="", emboss=False)


class OBJECT_PT_detail_deform_examples(ModifierPanel, bpy.types.Panel):
    bl_label = "Examples"
    bl_parent_id = 'OBJECT_PT_detail_deform'

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object.detail_deform.method == 'EXAMPLES'

    def draw_settings(self, context, layout, ob, settings):
        row = layout.row()
        row.template_list('OBJECT_UL_detail_deform_examples', "", settings, 'examples', settings, 'example_index',
                          rows=4)
        row.operator('object.detail_deform_example_remove', text="", icon='REMOVE')
        row = layout.row(align=True)
        row.operator('object.detail_deform_examples_from_keys', text="Add Shape Keys", icon='SHAPEKEY_DATA')
        row.operator('object.detail_deform_examples_from_objects', text="Add Selected Objects", icon='OBJECT_DATA')
        layout.operator('object.detail_deform_examples_from_poses', text="Add Poses", icon='ARMATURE_DATA')
        if posers.applied_twice(ob):
            layout.operator('object.detail_deform_posers_off', icon='HIDE_ON')
        if 0 <= settings.example_index < len(settings.examples):
            example = settings.examples[settings.example_index]
            if example.is_object:
                layout.prop(example, 'object')
            elif ob.data.shape_keys:
                layout.prop_search(example, 'name', ob.data.shape_keys, 'key_blocks', text="Shape Key")
            if settings.weights_by == 'SLIDERS':
                layout.prop(example, 'weight', slider=True)
            else:
                layout.prop(example, 'limited')
            if settings.weights_by == 'HANDLES' and example.limited:
                row = layout.row(align=True)
                row.prop(example, 'least_weight')
                row.prop(example, 'largest_weight')
        draw_options(layout, context, settings, 'EXAMPLES')
        layout.separator()
        layout.operator('object.detail_deform_examples_find_missing', text="Find Missing", icon='VIEWZOOM')
        if settings.missing_examples:
            if missing_examples.is_old(ob):
                layout.label(text="Errors before the last Bind: press Find Missing", icon='INFO')
            layout.template_list('OBJECT_UL_detail_deform_missing', "", settings, 'missing_examples', settings,
                                 'missing_index', rows=3)
            row = layout.row(align=True)
            row.operator('object.detail_deform_example_add_missing', icon='ADD')
            row.prop(settings, 'show_error', toggle=True)


class OBJECT_UL_detail_deform_missing(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_propname, index=0):
        row = layout.row()
        row.use_property_split = False
        row.label(text=item.name, icon='ACTION' if item.action else 'ARMATURE_DATA')
        row.active = not missing_examples.is_old(item.id_data)
        row.label(text=f"{item.mean_error:.2g}%, at most {item.largest_error:.2g}%")


CLASSES = (OBJECT_UL_detail_deform_examples, OBJECT_UL_detail_deform_missing, OBJECT_PT_detail_deform_examples)
