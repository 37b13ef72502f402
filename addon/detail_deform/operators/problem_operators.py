# SPDX-License-Identifier: GPL-3.0-or-later
"""Selects the vertices that a message is about."""

import bpy
import numpy as np

from ..follow import problem_vertices
from ..scene import mesh_data, selection
from .operator_base import HandleEmptyOperator


class OBJECT_OT_detail_deform_select_problem(HandleEmptyOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_select_problem'
    bl_label = "Select Problem Vertices"
    bl_description = ("Select in Edit Mode all vertices that the message is about, not only the one that it names, and "
                      "bring them into view")

    @classmethod
    def poll_object(cls, ob):
        if not problem_vertices.are_known(ob):
            cls.poll_message_set("No message is about vertices now")
            return False
        return True

    def run(self, context, ob):
        chosen = problem_vertices.of(ob)
        if context.active_object != ob:
            selection.go_to(context, context.active_object, ob)
        positions = mesh_data.positions(ob.data)[chosen]
        selection.select(ob, chosen, extend=False, hidden=True)
        if not bpy.app.background and np.isfinite(positions).all() and np.abs(positions).max(initial=0) < _FARTHEST:
            _bring_into_view(context)
        count = int(chosen.sum())
        self.report({'INFO'}, f"{count:,} {'vertex is' if count == 1 else 'vertices are'} selected")


# Largest coordinate that is brought into view; safety: a view can't go farther, nor to values that aren't finite.
_FARTHEST = 1e6


def _bring_into_view(context):
    for area in context.screen.areas if context.screen else ():
        if area.type == 'VIEW_3D':
            region = next(region for region in area.regions if region.type == 'WINDOW')
            with context.temp_override(area=area, region=region):
                bpy.ops.view3d.view_selected()


register, unregister = bpy.utils.register_classes_factory((OBJECT_OT_detail_deform_select_problem,))
