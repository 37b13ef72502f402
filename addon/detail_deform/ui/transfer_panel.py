# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of deformation transfer, for its target and its source."""

import bpy

from ..declared import COMPARED
from ..follow import live_transfer
from ..library.options import TRANSFER_SETTINGS
from ..results import transfer_table
from ..scene import mesh_data, saved_match
from ..setup import marker_check, markers
from . import marker_cache
from .parts import ModifierPanel, draw_options, draw_text
from .registration import registration

_FAILED_SHOWN = 8  # targets; all of them are in the text


class OBJECT_PT_detail_deform_transfer(ModifierPanel, bpy.types.Panel):
    bl_label = "Detail Deform: Transfer"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_settings(self, context, layout, ob, all_settings):
        settings = all_settings.transfer
        source = settings.source
        if settings.live:
            draw_text(layout.box(), context, settings.state, 'ERROR' if settings.problem else 'LINKED')
        else:
            problem = mesh_data.why_not_editable(ob)
            if problem:  # Blender greys the settings without a reason
                draw_text(layout.box(), context, problem, 'LIBRARY_DATA_DIRECT')
        layout.prop(settings, 'source')
        column = layout.column()
        column.enabled = not settings.live
        draw_options(column, context, settings, 'CORRESPONDENCE', TRANSFER_SETTINGS)
        here, there, both = markers.counts(ob, source)
        has_markers = settings.correspondence == 'MARKERS' or here
        if has_markers:
            counts = f"{_markers(here)} here, {there:,} on the source, {both:,} with the same numbers"
            draw_text(column, context, counts if source else f"{_markers(here)} here", 'EMPTY_AXIS')
            column.prop(settings, 'show_markers')
            column.operator('object.detail_deform_transfer_match', icon='VIEWZOOM')
        if ob.mode == 'EDIT' or settings.correspondence == 'MARKERS':
            column.operator('object.detail_deform_marker_add', icon='ADD')
        if saved_match.is_stored(ob):
            row = layout.row(align=True)
            row.prop(settings, 'show_match', toggle=True)
            row = row.row(align=True)
            row.enabled = not settings.live
            row.operator('object.detail_deform_transfer_save', text="", icon='EXPORT')
            row.operator('object.detail_deform_transfer_forget', text="", icon='TRASH')
        if has_markers and not settings.live:  # below the buttons, which a new marker would move
            column = layout.column()
            _draw_markers(column, ob, _draw_doubts(column, context, source, ob) if source else ())
        draw_options(layout.column(), context, settings, 'TRANSFER', TRANSFER_SETTINGS)
        layout.separator()
        row = layout.row(align=True)
        row.enabled = source is not None
        row.operator_menu_enum('object.detail_deform_transfer', 'what', text="Transfer")
        follow = "Cancel" if live_transfer.is_preparing(ob) else "Follow"
        button = row.operator('object.detail_deform_transfer_live', text=follow, depress=settings.live,
                              icon='PAUSE' if settings.live else 'PLAY')
        button.on = not settings.live


def _others_selected(context):
    """The number of selected meshes besides the active one."""
    return sum(ob.type == 'MESH' and ob != context.object for ob in context.selected_objects)


def _markers(count):
    return f"{count:,} marker{'s' * (count != 1)}"


def _draw_doubts(layout, context, source, target):
    """Draws the sentence about the markers in doubt, and returns their numbers."""
    doubts = marker_cache.doubts(source, target)
    if doubts:
        draw_text(layout, context, marker_check.sentence(doubts, source, target), 'ERROR')
    return doubts


def _draw_markers(layout, ob, doubts):
    """Draws a button for each marker, red if it is in doubt."""
    flow = layout.grid_flow(row_major=True, columns=6, even_columns=True, align=True)
    for number in sorted(marker_cache.markers_of(ob)):
        button = flow.row(align=True)
        button.alert = number in doubts
        button.operator('object.detail_deform_marker_select', text=str(number)).number = number


