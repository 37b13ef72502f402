# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels in Properties > Modifiers."""

import bpy

from ..declared import COMPARED
from ..follow import frame_results, handle_follower, hints, problem_vertices, slow_results, status, update_options
from ..scene import (cache_modifier, deform_modifier, display_key, handle_curves, handle_owners, offset_attribute,
                     stack)
from . import examples_panel
from .parts import ModifierPanel, ToggleListMixin, draw_options, draw_text
from .registration import registration


# Modes that edit the undeformed vertices, which are elsewhere than the displayed ones.
_WORKS_AT_REST = {'EDIT': "You edit the mesh without its deformation.",
                  'SCULPT': "Brushes work on the mesh without its deformation, unless Show As is Shape Key."}


_PASSED_OVER = ("Blender marks Detail Deform's modifier as not supported in Sculpt Mode behind Multires: its shape key "
                "shows the deformation.")


def _edits_elsewhere(ob):
    """A sentence where what is edited now is not what is displayed; or ''."""
    key = display_key.find(ob.data)
    if key is None or ob.mode == 'EDIT':
        return _WORKS_AT_REST.get(ob.mode, "")
    if ob.mode == 'SCULPT' and ob.active_shape_key == key:
        return f"The next update overwrites what you sculpt into the shape key '{key.name}': choose another one."
    return ""  # brushes work on what shape keys display


_ICONS = {'CURVE': 'CURVE_DATA', 'ARMATURE': 'ARMATURE_DATA'}  # of handles, by the type of what moves them


class OBJECT_UL_detail_deform_handles(ToggleListMixin, bpy.types.UIList):
    @staticmethod
    def draw_content(row, settings, handle):
        kind = handle.target.type if handle.target else 'EMPTY'
        row.prop(handle, 'name', text="", emboss=False, icon=_ICONS.get(kind, 'EMPTY_AXIS'))


def draw_state(layout, context, ob):
    """Draws the status, and the buttons for what can be done now."""
    settings = ob.detail_deform
    wrong = settings.stale or settings.problem
    under_way = handle_follower.cache.under_way(settings.signature)
    box = layout.box()
    icon = ('ERROR' if wrong else 'SORTTIME' if under_way else
            'LINKED' if settings.is_bound else 'UNLINKED')
    draw_text(box, context, status.urgent(ob), icon)
    if problem_vertices.need_a_look(ob):
        box.operator('object.detail_deform_select_problem', icon='RESTRICT_SELECT_OFF')

    if stack.is_misplaced(ob):
        layout.operator('object.detail_deform_place', icon='SORT_DESC')
    if settings.signature and hints.shares_empties_with(ob):
        layout.operator('object.detail_deform_own_empties', icon='DUPLICATE')
    if settings.signature and hints.gone_empties(ob, bpy.context.view_layer.depsgraph):
        layout.operator('object.detail_deform_bring_back', icon='LOOP_BACK')
    why = _edits_elsewhere(ob) if frame_results.is_deformed(ob.data) else ""
    if why:
        column = layout.column(align=True)
        draw_text(column, context, why, 'INFO')
        column.operator('object.detail_deform_apply', text="Apply First", icon='CHECKMARK').mode = 'MESH'
    elif ob.mode == 'SCULPT' and display_key.find(ob.data) and stack.wanting_mesh(ob):
        draw_text(layout, context, _PASSED_OVER, 'INFO')
    row = layout.row(align=True)
    row.use_property_split = False
    if under_way:
        row.enabled = not under_way.cancelled
        row.operator('object.detail_deform_bind_cancel', text="Cancel", icon='X')
        return
    if cache_modifier.find(ob):
        return
    if update_options.is_slow(settings) and slow_results.progress(offset_attribute.token(ob.data)) is not None:
        row.operator('object.detail_deform_bind_cancel', text="Cancel", icon='X')
    if ob.mode == 'EDIT':
        layout.operator('object.detail_deform_pull', text="Pull Selected", icon='EMPTY_AXIS')
        layout.operator('object.detail_deform_pull_curve', text="Pull by Curve", icon='CURVE_DATA')
    if settings.signature:
        if settings.stale or (settings.problem and settings.base == 'OBJECT'):  # the base may have other vertices now
            row.operator('object.detail_deform_bind', text="Re-bind", icon='FILE_REFRESH').keep_rest = True
        row.operator('object.detail_deform_unbind', icon='UNLINKED')
        if not settings.stale:
            row.operator('object.detail_deform_update', text="", icon='FILE_REFRESH')
            row.prop(settings, 'live', toggle=True)
    else:
        row.enabled = bool(settings.handles) or settings.base == 'OBJECT'
        row.operator('object.detail_deform_bind', icon='LINKED').keep_rest = False


