# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for the modifier, binding and applying; scripts call these as bpy.ops.object.detail_deform_..."""

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ..follow import binding, lifecycle, live_transfer, registry, slow_results, status
from ..library.options import SETTINGS
from ..results import bake
from ..scene import (apply_result, cache_modifier, channel, deform_modifier, mesh_data, offset_attribute, saved_match,
                     selection, stack)
from ..setup import at_rest, handle_setup
from .operator_base import HandleEmptyOperator, MeshOperator


class OBJECT_OT_detail_deform_add(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_add'
    bl_label = "Add Detail Deform"
    bl_description = "Add the modifier that shows the deformation. The mesh itself stays as it is"

    @classmethod
    def poll_object(cls, ob):
        if deform_modifier.find(ob):
            cls.poll_message_set("The object has Detail Deform already: see Properties > Modifiers")
            return False
        return True

    def run(self, context, ob):
        mesh_data.check_object(ob)
        stack.ensure_modifier(ob)


class OBJECT_OT_detail_deform_place(HandleEmptyOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_place'
    bl_label = "Move to Its Place"
    bl_description = ("Move Detail Deform in the modifier stack to where it gives the right result: before all that "
                      "moves the mesh or makes vertices of it, and behind what overwrites positions")

    @classmethod
    def poll_object(cls, ob):
        if not stack.is_misplaced(ob):
            cls.poll_message_set("No modifier before Detail Deform should stand behind it")
            return False
        return True

    def run(self, context, ob):
        stack.move_to_its_place(ob)


class OBJECT_OT_detail_deform_remove(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_remove'
    bl_label = "Remove All of Detail Deform"
    bl_description = ("Leave the object as it was found: remove the modifier, the stored deformation, "
                      "all settings, and the vertex groups and empties that were made here")

    def run(self, context, ob):
        registry.check_mesh(ob)
        binding.unbind(ob)
        live_transfer.stop(ob)
        saved_match.forget(ob)
        bake.drop_cache(ob)
        channel.remove(ob)
        handle_setup.remove_made(ob)
        ob.property_unset('detail_deform')


class OBJECT_OT_detail_deform_bind(HandleEmptyOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_bind'
    bl_label = "Bind"
    bl_description = ("Attach the region to its handles: the empties' present places are the rest. From "
                      "then on the surface follows them")

    wait: BoolProperty(
        name="Wait", default=False, options={'SKIP_SAVE'},
        description="Return when the surface is bound, instead of binding in the background")
    keep_rest: BoolProperty(
        name="Keep Rest", default=False, options={'SKIP_SAVE'},
        description="Keep the rest places of the last Bind, so that the present pose stays")

    def run(self, context, ob):
        wait = self.wait or bpy.app.background
        binding.bind(ob, context.evaluated_depsgraph_get(), wait, self.keep_rest)
        if ob.detail_deform.problem:
            self.report({'WARNING'}, ob.detail_deform.problem)


class OBJECT_OT_detail_deform_bind_cancel(HandleEmptyOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_bind_cancel'
    bl_label = "Cancel"
    bl_description = "Stop what is under way: the bind, or the slow result"
    bl_options = {'REGISTER'}

    def run(self, context, ob):
        binding.cancel(ob)
        slow_results.cancel(offset_attribute.token(ob.data))


class OBJECT_OT_detail_deform_unbind(HandleEmptyOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_unbind'
    bl_label = "Unbind"
    bl_description = ("Detach the surface from its handles and show its rest shape. Settings stay, and until the next "
                      "Bind the handles can go back to rest")

    def run(self, context, ob):
        registry.check_mesh(ob)
        binding.unbind(ob, keep_rest=True)
        live_transfer.stop(ob)


class OBJECT_OT_detail_deform_update(HandleEmptyOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_update'
    bl_label = "Update"
    bl_description = "Bring the surface up to date with its handles now"

    def run(self, context, ob):
        settings = ob.detail_deform
        if not settings.signature:
            raise mesh_data.MeshProblem(f"'{ob.name}' is not bound: press Bind first.")
        lifecycle.compare(ob)
        binding.show_again(ob)
        lifecycle.refresh(ob, context.evaluated_depsgraph_get(), force=True)
        if settings.stale or settings.problem:
            raise mesh_data.MeshProblem(status.text(ob))


def _settle_what_is_seen(ob):
    """Waits for the final result. Raises MeshProblem if the live deformation is not what is displayed."""
    mesh_data.check_object(ob)
    modifier = deform_modifier.find(ob)
    if cache_modifier.find(ob):
        raise mesh_data.MeshProblem("A baked cache is played in place of the deformation: press Go Live first, or "
                                    "apply the cache's modifier.")
    if modifier and not modifier.show_viewport:
        raise mesh_data.MeshProblem("The modifier is hidden, so there is nothing to see that could be applied: "
                                    "show it in the viewport first.")
    lifecycle.settle(ob)


class OBJECT_OT_detail_deform_save_key(HandleEmptyOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_save_key'
    bl_label = "Save as Shape Key"
    bl_description = ("Keep what is shown as a new shape key, put all handles back to rest, and go on: an expression "
                      "after the other, with one binding")

    name: StringProperty(name="Name", default="Expression", options={'SKIP_SAVE'},
                         description="Name of the shape key")

    @classmethod
    def poll_object(cls, ob):
        if not ob.detail_deform.signature:
            cls.poll_message_set("Press Bind first, and move a handle")
            return False
        return True

    def run(self, context, ob):
        with selection.object_mode(ob):
            _settle_what_is_seen(ob)
            name = apply_result.save_key(ob, self.name or "Expression")
            ob.detail_deform.expressions.add().name = name
            if ob.detail_deform.weights_by == 'SLIDERS':  # the saved key has what they did, or it would be doubled
                for example in ob.detail_deform.examples:
                    example.weight = 0.0
            at_rest.all_to_rest(context, ob)
        self.report({'INFO'}, f"Saved as '{name}', with value 0; the handles are at rest")


class OBJECT_OT_detail_deform_apply(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_apply'
    bl_label = "Apply Detail Deform"
    bl_description = "Make what is shown part of the mesh, and detach it from its handles"

    mode: EnumProperty(
        name="As", default='MESH', description="What the deformation becomes part of",
        items=[('MESH', "Mesh", "Move the mesh's vertices, and those of its shape keys with them"),
               ('SHAPE_KEY', "Shape Key", "Add a shape key that holds the deformation, at full value")])
    remove_handles: BoolProperty(
        name="Remove Handles", default=False, options={'SKIP_SAVE'},
        description="Remove the handles, too, with the empties and vertex groups that were made for them")

    @classmethod
    def poll_object(cls, ob):
        if offset_attribute.find(ob.data) is None:
            cls.poll_message_set("There is no deformation to apply: press Bind, and move a handle first")
            return False
        return True

    def run(self, context, ob):
        with selection.object_mode(ob):
            _settle_what_is_seen(ob)
            apply_result.apply(ob, self.mode)
            binding.unbind(ob)
            live_transfer.stop(ob)
            channel.remove(ob)
            if self.remove_handles:
                handle_setup.remove_made(ob)


class OBJECT_OT_detail_deform_base_make(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_base_make'
    bl_label = "Make Base Object"
    bl_description = ("Make the computed base surface an object of its own, with the vertex groups of this "
                      "one: rig or deform it in any way, and the details follow after the next Bind")

    @classmethod
    def poll_object(cls, ob):
        if ob.detail_deform.base == 'OBJECT' and ob.detail_deform.base_object:
            cls.poll_message_set("There is a base object already: set Base to Computed to make another one")
            return False
        return True

    def run(self, context, ob):
        binding.make_base_object(ob)


class OBJECT_OT_detail_deform_copy_settings(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_copy_settings'
    bl_label = "Copy Settings to Selected"
    bl_description = ("Give the other selected meshes the method and all other settings of this one. Their handles, "
                      "regions and base objects stay")

    def run(self, context, ob):
        others = [other for other in context.selected_objects if other.type == 'MESH' and other != ob]
        if not others:
            raise mesh_data.MeshProblem(f"No other mesh is selected: select those to get the settings of '{ob.name}'.")
        for other in others:
            for option in SETTINGS:
                if option.copied:
                    setattr(other.detail_deform, option.name, getattr(ob.detail_deform, option.name))


CLASSES = (OBJECT_OT_detail_deform_add, OBJECT_OT_detail_deform_place, OBJECT_OT_detail_deform_remove,
           OBJECT_OT_detail_deform_bind, OBJECT_OT_detail_deform_bind_cancel,
           OBJECT_OT_detail_deform_unbind, OBJECT_OT_detail_deform_update,
           OBJECT_OT_detail_deform_save_key,
           OBJECT_OT_detail_deform_apply, OBJECT_OT_detail_deform_base_make,
           OBJECT_OT_detail_deform_copy_settings)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
