# SPDX-License-Identifier: GPL-3.0-or-later
"""A dot at each handle of the active mesh, or of the mesh that the active empty pulls: dragging it moves the handle."""

import bpy
from mathutils import Matrix, Vector

from ..scene import handle_owners, key_shifts
from . import tool
from .preview import handle_colour

_SIZE = 0.1  # of a dot, as Gizmo.scale_basis


def handles(context):
    """(mesh, [(number, empty)]) of the handles with a dot: not the active empty, which has Blender's own gizmos. In
    Edit Mode only with the tool Pull, as dots cover vertices."""
    active = context.active_object
    if active is None or not (active.mode == 'OBJECT' or active.mode == 'EDIT' and tool.is_active(context)):
        return None, []
    ob = active if active.type == 'MESH' else handle_owners.handle_of(active)[0]
    if ob is None or not ob.detail_deform.signature:
        return None, []
    found = [(number, handle.target) for number, handle in enumerate(ob.detail_deform.handles) if handle.enabled]
    return ob, [(number, empty) for number, empty in found
                if empty is not None and empty != active and empty.visible_get()]


def positions(ob, found):
    """World position of each dot of handles(): that of the empty, shifted as shape keys have moved its vertices since
    Bind."""
    if ob is None:
        return []
    shifts = key_shifts.shifts(ob, [ob.detail_deform.handles[number] for number, _ in found])
    return [empty.matrix_world.translation + Vector(shift) for (_, empty), shift in zip(found, shifts)]


class VIEW3D_GGT_detail_deform_handles(bpy.types.GizmoGroup):
    bl_label = "Detail Deform Handles"
    bl_space_type = 'VIEW_3D'
    bl_region_type = 'WINDOW'
    bl_options = {'3D', 'PERSISTENT', 'SHOW_MODAL_ALL'}

    @classmethod
    def poll(cls, context):
        return bool(handles(context)[1])

    def setup(self, context):
        self.numbers = []  # of the handles that have a dot

    def draw_prepare(self, context):
        ob, found = handles(context)
        numbers = [number for number, _ in found]
        # Setting a property of a gizmo redraws the view: done at every drawing, it would redraw without end.
        if numbers != self.numbers:
            self.numbers = numbers
            self.gizmos.clear()
            for number in numbers:
                self._add(number)
        for gizmo, position in zip(self.gizmos, positions(ob, found)):
            matrix = Matrix.Translation(position)
            if gizmo.matrix_basis != matrix:
                gizmo.matrix_basis = matrix

    def _add(self, number):
        gizmo = self.gizmos.new('GIZMO_GT_button_2d')
        gizmo.icon = 'EMPTY_AXIS'
        gizmo.draw_options = {'BACKDROP', 'OUTLINE'}
        gizmo.color = gizmo.color_highlight = handle_colour(number)[:3]
        gizmo.alpha, gizmo.alpha_highlight = 0.4, 0.9
        gizmo.scale_basis = _SIZE
        drag = gizmo.target_set_operator('object.detail_deform_handle_drag')
        drag.OBJECT_OT_detail_deform_handle_take.index = number
        drag.TRANSFORM_OT_translate.release_confirm = True


register, unregister = bpy.utils.register_classes_factory([VIEW3D_GGT_detail_deform_handles])
