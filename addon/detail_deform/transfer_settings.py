# SPDX-License-Identifier: GPL-3.0-or-later
"""Object.detail_deform.transfer: the source and the settings of deformation transfer to this mesh."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, PointerProperty, StringProperty

from .declared import declare
from .follow import lifecycle, live_transfer
from .library.options import TRANSFER_SETTINGS
from .ui import preview


def _source_changed(self, context):
    live_transfer.source_changed(self.id_data)
    _changed(self, context)


def _changed(self, context):
    lifecycle.compare(self.id_data)
    lifecycle.refresh(self.id_data, context.evaluated_depsgraph_get())


def _preview_changed(self, context):
    preview.forget()


class DetailDeformTransferFailure(bpy.types.PropertyGroup):
    """A target on which Transfer to Selected failed; its name is that of the object at that time."""
    target: PointerProperty(name="Target", type=bpy.types.Object, description="Mesh object that was to get it")
    reason: StringProperty(name="Reason", description="Why it failed, and what to do")


class DetailDeformTransfer(bpy.types.PropertyGroup):
    source: PointerProperty(
        name="Source", type=bpy.types.Object, update=_source_changed,
        poll=lambda self, ob: ob.type == 'MESH' and ob != self.id_data,
        description="Mesh object whose deformation is carried over to this one. "
                    "Its mesh without shape keys and modifiers is the rest")
    show_markers: BoolProperty(
        name="Show Markers", default=True,
        description="Number the markers of this mesh and of the source in the viewport while either is active: "
                    "yellow where both have the number, red where one has, pink where it contradicts the others")
    show_match: BoolProperty(
        name="Show Match", update=_preview_changed,
        description="Colour the vertices by how well they are matched: green where the fitted source lies on this "
                    "mesh, red where it doesn't")
    state: StringProperty(
        name="State", get=lambda self: live_transfer.state(self.id_data),
        description="Whom this mesh follows, or what is wrong and what to do")
    failed: CollectionProperty(
        name="Failed", type=DetailDeformTransferFailure,
        description="Meshes that this one could not be transferred to, and why")
    live: BoolProperty(options={'HIDDEN'})
    prepared_for: StringProperty(options={'HIDDEN'})
    problem: StringProperty(options={'HIDDEN'})


_WITHOUT_CALLBACK = {'filepath', 'pairs_of'}  # only when following or a transfer starts: no update callback
declare(DetailDeformTransfer, TRANSFER_SETTINGS,
        lambda option: None if option.name in _WITHOUT_CALLBACK else _changed)

register, unregister = bpy.utils.register_classes_factory((DetailDeformTransferFailure, DetailDeformTransfer))