class OBJECT_PT_detail_deform(ModifierPanel, bpy.types.Panel):
    bl_label = "Detail Deform"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_settings(self, context, layout, ob, settings):
        draw_state(layout, context, ob)
        if cache_modifier.find(ob):
            layout.operator('object.detail_deform_bake_drop', icon='PLAY')
            return
        column = layout.column()
        draw_options(column, context, settings, 'METHOD')
        modifier = deform_modifier.find(ob)
        factor = modifier and deform_modifier.factor_property(ob, modifier)
        if factor:
            column.prop(*factor, text="Factor", slider=True)
        row = column.row(align=True)
        row.prop_search(settings, 'influence', ob, 'vertex_groups')
        row.prop(settings, 'invert_influence', text="", icon='ARROW_LEFTRIGHT')

        layout.separator()
        row = layout.row(align=True)
        row.operator_menu_enum('object.detail_deform_apply', 'mode', text="Apply")
        row.operator('object.detail_deform_bake', text="Bake", icon='REC')
        layout.operator('object.detail_deform_remove', text="Remove All", icon='TRASH')

class OBJECT_MT_detail_deform_mirror(bpy.types.Menu):
    bl_label = "Mirror Handle"

    def draw(self, context):
        for symmetric, text in ((False, "{}, with an Empty of Its Own"), (True, "{}, Symmetric")):
            for axis in 'XYZ':
                button = self.layout.operator('object.detail_deform_handle_mirror', text=text.format(axis))
                button.axis, button.symmetric = axis, symmetric
            if not symmetric:
                self.layout.separator()


class OBJECT_MT_detail_deform_handles(bpy.types.Menu):
    bl_label = "Handle Specials"

    def draw(self, context):
        layout = self.layout
        if context.object.mode == 'EDIT':
            layout.operator('object.detail_deform_handle_add', text="Add for Each Vertex", icon='ADD').each = 'VERTEX'
            layout.operator('object.detail_deform_handle_add', text="Add for Each Island", icon='ADD').each = 'ISLAND'
            layout.separator()
        layout.operator('object.detail_deform_handle_activate', icon='EMPTY_AXIS')
        layout.operator('object.detail_deform_handle_select', icon='RESTRICT_SELECT_OFF')
        layout.operator('object.detail_deform_handle_assign', icon='GROUP_VERTEX')
        layout.menu('OBJECT_MT_detail_deform_mirror', icon='MOD_MIRROR')
        layout.separator()
        layout.operator('object.detail_deform_handle_reset', icon='LOOP_BACK')
        layout.operator('object.detail_deform_handle_reset', text="All Back to Rest").everything = True


