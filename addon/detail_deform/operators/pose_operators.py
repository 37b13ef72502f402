# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that make examples of an armature's poses; scripts call these as bpy.ops.object.detail_deform_examples...
and detail_deform_example..."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty

from ..follow import lifecycle
from ..results import missing_examples, pose_frames, posed_examples
from ..scene import mesh_data, posers
from .operator_base import LongOperator, MeshOperator


def _listed(names):
    return ', '.join(f"'{name}'" for name in names)


class _OfPoses(LongOperator):
    """Base of operators that iterate over poses of the mesh."""

    frame_start: IntProperty(name="First Frame", options={'SKIP_SAVE'}, description="That of the scene unless given")
    frame_end: IntProperty(name="Last Frame", options={'SKIP_SAVE'}, description="That of the scene unless given")
    step: IntProperty(name="Step", default=1, min=1, description="Of the range, each so manieth frame")

    def invoke(self, context, event):
        self.frame_start, self.frame_end = self.frame_range(context)
        self.interactive = True
        return context.window_manager.invoke_props_dialog(self, width=400)

    def poses(self, context, ob):
        if self.frames == 'KEYS':
            return pose_frames.at_keys(ob)
        if self.frames == 'MARKERS':
            return pose_frames.at_markers(context.scene)
        if self.frames == 'LIBRARY':
            return pose_frames.in_library(ob)
        return pose_frames.in_range(*self.frame_range(context), self.step)

    def draw_range(self, column):
        if self.frames in {'RANGE', 'DIFFERENT'}:
            column.prop(self, 'frame_start')
            column.prop(self, 'frame_end')
            column.prop(self, 'step')


_FRAMES = [('RANGE', "Range", "Each frame of a range, by a step"),
           ('KEYS', "Keys", "The frames at which the armature's action has keys"),
           ('MARKERS', "Markers", "The frames of the timeline's markers, whose names the examples get"),
           ('LIBRARY', "Pose Library", "The actions that are one pose of the armature, as poses of the library are")]


class OBJECT_OT_detail_deform_examples_from_poses(_OfPoses, bpy.types.Operator):
    bl_idname = 'object.detail_deform_examples_from_poses'
    bl_label = "Examples from Poses"
    bl_description = ("Make shape keys and examples of poses that this mesh has by its armature, or by what else moves "
                      "its vertices. Esc cancels")
    task = "Going through the poses"

    frames: EnumProperty(
        name="Poses", default='DIFFERENT', description="Which poses become examples",
        items=[('DIFFERENT', "Most Different", "Of a range of frames those that differ most, so many"), *_FRAMES])
    count: IntProperty(name="Number", default=8, min=1, max=posed_examples.MOST,
                       description="Of those that differ most, how many")
    switch_off: BoolProperty(
        name="Switch Off Armature", default=True,
        description="Switch off what has posed the mesh, which would pose the result once more")

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        column = layout.column()
        column.prop(self, 'frames')
        if self.frames == 'DIFFERENT':
            column.prop(self, 'count')
        self.draw_range(column)
        column.prop(self, 'switch_off')

    def run(self, context, ob):
        poses = self.poses(context, ob)
        return self.start(context, self._add(context, ob, poses))

    def _add(self, context, ob, poses):
        names, changing = yield from posed_examples.add(
            context, ob, poses, self.count if self.frames == 'DIFFERENT' else 0)
        off = posers.switch_off(ob) if self.switch_off else []
        lifecycle.compare(ob)
        done = [f"{len(names):,} {'example' if len(names) == 1 else 'examples'} added"]
        done += [f"{_listed(off)} switched off"] * bool(off)
        self.report({'INFO'}, '; '.join(done))
        if changing:
            self.report({'WARNING'}, f"The shape keys {_listed(changing[:3])} change with the pose and are part of the "
                                     "examples: mute them, or they act twice.")


class OBJECT_OT_detail_deform_examples_find_missing(_OfPoses, bpy.types.Operator):
    bl_idname = 'object.detail_deform_examples_find_missing'
    bl_label = "Find Missing Examples"
    bl_description = ("Show poses of the armature to the handles alone, and list where what the examples make of them "
                      "differs most from the poses. Esc cancels")
    task = "Comparing with the poses"

    frames: EnumProperty(name="Poses", description="Which poses are compared", items=_FRAMES)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        column = layout.column()
        column.prop(self, 'frames')
        self.draw_range(column)

    def run(self, context, ob):
        mesh_data.check_object(ob)
        missing_examples.check(ob)
        return self.start(context, self._find(context, ob, self.poses(context, ob)))

    def _find(self, context, ob, poses):
        found, of_each = yield from missing_examples.find(context, ob, poses)
        missing_examples.store_list(ob, found, of_each)
        worst = max(found, key=lambda missed: missed.rms)
        self.report({'INFO'}, f"'{worst.pose.name}' is met worst: {100 * worst.mean:.2g}% of the mesh's size in the "
                              f"mean, {100 * worst.largest:.2g}% at most"
                              + ("" if of_each else ". No example is missing"))


class OBJECT_OT_detail_deform_example_add_missing(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_example_add_missing'
    bl_label = "Add as Example"
    bl_description = "Make a shape key and an example of this pose, and bind again"

    index: IntProperty(name="Index", default=-1, options={'SKIP_SAVE'},
                       description="Which one of the list; the active one unless given")

    @classmethod
    def poll_object(cls, ob):
        if not ob.detail_deform.missing_examples:
            cls.poll_message_set("No pose is listed: press Find Missing first")
            return False
        return True

    def run(self, context, ob):
        mesh_data.check_object(ob)
        settings = ob.detail_deform
        index = min(self.index if self.index >= 0 else settings.missing_index, len(settings.missing_examples) - 1)
        name = missing_examples.add(context, ob, index)
        lifecycle.compare(ob)
        self.report({'INFO'}, f"Example '{name}' added")


class OBJECT_OT_detail_deform_posers_off(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_posers_off'
    bl_label = "Switch Off Armature"
    bl_description = "Switch off, in the viewport and in renders, the modifiers whose poses are examples now"

    @classmethod
    def poll_object(cls, ob):
        if not posers.applied_twice(ob):
            cls.poll_message_set("Nothing poses the mesh whose poses are examples")
            return False
        return True

    def run(self, context, ob):
        posers.switch_off(ob)


CLASSES = (OBJECT_OT_detail_deform_examples_from_poses, OBJECT_OT_detail_deform_examples_find_missing,
           OBJECT_OT_detail_deform_example_add_missing, OBJECT_OT_detail_deform_posers_off)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