def _draw_target_name(layout, target, icon):
    """Draws the name with a button that selects the target."""
    row = layout.row()
    row.label(text=target.name, icon=icon)
    row.operator('object.detail_deform_target_activate', text="", icon='RESTRICT_SELECT_OFF').target = target.name


class OBJECT_PT_detail_deform_source(ModifierPanel, bpy.types.Panel):
    """The panel of a mesh that others follow, or that is transferred to others."""
    bl_label = "Detail Deform: Source"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and bool(
            marker_cache.followers(context.object) or context.object.detail_deform.transfer.failed or
            _others_selected(context))

    def draw_settings(self, context, layout, ob, all_settings):
        others = _others_selected(context)
        row = layout.row()
        row.enabled = others > 0
        row.operator_menu_enum('object.detail_deform_transfer_many', 'what', text=f"Transfer to {others:,} Selected")
        if all_settings.transfer.failed:
            self._draw_failed(context, layout.box().column(), all_settings.transfer.failed)
        followers, doubts = marker_cache.followers(ob), set()
        if not followers:
            return
        for target in followers:
            doubts |= set(self._draw_target(context, layout.box().column(), ob, target))
        draw_text(layout, context, f"{_markers(len(marker_cache.markers_of(ob)))} here", 'EMPTY_AXIS')
        _draw_markers(layout, ob, doubts)
        layout.operator('object.detail_deform_marker_add', icon='ADD')

    @staticmethod
    def _draw_failed(context, layout, failed):
        row = layout.row()
        row.label(text=f"{len(failed):,} failed", icon='ERROR')
        row.operator('object.detail_deform_transfer_dismiss', text="", icon='X', emboss=False)
        for entry in failed[:_FAILED_SHOWN]:
            target = transfer_table.failed_target(entry)
            if target:
                _draw_target_name(layout, target, 'MESH_DATA')
            else:
                draw_text(layout, context, f"'{entry.name}' is in no scene.", 'GHOST_DISABLED')
            draw_text(layout, context, entry.reason, 'BLANK1')
        text = transfer_table.text()
        if text:
            draw_text(layout, context, f"All of them: text '{text.name}'", 'TEXT')

    @staticmethod
    def _draw_target(context, layout, ob, target):
        """Draws a target's state, and returns the numbers of the markers in doubt."""
        settings = target.detail_deform.transfer
        _draw_target_name(layout, target,
                          'ERROR' if settings.problem else 'LINKED' if settings.live else 'MESH_DATA')
        draw_text(layout, context, settings.state if settings.live else "Does not follow.", 'BLANK1')
        _, there, both = markers.counts(ob, target)
        draw_text(layout, context, f"{_markers(there)} there, {both:,} with the same numbers", 'EMPTY_AXIS')
        return _draw_doubts(layout, context, ob, target)


class OBJECT_PT_detail_deform_transfer_comparison(ModifierPanel, bpy.types.Panel):
    bl_label = COMPARED
    bl_parent_id = 'OBJECT_PT_detail_deform_transfer'
    bl_options = {'DEFAULT_CLOSED'}

    def draw_settings(self, context, layout, ob, settings):
        draw_options(layout, context, settings.transfer, 'COMPARISON', TRANSFER_SETTINGS)


def _draw_marker_entry(self, context):
    self.layout.operator('object.detail_deform_marker_add', icon='EMPTY_AXIS')


def _draw_link_entry(self, context):
    self.layout.separator()
    self.layout.operator_context = 'INVOKE_DEFAULT'
    self.layout.operator('object.detail_deform_transfer_many', text="Transfer Deformation to Selected",
                         icon='MOD_MESHDEFORM')


register, unregister = registration((OBJECT_PT_detail_deform_transfer, OBJECT_PT_detail_deform_transfer_comparison,
                                      OBJECT_PT_detail_deform_source),
                                    (('VIEW3D_MT_edit_mesh_context_menu', _draw_marker_entry),
                                     ('VIEW3D_MT_make_links', _draw_link_entry)))