class OBJECT_PT_detail_deform_handles(ModifierPanel, bpy.types.Panel):
    bl_label = "Handles"
    bl_parent_id = 'OBJECT_PT_detail_deform'

    def draw_settings(self, context, layout, ob, settings):
        layout.prop_search(settings, 'region', ob, 'vertex_groups')
        row = layout.row(align=True)
        row.operator('object.detail_deform_region_set', text="From Selection")
        row.operator('object.detail_deform_region_around', text="By Radius")
        border = layout.column()
        border.active = settings.base == 'COMPUTED' and bool(settings.region)
        border.prop(settings, 'soft_border')
        layout.prop(settings, 'join_split')
        loose = layout.column()
        loose.active = settings.base == 'COMPUTED'
        loose.prop(settings, 'loose_parts')

        row = layout.row()
        row.template_list('OBJECT_UL_detail_deform_handles', "", settings, 'handles', settings,
                          'handle_index', rows=4)
        buttons = row.column(align=True)
        buttons.operator('object.detail_deform_handle_add', text="", icon='ADD')
        buttons.operator('object.detail_deform_handle_remove', text="", icon='REMOVE')
        buttons.separator()
        buttons.menu('OBJECT_MT_detail_deform_handles', text="", icon='DOWNARROW_HLT')
        if 0 <= settings.handle_index < len(settings.handles):
            handle = settings.handles[settings.handle_index]
            if ob.mode == 'EDIT':
                row = layout.row(align=True)
                row.operator('object.detail_deform_handle_assign')
                row.operator('object.detail_deform_handle_select')
            column = layout.column()
            column.prop_search(handle, 'vertex_group', ob, 'vertex_groups')
            reach = column.column()
            reach.active = settings.base == 'COMPUTED'
            reach.prop_search(handle, 'reach', ob, 'vertex_groups')
            if handle.reach:
                falloff = reach.column()
                falloff.active = handle == next(
                    (h for h in settings.handles if h.enabled and h.reach == handle.reach), handle)
                falloff.prop(handle, 'falloff')
            target = column.column()
            target.active = not handle.mirrors
            target.prop(handle, 'target')
            if handle.target and handle.target.type == 'ARMATURE':
                target.prop_search(handle, 'first_bone', handle.target.data, 'bones')
                target.prop_search(handle, 'last_bone', handle.target.data, 'bones')
            along_curve = handle_curves.has_curve(handle)
            column.prop_search(handle, 'mirrors', settings, 'handles')
            if handle.mirrors:
                column.row().prop(handle, 'mirror_axis', expand=True)
            symmetric = column.row()
            symmetric.active = not along_curve
            symmetric.prop(handle, 'symmetric', expand=True)
            turns = column.row()
            turns.active = not (handle.mirrors or along_curve)  # it mirrors the rotation, too
            turns.prop(handle, 'turns', expand=True)
        layout.prop(settings, 'preview')


def saved_keys(ob):
    """The shape keys that Save as Shape Key made and that still exist."""
    keys = ob.data.shape_keys
    blocks = keys.key_blocks if keys else {}
    return [blocks[saved.name] for saved in ob.detail_deform.expressions if saved.name in blocks]


class OBJECT_PT_detail_deform_expressions(ModifierPanel, bpy.types.Panel):
    bl_label = "Expressions"
    bl_parent_id = 'OBJECT_PT_detail_deform'
    bl_options = {'DEFAULT_CLOSED'}

    def draw_settings(self, context, layout, ob, settings):
        layout.operator('object.detail_deform_save_key', icon='SHAPEKEY_DATA')
        column = layout.column()
        for key in saved_keys(ob):
            column.prop(key, 'value', text=key.name, slider=True)


class OBJECT_PT_detail_deform_base(ModifierPanel, bpy.types.Panel):
    bl_label = "Base Surface"
    bl_parent_id = 'OBJECT_PT_detail_deform'
    bl_options = {'DEFAULT_CLOSED'}

    def draw_settings(self, context, layout, ob, settings):
        why_not = update_options.why_no_base(settings)
        if why_not:
            layout.active = False
            draw_text(layout, context, why_not, 'INFO')
        column = layout.column()
        draw_options(column, context, settings, 'BASE')
        if settings.base == 'OBJECT':
            column.prop(settings, 'base_object')
            return
        layout.operator('object.detail_deform_base_make', icon='MOD_SMOOTH')


