# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for deformation transfer from one mesh to another; scripts call these as
bpy.ops.object.detail_deform_transfer..."""

from types import SimpleNamespace

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty

from ..declared import declare
from ..follow import live_transfer, transfer_cache
from ..library.options import NEAREST, TRANSFER_SETTINGS
from ..results import transfer, transfer_table
from ..scene import correspondence, files, mesh_data, saved_match
from ..scene.selection import go_to
from ..setup import marker_check, markers, matching, pair_lists
from .operator_base import PATH_OPTIONS, LongOperator, MeshOperator
from .transfer_choices import TransferChoices


def _source_of(ob, name):
    source = bpy.data.objects.get(name) if name else ob.detail_deform.transfer.source
    if name and source is None:
        raise mesh_data.MeshProblem(f"There is no object '{name}' to transfer from: choose another Source.")
    correspondence.check_source(source, ob)
    return source


class OBJECT_OT_detail_deform_transfer(TransferChoices, bpy.types.Operator):
    bl_idname = 'object.detail_deform_transfer'
    bl_label = "Transfer Deformation"
    bl_description = "Deform this mesh as another one is deformed. Esc cancels"
    task = "Transferring the deformation"

    source: StringProperty(
        name="Source", options={'SKIP_SAVE'},
        description="Name of the mesh object whose deformation is transferred; that of the panel unless given")
    cache_path: StringProperty(
        name="Cache", subtype='FILE_PATH', options=PATH_OPTIONS,
        description="Where an animation's cache goes; beside this file unless given")

    def invoke(self, context, event):
        ob = context.active_object
        settings = ob.detail_deform.transfer
        if not self.source and settings.source:
            self.source = settings.source.name
        for name, value in self._as_in_panel(settings).items():
            setattr(self, name, value)
        self.frame_start, self.frame_end = self.frame_range(context)
        self.cache_path = self.cache_path or transfer.usual_path(ob)
        self.interactive = True
        return context.window_manager.invoke_props_dialog(self, width=400)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        column = layout.column()
        column.prop_search(self, 'source', bpy.data, 'objects')
        self.draw_choices(column)
        if self.what == 'ANIMATION' and self.bake_as == 'CACHE':
            column.prop(self, 'cache_path')
        column.separator()
        column.prop(self, 'correspondence')
        if self.correspondence == 'LIST':
            column.prop(self, 'filepath')
            column.prop(self, 'pairs_of')
        column.prop(self, 'rotation_only')
        if not self.rotation_only:
            column.prop(self, 'placing')
        if self.correspondence == NEAREST:
            column.prop(self, 'keep_outside')
            column.prop(self, 'gap')
        column.prop(self, 'anchor')
        if self.anchor in {'VERTICES', 'PINNED'}:
            column.prop_search(self, 'anchor_group', context.active_object, 'vertex_groups')

    def run(self, context, ob):
        source = _source_of(ob, self.source)
        wanted = self.request(context, source, SimpleNamespace(**self._as_in_panel(ob.detail_deform.transfer)),
                              cache_path=self.cache_path)
        transfer_cache.begin_run()
        return self.start(context, self._reported(source, ob, transfer.begin(context, source, ob, wanted)))

    def _as_in_panel(self, settings):
        """{name: value} of all transfer settings: the operator's where given, else the panel's."""
        return {option.name: self.value_or(option.name, getattr(settings, option.name)) for option in TRANSFER_SETTINGS}

    def _reported(self, source, ob, work):
        outcome = yield from work
        transfer_table.note(source, ob.name, ob, "")
        for sentence in (f"{outcome.made()} from '{source.name}' in {outcome.seconds:.1f} s", *outcome.notes()):
            self.report({'INFO'}, sentence)


declare(OBJECT_OT_detail_deform_transfer, [option.as_argument for option in TRANSFER_SETTINGS],
        flags_of=lambda option: PATH_OPTIONS if option.limits.get('subtype') == 'FILE_PATH' else {'SKIP_SAVE'})


class OBJECT_OT_detail_deform_transfer_match(LongOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_transfer_match'
    bl_label = "Find Match"
    bl_description = ("Fit the source to this mesh, by the markers on both if there are any, and save which faces "
                      "correspond with this mesh, to be used again. Esc cancels")
    task = "Looking for what corresponds"

    source: StringProperty(
        name="Source", options={'SKIP_SAVE'},
        description="Name of the mesh object to transfer from; that of the panel unless given")

    def invoke(self, context, event):
        self.interactive = True
        return self.execute(context)

    def run(self, context, ob):
        mesh_data.check_object(ob)
        source = _source_of(ob, self.source)
        markers.pairs(source, ob)
        return self.start(context, self._find(source, ob))

    def _find(self, source, ob):
        doubts = yield from marker_check.search(source, ob)
        if doubts:
            self.report({'WARNING'}, marker_check.sentence(doubts, source, ob))
        matched = yield from matching.search(source, ob)
        saved_match.store(matched, source, ob)
        ob.detail_deform.transfer.correspondence = 'STORED'
        ob.detail_deform.transfer.show_match = True  # to be checked before the match is used
        if matched.ambiguous:
            self.report({'WARNING'}, matching.ambiguity(source, ob))
        if matched.mirrored:
            self.report({'WARNING'}, f"By the markers, '{ob.name}' is the mirror image of '{source.name}', so "
                                     "deformations are mirrored: if that is wrong, exchange the numbers of left and "
                                     "right on one of them.")
        self.report({'INFO'}, f"Match found: {100 * matched.confidence.mean():.0f}% alike on the whole, "
                              f"{100 * (matched.confidence < 0.5).mean():.0f}% of the faces less than half. Show Match "
                              "shows where")


class OBJECT_OT_detail_deform_transfer_save(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_transfer_save'
    bl_label = "Write Match to File"
    bl_description = ("Write the Saved Match to a text file, one pair of triangles or vertices a line, source then "
                      "target, counted from 0")
    bl_options = {'REGISTER'}

    source: StringProperty(
        name="Source", options={'SKIP_SAVE'},
        description="Name of the mesh object it was found for; that of the panel unless given")
    filepath: StringProperty(name="File", subtype='FILE_PATH', options=PATH_OPTIONS, description="Where the list goes")

    @classmethod
    def poll_object(cls, ob):
        if not saved_match.is_stored(ob):
            cls.poll_message_set("This mesh has no Saved Match")
            return False
        return True

    def invoke(self, context, event):
        self.filepath = self.filepath or files.name_for(context.active_object.name) + ".txt"
        context.window_manager.fileselect_add(self)
        return {'RUNNING_MODAL'}

    def run(self, context, ob):
        source = _source_of(ob, self.source)
        pair_lists.write_pairs(bpy.path.abspath(self.filepath), saved_match.stored(source, ob))


class OBJECT_OT_detail_deform_transfer_forget(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_transfer_forget'
    bl_label = "Forget Match"
    bl_description = "Remove the Saved Match from this mesh"

    poll_object = OBJECT_OT_detail_deform_transfer_save.poll_object

    def run(self, context, ob):
        if ob.detail_deform.transfer.live:
            raise mesh_data.MeshProblem(f"'{ob.name}' follows its source by its Saved Match: press Follow to stop that "
                                        "first.")
        saved_match.forget(ob)
        ob.detail_deform.transfer.property_unset('correspondence')
        ob.detail_deform.transfer.show_match = False


class OBJECT_OT_detail_deform_marker_add(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_marker_add'
    bl_label = "Add Transfer Marker"
    bl_description = ("Mark the selected vertex with the next number, as a vertex group. The vertex that corresponds "
                      "on the other mesh gets the same number")

    number: IntProperty(name="Number", min=0, options={'SKIP_SAVE'},
                        description="Number of the marker; 0 for the next free one")

    @classmethod
    def poll_object(cls, ob):
        return cls.in_edit_mode(ob)

    def run(self, context, ob):
        name = markers.add(ob, self.number)
        self.report({'INFO'}, f"'{name}' added to '{ob.name}'")


class OBJECT_OT_detail_deform_marker_select(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_marker_select'
    bl_label = "Select Marker"
    bl_description = "Select the vertex of a marker in Edit Mode, or the empty that marks it"

    number: IntProperty(name="Number", default=1, min=0, options={'SKIP_SAVE'}, description="Number of the marker")

    def run(self, context, ob):
        empty = markers.select(ob, self.number)
        if empty:
            go_to(context, ob, empty)


class OBJECT_OT_detail_deform_target_activate(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_target_activate'
    bl_label = "Select Target"
    bl_description = "Select this target, to see its settings"

    target: StringProperty(name="Target", options={'SKIP_SAVE'}, description="Name of the mesh object")

    def run(self, context, ob):
        target = bpy.data.objects.get(self.target)
        if target is None:
            raise mesh_data.MeshProblem(f"'{self.target}' is not in this scene, or is in an excluded collection.")
        go_to(context, ob, target)


class OBJECT_OT_detail_deform_transfer_live(LongOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_transfer_live'
    bl_label = "Follow Source"
    bl_description = ("Let this mesh follow the source's deformation from now on, or stop it. What shapes or a "
                      "list say is found first and saved with this mesh. Esc cancels")
    task = "Looking for what corresponds"

    source: StringProperty(
        name="Source", options={'SKIP_SAVE'},
        description="Name of the mesh object to follow; that of the panel unless given")
    on: BoolProperty(name="On", default=True, options={'SKIP_SAVE'},
                     description="Follow; off: stop, and show the rest shape")

    def invoke(self, context, event):
        # Only a search takes so long that it must be cancellable.
        self.interactive = self.on and context.active_object.detail_deform.transfer.correspondence == 'MARKERS'
        return self.execute(context)

    def run(self, context, ob):
        if not self.on:
            live_transfer.stop(ob)
            return None
        mesh_data.check_object(ob)
        source = _source_of(ob, self.source)
        live_transfer.check_start(ob, source)
        return self.start(context, self._follow(context, source, ob))

    def _follow(self, context, source, ob):
        """Generator of the fraction done."""
        settings, matched = ob.detail_deform.transfer, None
        if matching.needs_search(settings.correspondence):
            matched = yield from matching.find(settings.correspondence, source, ob, settings.filepath,
                                               settings.pairs_of)
        live_transfer.start(context, ob, source, matched)


CLASSES = (OBJECT_OT_detail_deform_transfer, OBJECT_OT_detail_deform_transfer_match,
           OBJECT_OT_detail_deform_transfer_save, OBJECT_OT_detail_deform_transfer_forget,
           OBJECT_OT_detail_deform_marker_add, OBJECT_OT_detail_deform_marker_select,
           OBJECT_OT_detail_deform_target_activate, OBJECT_OT_detail_deform_transfer_live)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
