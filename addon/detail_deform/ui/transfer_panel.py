# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel for deformations carried over from other meshes."""

import bpy

from ..declared import COMPARED
from ..follow import live_transfer
from ..library.options import TRANSFER_SETTINGS
from ..scene import correspondence
from ..setup import markers
from .panels import ModifierPanel, draw_options, draw_text
from .registration import registration


class OBJECT_PT_detail_deform_transfer(ModifierPanel, bpy.types.Panel):
    bl_label = "Detail Deform: Transfer"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_settings(self, context, layout, ob, all_settings):
        settings = all_settings.transfer
        source = settings.source
        if settings.live:
            draw_text(layout.box(), context, settings.state, 'ERROR' if settings.problem else 'LINKED')
        layout.prop(settings, 'source')
        column = layout.column()
        column.enabled = not settings.live
        draw_options(column, context, settings, 'CORRESPONDENCE', TRANSFER_SETTINGS)
        here, there, both = markers.counts(ob, source)
        if settings.correspondence == 'MARKERS' or here:
            counts = f"{here:,} markers here, {there:,} on the source, {both:,} with the same numbers"
            draw_text(column, context, counts if source else f"{here:,} markers here", 'EMPTY_AXIS')
            column.prop(settings, 'show_markers')
            column.operator('object.detail_deform_transfer_match', icon='VIEWZOOM')
        if ob.mode == 'EDIT' or settings.correspondence == 'MARKERS':
            column.operator('object.detail_deform_marker_add', icon='ADD')
        if correspondence.is_stored(ob):
            row = column.row(align=True)
            row.prop(settings, 'show_match', toggle=True)
            row.operator('object.detail_deform_transfer_save', text="", icon='EXPORT')
            row.operator('object.detail_deform_transfer_forget', text="", icon='TRASH')
        draw_options(layout.column(), context, settings, 'TRANSFER', TRANSFER_SETTINGS)
        layout.separator()
        row = layout.row(align=True)
        row.enabled = source is not None
        row.operator_menu_enum('object.detail_deform_transfer', 'what', text="Transfer")
        follow = "Cancel" if live_transfer.is_preparing(ob) else "Follow"
        button = row.operator('object.detail_deform_transfer_live', text=follow, depress=settings.live,
                              icon='PAUSE' if settings.live else 'PLAY')
        button.on = not settings.live


class OBJECT_PT_detail_deform_transfer_comparison(ModifierPanel, bpy.types.Panel):
    bl_label = COMPARED
    bl_parent_id = 'OBJECT_PT_detail_deform_transfer'
    bl_options = {'DEFAULT_CLOSED'}

    def draw_settings(self, context, layout, ob, settings):
        draw_options(layout, context, settings.transfer, 'COMPARISON', TRANSFER_SETTINGS)


def _draw_marker_entry(self, context):
    self.layout.operator('object.detail_deform_marker_add', icon='EMPTY_AXIS')


register, unregister = registration((OBJECT_PT_detail_deform_transfer, OBJECT_PT_detail_deform_transfer_comparison),
                                    (('VIEW3D_MT_edit_mesh_context_menu', _draw_marker_entry),))
