# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for handles and regions; scripts call these as bpy.ops.object.detail_deform_..."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..follow import hints, lifecycle
from ..scene import handle_owners, handle_rests, mesh_data
from ..scene.selection import activate, go_to
from ..setup import at_rest, handle_setup, mirroring, own_empties, region_setup
from .operator_base import HandleEmptyOperator, MeshOperator
from ..properties import AXES


class _HandleOperator(MeshOperator):
    """Base of operators on the handle with a given number, or on the active one."""

    index: IntProperty(name="Index", default=-1, min=-1, options={'SKIP_SAVE', 'HIDDEN'},
                       description="Number of the handle; the active one when -1")

    @classmethod
    def poll_object(cls, ob):
        if not ob.detail_deform.handles:
            cls.poll_message_set("There is no handle: add one first")
            return False
        return True

    def chosen_index(self, ob):
        settings = ob.detail_deform
        index = settings.handle_index if self.index < 0 else self.index
        if not 0 <= index < len(settings.handles):
            raise mesh_data.MeshProblem(f"There is no handle {index} of '{ob.name}': they are counted from 0.")
        return index

    def handle(self, ob):
        return ob.detail_deform.handles[self.chosen_index(ob)]


class OBJECT_OT_detail_deform_handle_add(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_handle_add'
    bl_label = "Add Handle"
    bl_description = ("Add a handle with a new empty at the middle of its vertices. In Edit Mode it takes "
                      "the selected vertices, else those of the given vertex group")

    @classmethod
    def description(cls, context, properties):
        return {'ISLAND': "Add a handle for each part of the selection that edges hold together",
                'VERTEX': "Add a handle for each selected vertex"}.get(properties.each, cls.bl_description)

    vertex_group: StringProperty(
        name="Vertex Group", options={'SKIP_SAVE'},
        description="Group of the handle's vertices, outside Edit Mode; the active group when empty")
    each: EnumProperty(
        name="Handles", options={'SKIP_SAVE'}, description="How many handles the selected vertices become",
        items=[('SELECTION', "One", "One handle of all selected vertices"),
               ('ISLAND', "For Each Island", "A handle for each part of the selection that edges hold together"),
               ('VERTEX', "For Each Vertex", "A handle for each selected vertex")])
    align: BoolProperty(
        name="Align to Normal", default=True,
        description="Let the empty's Z axis point away from the surface; off: along the world's")
    parented: BoolProperty(
        name="Parent to Object", default=True,
        description="Make the empty a child of the object, so that moving the object takes it along")

    def run(self, context, ob):
        handle_setup.add_handles(context, ob, self.vertex_group, self.each, self.parented, self.align)


class OBJECT_OT_detail_deform_handle_remove(_HandleOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_handle_remove'
    bl_label = "Remove Handle"
    bl_description = "Remove a handle, and the vertex group and the empty if they were made for it"

    def run(self, context, ob):
        settings, index = ob.detail_deform, self.chosen_index(ob)
        handle_setup.remove_handles(ob, [index])
        settings.handle_index = max(0, min(index, len(settings.handles) - 1))
        lifecycle.compare(ob)


class OBJECT_OT_detail_deform_handle_select(_HandleOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_handle_select'
    bl_label = "Select Vertices"
    bl_description = "Select the handle's vertices in Edit Mode"

    extend: BoolProperty(name="Extend", description="Keep what is selected")

    def run(self, context, ob):
        handle_setup.select(ob, self.handle(ob), self.extend)


class OBJECT_OT_detail_deform_handle_assign(_HandleOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_handle_assign'
    bl_label = "Assign Selected"
    bl_description = ("Make the selected vertices those of the handle. A vertex group that was not made for it "
                      "stays as it is, and the handle gets one of its own. Takes effect at the next Bind")

    @classmethod
    def poll_object(cls, ob):
        return super().poll_object(ob) and cls.in_edit_mode(ob)

    def run(self, context, ob):
        handle_setup.assign(ob, self.handle(ob))


class OBJECT_OT_detail_deform_handle_mirror(_HandleOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_handle_mirror'
    bl_label = "Mirror Handle"
    bl_description = ("Add a handle on the other side: the vertices that mirror those of this one, and an empty "
                      "at the mirrored place. Takes effect at the next Bind")

    axis: EnumProperty(
        name="Axis", items=AXES, description="The object's own axis across which the handle is mirrored")
    symmetric: BoolProperty(
        name="Symmetric", description="Give it no empty of its own: it mirrors every motion of this one")

    def run(self, context, ob):
        remark = mirroring.mirror(context, ob, self.handle(ob), 'XYZ'.index(self.axis), self.symmetric)
        if remark:
            self.report({'WARNING'}, remark)


class OBJECT_OT_detail_deform_handle_reset(HandleEmptyOperator, _HandleOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_handle_reset'
    bl_label = "Back to Rest"
    bl_description = "Put the handle's empty back where its vertices are on the mesh without deformation"

    everything: BoolProperty(name="All", options={'SKIP_SAVE'}, description="Do so with all handles")

    @classmethod
    def poll_object(cls, ob):
        if not any(handle_rests.has_rest(h) for h in ob.detail_deform.handles):
            cls.poll_message_set("No handle was bound, so none has a rest place: press Bind first")
            return False
        return True

    def run(self, context, ob):
        if self.everything:
            at_rest.all_to_rest(context, ob)
        else:
            owner, number = handle_owners.handle_of(context.active_object)
            if owner == ob and self.index < 0:
                self.index = number
            at_rest.to_rest(context, ob, [self.handle(ob)])


class OBJECT_OT_detail_deform_handle_activate(HandleEmptyOperator, _HandleOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_handle_activate'
    bl_label = "Select Empty"
    bl_description = "Select the handle's empty alone, to move it"

    def run(self, context, ob):
        go_to(context, ob, handle_setup.empty_of(ob, self.chosen_index(ob)))


class OBJECT_OT_detail_deform_bring_back(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_bring_back'
    bl_label = "Bring Back Empties"
    bl_description = "Put empties of handles that were deleted where they were last, or make new ones at rest"

    @classmethod
    def poll_object(cls, ob):
        if not hints.gone_empties(ob, bpy.context.view_layer.depsgraph):
            cls.poll_message_set("No handle has lost its empty")
            return False
        return True

    def run(self, context, ob):
        at_rest.bring_back(context, ob)


class OBJECT_OT_detail_deform_own_empties(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_own_empties'
    bl_label = "Own Empties"
    bl_description = ("Give this mesh copies of the empties that it shares with the mesh it was copied from, so that "
                      "each can be moved and posed alone")

    @classmethod
    def poll_object(cls, ob):
        if not hints.shares_empties_with(ob):
            cls.poll_message_set("Its empties are its own already")
            return False
        return True

    def run(self, context, ob):
        own_empties.make(context, ob)


class OBJECT_OT_detail_deform_mesh_activate(bpy.types.Operator):
    bl_idname = 'object.detail_deform_mesh_activate'
    bl_label = "Select Mesh"
    bl_description = "Select the mesh that this empty pulls, to see its settings"
    bl_options = {'REGISTER', 'UNDO'}

    edit: BoolProperty(name="Edit Mode", options={'SKIP_SAVE'},
                       description="Go on in its Edit Mode, where the next vertices are selected")

    @classmethod
    def poll(cls, context):
        ob, _ = handle_owners.handle_of(context.active_object)
        return ob is not None and ob.name in context.view_layer.objects

    def invoke(self, context, event):
        if self.edit and context.active_object.type != 'EMPTY':
            return {'PASS_THROUGH'}  # to what has an Edit Mode of its own: a curve, an armature
        return self.execute(context)

    def execute(self, context):
        ob, number = handle_owners.handle_of(context.active_object)
        ob.detail_deform.handle_index = number
        activate(context, ob)
        if self.edit and not (ob.hide_viewport or mesh_data.why_not_editable(ob)):
            bpy.ops.object.mode_set(mode='EDIT')
        return {'FINISHED'}


class OBJECT_OT_detail_deform_region_set(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_region_set'
    bl_label = "Set Region"
    bl_description = "Make the selected vertices the region that may deform. Takes effect at the next Bind"

    @classmethod
    def poll_object(cls, ob):
        return cls.in_edit_mode(ob)

    def run(self, context, ob):
        region_setup.from_selection(ob)


class OBJECT_OT_detail_deform_region_around(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_region_around'
    bl_label = "Set Region by Radius"
    bl_description = ("Make what lies around the handles the region that may deform; in Edit Mode, what lies "
                      "around the selected vertices. Takes effect at the next Bind")

    by: EnumProperty(
        name="By", description="How far the region reaches",
        items=[('DISTANCE', "Distance", "As far as a distance along the surface"),
               ('EDGES', "Edges", "As far as a number of edges, as Select More does")])
    radius: FloatProperty(
        name="Radius", min=0.0, subtype='DISTANCE', options={'SKIP_SAVE'},
        description="Distance along the surface up to which it may deform. 0: a quarter of the object's size")
    steps: IntProperty(
        name="Edges", default=10, min=1, soft_max=100,
        description="Number of edges up to which the surface may deform")

    def invoke(self, context, event):
        # A popup, as Properties have no panel Adjust Last Operation.
        return context.window_manager.invoke_props_popup(self, event)

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.prop(self, 'by')
        self.layout.prop(self, 'radius' if self.by == 'DISTANCE' else 'steps')

    def run(self, context, ob):
        start = region_setup.starting_vertices(ob)
        if self.by == 'EDGES':
            members = region_setup.grown(ob, start, self.steps)
        else:
            self.radius = self.radius or region_setup.default_radius(ob)
            members = region_setup.within(ob, start, self.radius)
        region_setup.set_region(ob, members)


CLASSES = (OBJECT_OT_detail_deform_handle_add, OBJECT_OT_detail_deform_handle_remove,
           OBJECT_OT_detail_deform_handle_select, OBJECT_OT_detail_deform_handle_assign,
           OBJECT_OT_detail_deform_handle_mirror, OBJECT_OT_detail_deform_handle_reset,
           OBJECT_OT_detail_deform_handle_activate, OBJECT_OT_detail_deform_own_empties,
           OBJECT_OT_detail_deform_bring_back,
           OBJECT_OT_detail_deform_mesh_activate,
           OBJECT_OT_detail_deform_region_set, OBJECT_OT_detail_deform_region_around)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
