# SPDX-License-Identifier: GPL-3.0-or-later
"""The tab Deform in the viewport's sidebar (N), the same for a mesh and for the empties that pull it. The key Tab
enters the mesh's Edit Mode while such an empty is active, as empties have none."""

import bpy

from ..scene import handle_owners
from .panels import draw_state, saved_keys


class VIEW3D_PT_detail_deform(bpy.types.Panel):
    bl_label = "Detail Deform"
    bl_space_type = 'VIEW_3D'
    bl_region_type = 'UI'
    bl_category = "Deform"

    @classmethod
    def poll(cls, context):
        return _mesh(context) is not None

    def draw(self, context):
        layout, ob = self.layout, _mesh(context)
        settings, empty = ob.detail_deform, context.active_object != ob
        layout.use_property_split = True
        layout.use_property_decorate = False
        row = layout.row()
        row.label(text=ob.name, icon='MESH_DATA')
        if empty:
            row.operator('object.detail_deform_mesh_activate', text="", icon='RESTRICT_SELECT_OFF')
        draw_state(layout, context, ob)
        layout.prop(settings, 'method')
        if settings.handles:
            layout.template_list('OBJECT_UL_detail_deform_handles', "sidebar", settings, 'handles', settings,
                                 'handle_index', rows=3)
        if 0 <= settings.handle_index < len(settings.handles):
            if not empty:
                layout.operator('object.detail_deform_handle_activate', icon='EMPTY_AXIS')
            column = layout.column(align=True)
            column.operator('object.detail_deform_handle_reset', icon='LOOP_BACK')
            column.operator('object.detail_deform_handle_reset', text="All Back to Rest").everything = True
        layout.operator('object.detail_deform_save_key', icon='SHAPEKEY_DATA')
        column = layout.column()
        for key in saved_keys(ob):
            column.prop(key, 'value', text=key.name, slider=True)
        layout.prop(settings, 'preview')


def _mesh(context):
    """The active mesh, or the one that the active empty pulls."""
    active = context.active_object
    return active if active and active.type == 'MESH' else handle_owners.handle_of(active)[0]


_register_class, _unregister_class = bpy.utils.register_classes_factory([VIEW3D_PT_detail_deform])
_keys = []  # (keymap, item) that were added


def register():
    _register_class()
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration:  # None without a window
        keymap = configuration.keymaps.new(name='Object Mode', space_type='EMPTY')
        item = keymap.keymap_items.new('object.detail_deform_mesh_activate', 'TAB', 'PRESS')
        item.properties.edit = True
        _keys.append((keymap, item))


def unregister():
    for keymap, item in _keys:
        keymap.keymap_items.remove(item)
    _keys.clear()
    _unregister_class()
