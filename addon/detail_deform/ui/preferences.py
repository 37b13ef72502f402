# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: the bundled manual, and the data for a report of a problem."""

import platform
import webbrowser
from pathlib import Path

import bpy

from ..follow import status
from ..library import native
from ..website import WEBSITE
from .registration import registration

_PACKAGE = Path(__file__).resolve().parents[1]


def manual():
    """Path of the manual: the page in the add-on's folder, or in the source tree its text; None if it is missing."""
    paths = (_PACKAGE / "MANUAL.html", _PACKAGE.parent / "MANUAL.md")
    return next((path for path in paths if path.exists()), None)


def report(ob):
    """Text for a report: versions, the system, and the state of the object if it is a mesh."""
    try:
        library = f"library {native.version()} ({native.instruction_set()})"
    except native.NativeError as error:
        library = str(error)
    lines = [f"Detail Deform: {library}", f"Blender {bpy.app.version_string}, {platform.platform()}"]
    if ob and ob.type == 'MESH':
        modifiers = ", ".join(modifier.type for modifier in ob.modifiers) or "none"
        lines += [f"Mesh: {len(ob.data.vertices):,} vertices, {len(ob.data.polygons):,} faces; modifiers: {modifiers}",
                  f"Method: {ob.detail_deform.method}, {len(ob.detail_deform.handles)} handles",
                  f"It says: {status.text(ob)}"]
    return '\n'.join([*lines, "", "What I did, what happened, and what I expected:", ""])


class WM_OT_detail_deform_manual(bpy.types.Operator):
    bl_idname = 'wm.detail_deform_manual'
    bl_label = "Detail Deform Manual"
    bl_description = "Read the manual that came with the add-on, in the web browser"

    def execute(self, context):
        path = manual()
        if path is None:
            self.report({'ERROR'}, "The manual is missing: install the add-on's zip again")
            return {'CANCELLED'}
        webbrowser.open(path.as_uri())
        self.report({'INFO'}, f"Opened in the web browser: {path}")
        return {'FINISHED'}


class WM_OT_detail_deform_report(bpy.types.Operator):
    bl_idname = 'wm.detail_deform_report'
    bl_label = "Report a Problem"
    bl_description = ("Copy what a report needs, versions and what the panel of the active mesh says, to paste it"
                      + (", and open the page for reports" if WEBSITE else ""))

    def execute(self, context):
        context.window_manager.clipboard = report(context.active_object)
        if WEBSITE:
            webbrowser.open(f"{WEBSITE}/issues")
            self.report({'INFO'}, "Copied: paste it into the report (Ctrl+V)")
        else:
            self.report({'INFO'}, "Copied: paste it (Ctrl+V) into a message to whom you have the add-on from")
        return {'FINISHED'}


class DetailDeformPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__.rpartition('.')[0]

    def draw(self, context):
        row = self.layout.row()
        row.operator('wm.detail_deform_manual', text="Manual", icon='HELP')
        row.operator('wm.detail_deform_report', icon='URL')
        self.layout.label(icon='INFO', text="Settings: Properties > Modifiers > Detail Deform, and the "
                                                       "viewport's sidebar (N) > Deform")


def _draw_help_entry(self, context):
    self.layout.operator('wm.detail_deform_manual', icon='HELP')


register, unregister = registration(
    (WM_OT_detail_deform_manual, WM_OT_detail_deform_report, DetailDeformPreferences),
    (('TOPBAR_MT_help', _draw_help_entry),))