class OBJECT_PT_detail_deform_advanced(ModifierPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = 'OBJECT_PT_detail_deform'
    bl_options = {'DEFAULT_CLOSED'}

    def draw_settings(self, context, layout, ob, settings):
        layout.prop(settings, 'show_as')
        layout.prop(settings, 'auto_bind')
        layout.operator('object.detail_deform_copy_settings', icon='COPYDOWN')
        if settings.is_bound:
            draw_text(layout, context, f"Bind {settings.bind_ms:,.0f} ms, update {settings.update_ms:,.1f} ms", 'TIME')
            harmless = status.harmless(ob)
            if harmless:
                draw_text(layout, context, harmless, 'INFO')
                layout.operator('object.detail_deform_select_problem', icon='RESTRICT_SELECT_OFF')


class OBJECT_PT_detail_deform_comparison(ModifierPanel, bpy.types.Panel):
    """Settings of the methods that the paper compares with, which deforming doesn't need. The heading in Method's menu
    is the same."""
    bl_label = COMPARED
    bl_parent_id = 'OBJECT_PT_detail_deform'
    bl_options = {'DEFAULT_CLOSED'}

    def draw_settings(self, context, layout, ob, settings):
        draw_options(layout, context, settings, 'COMPARISON')


class HandlePanel:
    """Base of the panels of a handle's empty, for which the mesh's panels don't show."""
    bl_label = "Detail Deform"
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'

    @classmethod
    def poll(cls, context):
        empty = context.object
        return empty is not None and empty.type in handle_owners.TYPES and handle_owners.handle_of(empty)[0] is not None

    def draw(self, context):
        layout = self.layout
        ob, number = handle_owners.handle_of(context.object)
        settings = ob.detail_deform
        draw_text(layout, context, f"Handle '{settings.handles[number].name}' of '{ob.name}'. {status.urgent(ob)}",
                   'ERROR' if settings.stale or settings.problem else 'EMPTY_AXIS')
        layout.operator('object.detail_deform_mesh_activate', icon='MESH_DATA')
        row = layout.row(align=True)
        row.operator('object.detail_deform_handle_reset', icon='LOOP_BACK')
        row.operator('object.detail_deform_handle_reset', text="All Back to Rest").everything = True
        layout.operator('object.detail_deform_save_key', icon='SHAPEKEY_DATA')
        layout.prop(settings, 'preview')
        if settings.method == 'EXAMPLES':
            layout.template_list('OBJECT_UL_detail_deform_examples', "", settings, 'examples', settings,
                                 'example_index')


class OBJECT_PT_detail_deform_empty(HandlePanel, bpy.types.Panel):
    bl_context = 'object'


class OBJECT_PT_detail_deform_empty_modifiers(HandlePanel, bpy.types.Panel):
    """From Blender 5 on, empties have this tab too, and it stays open when an empty becomes active after its mesh."""
    bl_context = 'modifier'


def _draw_pull_entry(self, context):
    self.layout.separator()
    self.layout.operator_context = 'INVOKE_REGION_WIN'  # a context menu calls execute() alone
    self.layout.operator('object.detail_deform_pull', icon='MOD_MESHDEFORM')


def _draw_add_entry(self, context):
    self.layout.operator('object.detail_deform_add', text="Detail Deform", icon='MOD_MESHDEFORM')


CLASSES = (OBJECT_UL_detail_deform_handles, OBJECT_MT_detail_deform_mirror, OBJECT_MT_detail_deform_handles,
           OBJECT_PT_detail_deform, *examples_panel.CLASSES, OBJECT_PT_detail_deform_handles,
           OBJECT_PT_detail_deform_expressions, OBJECT_PT_detail_deform_base, OBJECT_PT_detail_deform_advanced,
           OBJECT_PT_detail_deform_comparison, OBJECT_PT_detail_deform_empty, OBJECT_PT_detail_deform_empty_modifiers)


register, unregister = registration(CLASSES, (
    ('VIEW3D_MT_edit_mesh_context_menu', _draw_pull_entry),
    ('VIEW3D_MT_edit_mesh_vertices', _draw_pull_entry),
    # From 4.2 on; before, the modifier menu can't be extended, and only the panel leads here.
    ('OBJECT_MT_modifier_add_deform', _draw_add_entry)))
