# SPDX-License-Identifier: GPL-3.0-or-later
"""Object.detail_deform: what the user sets, what a binding stores, what can be read."""

import bpy
from bpy.props import (BoolProperty, CollectionProperty, EnumProperty, FloatProperty,
                       FloatVectorProperty, IntProperty, PointerProperty, StringProperty)

from . import binding


def _input_changed(self, context):
    binding.check_content(self.id_data)


def _target_changed(self, context):
    binding.targets_changed(self.id_data)


def _look_changed(self, context):
    binding.refresh(self.id_data, context.evaluated_depsgraph_get())


class DetailDeformHandle(bpy.types.PropertyGroup):
    name: StringProperty(name="Name", description="Name of this handle", default="Handle")
    vertex_group: StringProperty(
        name="Vertices", update=_input_changed,
        description="Vertex group that moves as one piece with the empty: the vertices with a weight over 0.5")
    target: PointerProperty(
        name="Empty", type=bpy.types.Object, poll=lambda self, ob: ob.type == 'EMPTY',
        update=_target_changed,
        description="Empty that moves, turns and scales these vertices; it may be animated, parented or constrained")
    enabled: BoolProperty(
        name="Enabled", default=True, update=_input_changed,
        description="Let this handle hold and move its vertices. Without it they follow the others like the rest of the region. Takes effect at the next Bind")
    rest_matrix: FloatVectorProperty(
        name="Rest Matrix", size=16, options={'HIDDEN'},
        description="Place of the empty relative to the object when it was bound, row by row")
    made_group: BoolProperty(options={'HIDDEN'})
    made_target: BoolProperty(options={'HIDDEN'})


class DetailDeformSettings(bpy.types.PropertyGroup):
    region: StringProperty(
        name="Region", update=_input_changed,
        description="Vertex group of the part that may deform: the vertices with a weight over 0.5. The rest of the mesh stays where it is. Empty: the whole mesh may deform")
    handles: CollectionProperty(type=DetailDeformHandle)
    handle_index: IntProperty(name="Active Handle", options={'HIDDEN'})
    method: EnumProperty(
        name="Method",
        items=[('TRANSFER', "Detail Transfer", "A smooth base surface is deformed, and details turn with it (Botsch, Sumner, Pauly, Gross 2006)")],
        description="How the surface follows its handles")
    rotation_only: BoolProperty(
        name="Rotation Only", default=True, update=_look_changed,
        description="Details only turn with the surface and keep their size. Off: they are stretched and sheared with it too")
    base_metric: EnumProperty(
        name="Stiffness", update=_input_changed,
        items=[('SURFACE', "From Surface", "Stiffness measured on the surface itself: exact when all handles move together, fast to bind"),
               ('BASE', "From Base", "Stiffness measured on the smooth base surface, as in the paper: sensitive where the base has tiny triangles")],
        description="Where the stiffness of the base surface is measured. Takes effect at the next Bind")
    metric_smoothing: FloatProperty(
        name="Smoothing", default=0.0, min=0.0, soft_max=4.0, max=100.0, update=_input_changed,
        description="Measure the stiffness on a slightly smoothed copy of the surface, in mean edge lengths: evens out the pull where the relief is strong. Takes effect at the next Bind")
    live: BoolProperty(
        name="Live", default=True,
        description="Follow every move of the handles. Off: only when Update is pressed")

    is_bound: BoolProperty(
        name="Bound", get=lambda self: binding.is_bound(self.id_data),
        description="Whether the handles move the surface now")
    status: StringProperty(
        name="Status", get=lambda self: binding.status(self.id_data),
        description="What is going on, or what is wrong and what to do")
    bind_ms: FloatProperty(
        name="Bind Time", get=lambda self: binding.bind_ms(self.id_data),
        description="Milliseconds the last Bind of this surface took")
    update_ms: FloatProperty(
        name="Update Time", get=lambda self: binding.update_ms(self.id_data),
        description="Milliseconds from a handle's move to the stored result, last time")

    # The binding, kept in the file: the content it was made for, how that has changed since, and
    # what keeps the handles from being followed.
    signature: StringProperty(options={'HIDDEN'})
    stale: StringProperty(options={'HIDDEN'})
    problem: StringProperty(options={'HIDDEN'})
    dependency: FloatProperty(
        name="Dependency", options={'HIDDEN', 'ANIMATABLE'},
        description="Its driver keeps the empties evaluated where they are hidden; the value is of no use")


CLASSES = (DetailDeformHandle, DetailDeformSettings)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.detail_deform = PointerProperty(type=DetailDeformSettings)


def unregister():
    del bpy.types.Object.detail_deform
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
