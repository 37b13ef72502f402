# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that carry the active mesh's deformation over to many others."""

from types import SimpleNamespace

import bpy
from bpy.props import CollectionProperty, EnumProperty, StringProperty

from ..library.options import CORRESPONDENCES, TRANSFER_SETTINGS
from ..results import point_cache, transfer, transfer_many, transfer_table
from ..results.transfer_table import Row
from ..scene import mesh_data
from ..scene.mesh_data import MeshProblem
from .operator_base import PATH_OPTIONS, MeshOperator
from .transfer_choices import WHAT, TransferChoices

_OF_TARGET = [option.name for option in TRANSFER_SETTINGS if option.name != 'correspondence']  # in its panel
_TITLES = {name: title for name, title, _ in WHAT}


class OBJECT_OT_detail_deform_transfer_many(TransferChoices, bpy.types.Operator):
    bl_idname = 'object.detail_deform_transfer_many'
    bl_label = "Transfer to Selected"
    bl_description = ("Deform all other selected meshes as this one is deformed, each by the settings of its own panel "
                      "Transfer. Esc cancels; those that are done stay done")

    correspondence: EnumProperty(
        name="Match By", default='AUTOMATIC', options={'SKIP_SAVE'},
        description="How it is known which part of this mesh belongs to which of the others",
        items=[('AUTOMATIC', "Automatic", "For each Nearest where its panel says so, else the first that there is: "
                                          "the same topology, the list in its panel, "
                                          "a Saved Match for this mesh, markers on both, its file in Lists"),
               *CORRESPONDENCES])
    lists: StringProperty(
        name="Lists", subtype='DIR_PATH', options=PATH_OPTIONS,
        description="Folder of text files with pairs as Write Match to File makes them, each called as its target with "
                    ".txt behind it")
    targets: CollectionProperty(
        name="Targets", type=bpy.types.OperatorFileListElement, options={'SKIP_SAVE', 'HIDDEN'},
        description="Names of the mesh objects to transfer to; the selected ones unless given")

    def check_usable(self, ob):
        """Accepts linked objects, as the source isn't changed."""

    def invoke(self, context, event):
        self.frame_start, self.frame_end = self.frame_range(context)
        self.interactive = True
        return context.window_manager.invoke_props_dialog(self, width=400)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        column = layout.column()
        self.draw_choices(column)
        column.separator()
        column.prop(self, 'correspondence')
        if self.correspondence in {'AUTOMATIC', 'LIST'}:
            column.prop(self, 'lists')

    def run(self, context, source):
        mesh_data.check_left_edit_mode(source)
        rows = self._targets(context, source)
        common = self.request(context, source, SimpleNamespace(correspondence=self.correspondence), lists=self.lists,
                              cache_path="")
        transfer.check(source, common)
        if self.what == 'ANIMATION' and self.bake_as == 'CACHE':
            point_cache.absolute('//')  # refuses a file that was never saved: the caches go beside it
        heading = f"Detail Deform: from '{source.name}', {_TITLES[self.what]}"
        return self.start(context, self._reported(transfer_many.begin(
            context, source, rows, lambda target: self._wanted_of(common, target), heading, self._tell), rows))

    def _targets(self, context, source):
        if self.targets:
            found = [Row(entry.name, bpy.data.objects.get(entry.name)) for entry in self.targets]
        else:
            found = [Row(ob.name, ob) for ob in context.selected_objects if ob.type == 'MESH' and ob != source]
        if not found:
            raise MeshProblem("No other mesh is selected: select those to transfer to, and this one last.")
        return found

    @staticmethod
    def _wanted_of(common, target):
        settings = target.detail_deform.transfer
        return common.with_settings(**{name: getattr(settings, name) for name in _OF_TARGET})

    def _tell(self, target):
        self.task = f"Transferring to {target}"

    def _reported(self, work, rows):
        try:
            yield from work
        finally:
            self.keeps_partial_work = transfer_table.any_begun(rows)
            if self.keeps_partial_work:
                kind, said = transfer_table.summary(rows)
                self.report({kind}, f"{said}. See the text '{transfer_table.text().name}'")


class OBJECT_OT_detail_deform_transfer_dismiss(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_transfer_dismiss'
    bl_label = "Dismiss"
    bl_description = "Forget which targets failed"

    def run(self, context, ob):
        ob.detail_deform.transfer.failed.clear()


register, unregister = bpy.utils.register_classes_factory((OBJECT_OT_detail_deform_transfer_many,
                                                          OBJECT_OT_detail_deform_transfer_dismiss))
