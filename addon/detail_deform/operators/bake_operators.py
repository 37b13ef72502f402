# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that bake; scripts call these as bpy.ops.object.detail_deform_bake..."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ..follow import registry
from ..results import alembic, bake, keyframed_weights, point_cache
from ..scene import cache_modifier, mesh_data
from .operator_base import PATH_OPTIONS, LongOperator, MeshOperator


def _usual_path(ob):
    return point_cache.usual_path(ob, cache_modifier.find(ob))


class OBJECT_OT_detail_deform_bake(LongOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_bake'
    bl_label = "Bake Detail Deform"
    bl_description = "Keep the deformation of a range of frames, so that it plays without the add-on. Esc cancels"
    task = "Baking Detail Deform"

    mode: EnumProperty(
        name="As", default='CACHE', description="What the frames are kept as",
        items=[('CACHE', "Mesh Cache",
                "A point cache (PC2), played by a Mesh Cache modifier in place of the live deformation"),
               ('SHAPE_KEYS', "Shape Keys", "A keyed shape key for each frame, within this file: for few frames"),
               ('ALEMBIC', "Alembic", "The object with all its modifiers as an Alembic file, for other programs"),
               ('SLIDERS', "Sliders of Examples",
                "Keys of the examples' sliders: the weights that the handles ask for, which then are let go"),
               ('KEY_VALUES', "Values of Examples' Keys",
                "The same weights as keyed values of the examples' shape keys, for few limbs that turn little, as "
                "shape keys mix along straight lines")])
    frame_start: IntProperty(
        name="First Frame", description="First frame to bake; that of the scene unless given")
    frame_end: IntProperty(
        name="Last Frame", description="Last frame to bake; that of the scene unless given")
    filepath: StringProperty(
        name="File", subtype='FILE_PATH', options=PATH_OPTIONS,
        description="Where the cache goes; // is the folder of this file")
    cache_start: IntProperty(
        name="Cache's First Frame", options={'SKIP_SAVE'},
        description="When only a part of a cache is baked: the first frame of the whole. "
                    "Parts of one cache may be written at the same time")
    cache_end: IntProperty(
        name="Cache's Last Frame", options={'SKIP_SAVE'},
        description="When only a part of a cache is baked: the last frame of the whole")
    use: BoolProperty(
        name="Use", default=True, options={'SKIP_SAVE'},
        description="Play the baked cache in place of the live deformation at once, if it is whole")

    @classmethod
    def poll_object(cls, ob):
        if not ob.detail_deform.signature:
            cls.poll_message_set("Press Bind first: there is nothing to bake")
            return False
        return True

    def invoke(self, context, event):
        self.frame_start, self.frame_end = self.frame_range(context)
        self.filepath = self.filepath or _usual_path(context.active_object)
        self.interactive = True
        return context.window_manager.invoke_props_dialog(self, width=400)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        column = layout.column()
        column.prop(self, 'mode')
        column.prop(self, 'frame_start')
        column.prop(self, 'frame_end')
        if self.mode in {'CACHE', 'ALEMBIC'}:
            column.prop(self, 'filepath')

    def run(self, context, ob):
        start, end = self.frame_range(context)
        path = self.filepath or _usual_path(ob)
        # These two don't write to the mesh, which may have several users then.
        (registry.check_mesh if self.mode in {'CACHE', 'ALEMBIC'} else mesh_data.check_object)(ob)
        if self.mode == 'ALEMBIC':
            alembic.write(context, ob, start, end, path[:-4] + '.abc' if path.lower().endswith('.pc2') else path)
            return None
        by_weights = {'SLIDERS': keyframed_weights.to_sliders, 'KEY_VALUES': keyframed_weights.to_key_values}
        if self.mode in by_weights:
            work = self._watched(ob, by_weights[self.mode](context, ob, start, end,
                                                           lambda said: self.report({'WARNING'}, said)))
        elif self.mode == 'SHAPE_KEYS':
            work = bake.to_shape_keys(context, ob, start, end)
        else:
            whole = (self.value_or('cache_start', start), self.value_or('cache_end', end))
            work = self._cache(context, ob, start, end, path, whole)
        return self.start(context, work)

    def _watched(self, ob, work):
        for done in work:
            self.keeps_partial_work = ob.detail_deform.weights_by == 'SLIDERS'  # keyed by now; what follows compares
            yield done

    def _cache(self, context, ob, start, end, path, whole):
        yield from bake.to_cache(context, ob, start, end, path, whole)
        if self.use and (start, end) == whole:  # a part lacks the other frames
            bake.use_cache(ob, path, whole[0])


class OBJECT_OT_detail_deform_bake_use(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_bake_use'
    bl_label = "Use Baked Cache"
    bl_description = "Play a cache that was baked, by whichever Blender, in place of the live deformation"

    filepath: StringProperty(name="File", subtype='FILE_PATH', options=PATH_OPTIONS,
                             description="A point cache (PC2)")
    filter_glob: StringProperty(default="*.pc2", options={'HIDDEN'})
    frame_start: IntProperty(name="First Frame", default=1, description="First frame of the cache")

    def invoke(self, context, event):
        self.frame_start = context.scene.frame_start
        context.window_manager.fileselect_add(self)
        return {'RUNNING_MODAL'}

    def run(self, context, ob):
        bake.use_cache(ob, self.filepath, self.frame_start)


class OBJECT_OT_detail_deform_bake_drop(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_bake_drop'
    bl_label = "Go Live"
    bl_description = "Follow the handles again instead of playing the baked cache. Its file stays"

    @classmethod
    def poll_object(cls, ob):
        if not cache_modifier.find(ob):
            cls.poll_message_set("No baked cache is used")
            return False
        return True

    def run(self, context, ob):
        bake.drop_cache(ob)


CLASSES = (OBJECT_OT_detail_deform_bake, OBJECT_OT_detail_deform_bake_use, OBJECT_OT_detail_deform_bake_drop)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
