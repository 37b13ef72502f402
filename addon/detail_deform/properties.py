# SPDX-License-Identifier: GPL-3.0-or-later
"""Object.detail_deform: what the user sets, what a binding stores, what can be read."""

import bpy
from bpy.props import (BoolProperty, CollectionProperty, EnumProperty, FloatProperty,
                       FloatVectorProperty, IntProperty, PointerProperty, StringProperty)

from . import transfer_settings
from .follow import binding, life, status
from .ui import preview


def _input_changed(self, context):
    life.check(self.id_data)


def _region_changed(self, context):
    self.pulled_region = False
    life.check(self.id_data)


def _name_changed(self, context):
    """Handles are told apart by name; those that mirror this one keep to it."""
    others = [h for h in self.id_data.detail_deform.handles if h != self]
    taken = {h.name for h in others}
    if self.name in taken:
        self.name = next(name for name in (f"{self.name}.{k:03d}" for k in range(1, 10000)) if name not in taken)
        return  # having come here again
    earlier, self.earlier_name = self.earlier_name, self.name
    for handle in others:
        if earlier and handle.mirrors == earlier:
            handle.mirrors = self.name


def _target_changed(self, context):
    binding.targets_changed(self.id_data)


def _base_changed(self, context):
    life.check(self.id_data)
    binding.targets_changed(self.id_data)


def _preview_changed(self, context):
    preview.forget()


def _influence_changed(self, context):
    binding.influence_changed(self.id_data)


def _method_changed(self, context):
    life.check(self.id_data)  # examples matter to one of them
    _look_changed(self, context)


def _look_changed(self, context):
    life.refresh(self.id_data, context.evaluated_depsgraph_get())


def _example_changed(self, context):
    life.check(self.id_data)
    _look_changed(self, context)


def _weights_by_changed(self, context):
    """The sliders go on from what the handles asked for."""
    if self.weights_by == 'SLIDERS' and status.weights_are_found(self.id_data):
        found = [(example, example.found_weight) for example in self.examples if example.enabled]
        for example, weight in found:
            example.weight = weight
    _look_changed(self, context)


AXES = [(letter, letter, f"Across the plane through the object's origin at right angles to its {letter} axis")
        for letter in 'XYZ']


class DetailDeformHandle(bpy.types.PropertyGroup):
    name: StringProperty(name="Name", description="Name of this handle", default="Handle", update=_name_changed)
    vertex_group: StringProperty(
        name="Vertices", update=_input_changed,
        description="Vertex group that moves as one piece with the empty: the vertices with a weight over 0.5")
    target: PointerProperty(
        name="Empty", type=bpy.types.Object, poll=lambda self, ob: ob.type == 'EMPTY',
        update=_target_changed,
        description="Empty that moves, turns and scales these vertices; it may be animated, parented or constrained")
    mirrors: StringProperty(
        name="Mirrors", update=_target_changed,
        description="Handle whose motion this one mirrors, in place of an empty of its own: for symmetric editing")
    mirror_axis: EnumProperty(
        name="Axis", update=_target_changed, items=AXES,
        description="Axis of the object across which the motion is mirrored")
    enabled: BoolProperty(
        name="Enabled", default=True, update=_input_changed,
        description="Let this handle hold and move its vertices. Without it they follow the others like the rest of "
                    "the region. Takes effect at the next Bind")
    rest_matrix: FloatVectorProperty(
        name="Rest Matrix", size=16, options={'HIDDEN'},
        description="Place of the empty relative to the object when it was bound, row by row")
    rest_euler: FloatVectorProperty(
        name="Rest Euler", size=3, options={'HIDDEN'},
        description="The empty's own Euler rotation when it was bound: its whole turns are counted from there")
    earlier_name: StringProperty(options={'HIDDEN'})
    # What was made for it, and goes with it.
    own_group: StringProperty(options={'HIDDEN'})
    own_target: PointerProperty(type=bpy.types.Object, options={'HIDDEN'})


class DetailDeformExample(bpy.types.PropertyGroup):
    name: StringProperty(
        name="Example", update=_example_changed,
        description="Shape key that is this example pose, unless there is an object for it")
    object: PointerProperty(
        name="Object", type=bpy.types.Object, update=_example_changed,
        poll=lambda self, ob: ob.type == 'MESH' and ob != self.id_data,
        description="Object with the same vertices and faces in another pose; "
                    "its mesh without modifiers and shape keys counts")
    is_object: BoolProperty(options={'HIDDEN'})
    enabled: BoolProperty(
        name="Enabled", default=True, update=_example_changed,
        description="Take this example into account. Takes effect at the next Bind")
    weight: FloatProperty(
        name="Weight", soft_min=0.0, soft_max=1.0, min=-10.0, max=10.0, update=_look_changed,
        description="How much of this example the pose has, where weights are set by sliders")
    found_weight: FloatProperty(
        name="Weight", get=lambda self: status.example_weight(self.id_data, self),
        description="How much of this example the handles asked for")


class DetailDeformSettings(bpy.types.PropertyGroup):
    region: StringProperty(
        name="Region", update=_region_changed,
        description="Vertex group of the part that may deform: the vertices with a weight over 0.5. The rest of the "
                    "mesh stays where it is. Empty: the whole mesh may deform")
    own_region: StringProperty(options={'HIDDEN'})
    pulled_region: BoolProperty(options={'HIDDEN'})  # made by Pull, which may change it
    handles: CollectionProperty(
        type=DetailDeformHandle, name="Handles",
        description="Groups of vertices that are held, each moved by an empty; the rest of the region follows them")
    handle_collection: PointerProperty(
        type=bpy.types.Collection, options={'HIDDEN'}, description="Where the empties are that were made here")
    handle_index: IntProperty(name="Active Handle", options={'HIDDEN'})
    method: EnumProperty(
        name="Method", update=_method_changed,
        items=[('TRANSFER', "Detail Transfer",
                "A smooth base surface bends, and details turn with it (Botsch, Sumner, Pauly, Gross 2006). "
                "The best choice nearly always"),
               ('VARIATIONAL', "Smooth Displacement",
                "The smoothest displacement that follows the handles: details are moved but not turned, so they shear "
                "(variational minimization)"),
               ('NORMAL', "Normal Displacement",
                "A smooth base surface bends, and details stand on it along its normals: fails where they overhang, "
                "and self-intersects in tight bends"),
               ('GRADIENT', "Gradient Editing",
                "The handles' rotation and scale spread over the surface; a handle that is only moved turns nothing "
                "(differential coordinates)"),
               ('VOLUMES', "Displacement Volumes",
                "The space between the smooth base and the surface keeps its volume: bulges where it is pressed "
                "together. Slow: while you drag, Detail Transfer is shown, and the result follows when you pause"),
               ('EXAMPLES', "Examples",
                "Poses by example: the handles pull the mesh between shape keys or posed copies of it, and what turns "
                "there turns along an arc (mesh-based inverse kinematics). It bends as the examples do, "
                "not as a base surface")],
        description="How the surface follows its handles. Switching needs no new Bind")
    rotation_only: BoolProperty(
        name="Rotation Only", default=True, update=_look_changed,
        description="Details only turn with the surface and keep their size. "
                    "Off: they are stretched and sheared with it too")
    refine: IntProperty(
        name="Refine", default=4, min=0, soft_max=16, max=1000, update=_look_changed,
        description="Passes that take the turn of the details from the result and solve again: less stretch and "
                    "shrinking in large bends. Each costs about as much as three updates without. "
                    "0: the paper's linear result")
    formulation: EnumProperty(
        name="Formulation", update=_look_changed,
        items=transfer_settings.FORMULATIONS,
        description="Which system carries the turn of the base over to the details")
    levels: IntProperty(
        name="Levels", default=1, min=1, max=20, soft_max=5, update=_look_changed,
        description="Surfaces between the detailed and the smooth one, each displaced from the next smoother one: "
                    "shorter displacements, which intersect later")
    examples: CollectionProperty(
        type=DetailDeformExample, name="Examples",
        description="Poses that the method Examples mixes, beside the rest shape")
    example_index: IntProperty(name="Active Example", options={'HIDDEN'})
    weights_by: EnumProperty(
        name="Weights by", update=_weights_by_changed,
        items=[('HANDLES', "Handles", "The weights are those that fit the handles best"),
               ('SLIDERS', "Sliders", "The weights are set by hand, and the handles let go")],
        description="Where the weights of the examples come from")
    example_stiffness: FloatProperty(
        name="Stiffness", default=1.0, min=0.0, soft_max=10.0, max=1e4, update=_look_changed,
        description="How much the mesh keeps to single examples and between rest and example, rather than to what fits "
                    "the handles most closely by mixing and exaggerating them")
    volume_tolerance: FloatProperty(
        name="Tolerance", default=0.01, min=1e-6, max=1.0, precision=4, update=_look_changed,
        description="Displacement volumes are found when no vertex moves by more than this from one iteration to the "
                    "next, in mean heights of the details")
    volume_iterations: IntProperty(
        name="Iterations", default=50, min=1, max=10000, soft_max=500, update=_look_changed,
        description="Iterations after which the search for displacement volumes stops anyway")
    steps: IntProperty(
        name="Steps", default=1, min=1, soft_max=24, max=1000, update=_look_changed,
        description="Split a large motion of the handles into so many steps, each on the surface that the last one "
                    "left: for turns beyond 90 degrees and whole turns of an empty's Euler rotation. While you drag, "
                    "one step is shown; the result in steps follows when you pause. Each step takes as long as a Bind")
    output: EnumProperty(
        name="Show", update=_look_changed,
        items=[('RESULT', "Result", "The deformed surface"),
               ('BASE', "Base", "The smooth base surface in its place, to see where it bulges")],
        description="What the modifier shows")
    base: EnumProperty(
        name="Base", update=_base_changed,
        items=[('COMPUTED', "Computed",
                "The smooth base surface is computed from the region's border, and the handles move it"),
               ('OBJECT', "Object",
                "Another object of the same topology is the base: whatever deforms it (armature, lattice, curve, shape "
                "keys, simulation) moves the details. Handles are not needed")],
        description="Where the smooth base surface comes from. Takes effect at the next Bind")
    base_object: PointerProperty(
        name="Base Object", type=bpy.types.Object, update=_base_changed,
        poll=lambda self, ob: ob.type == 'MESH' and ob != self.id_data,
        description="Smooth mesh with the same vertices and faces as this one. Its own mesh is the base at rest, what "
                    "its modifiers make of it the deformed one")
    base_rest_matrix: FloatVectorProperty(
        name="Base Rest Matrix", size=16, options={'HIDDEN'},
        description="Place of the base object relative to this one when it was bound, row by row")
    smoothness: IntProperty(
        name="Smoothness", default=2, min=1, max=3, update=_input_changed,
        description="What the smooth base surface keeps small. 1: its area; it meets its border with a crease and "
                    "bulges least. 2: its curvature; it continues the slope of its border. 3: the change of its "
                    "curvature; it continues that too and bulges most. Takes effect at the next Bind")
    base_deformer: EnumProperty(
        name="Base Deformer",
        items=[('LINEAR', "Linear", "The smoothest displacement that the handles allow")],
        description="How the handles move the computed base surface")
    base_metric: EnumProperty(
        name="Stiffness", update=_input_changed,
        items=[('SURFACE', "From Surface",
                "Stiffness measured on the surface itself: exact when all handles move together, fast to bind"),
               ('BASE', "From Base",
                "Stiffness measured on the smooth base surface, as in the paper: "
                "sensitive where the base has tiny triangles")],
        description="Where the stiffness of the base surface is measured. Takes effect at the next Bind")
    metric_smoothing: FloatProperty(
        name="Smoothing", default=0.0, min=0.0, soft_max=4.0, max=6.0, update=_input_changed,
        description="Measure the stiffness on a slightly smoothed copy of the surface, in mean edge lengths: evens out "
                    "the pull where the relief is strong. Takes effect at the next Bind")
    preview: BoolProperty(
        name="Show Vertices", update=_preview_changed,
        description="Colour the vertices of the region and of the handles in the viewport, outside Edit Mode")
    influence: StringProperty(
        name="Influence", update=_influence_changed,
        description="Vertex group by whose weights the result is shown, as with other modifiers: a soft border, or a "
                    "part that stays. All of it when empty. Needs no new Bind")
    invert_influence: BoolProperty(
        name="Invert", update=_influence_changed,
        description="Show the result where the weights of the influence group are low")
    transfer: PointerProperty(
        type=transfer_settings.DetailDeformTransfer, name="Transfer",
        description="From where and how deformations are carried over to this mesh")
    live: BoolProperty(
        name="Live", default=True,
        description="Follow every move of the handles. Off: only when Update is pressed")

    is_bound: BoolProperty(
        name="Bound", get=lambda self: status.is_bound(self.id_data),
        description="Whether the handles move the surface now")
    status: StringProperty(
        name="Status", get=lambda self: status.text(self.id_data),
        description="What is going on, or what is wrong and what to do")
    bind_ms: FloatProperty(
        name="Bind Time", get=lambda self: status.bind_ms(self.id_data),
        description="Milliseconds the last Bind of this surface took")
    update_ms: FloatProperty(
        name="Update Time", get=lambda self: status.update_ms(self.id_data),
        description="Milliseconds from a handle's move to the stored result, last time")

    # The binding, kept in the file: the content it was made for, how that has changed since, and
    # what keeps the handles from being followed.
    signature: StringProperty(options={'HIDDEN'})
    stale: StringProperty(options={'HIDDEN'})
    compared_handles: StringProperty(options={'HIDDEN'})
    problem: StringProperty(options={'HIDDEN'})
    cache_modifier: StringProperty(options={'HIDDEN'})
    dependency: FloatProperty(
        name="Dependency", options={'HIDDEN', 'ANIMATABLE'},
        description="Its driver keeps the empties evaluated where they are hidden; the value is of no use")


# What one object's settings and another's may have in common.
COPIED_SETTINGS = ('method', 'rotation_only', 'refine', 'formulation', 'levels', 'volume_tolerance',
                   'volume_iterations', 'steps', 'output', 'smoothness', 'base_metric', 'metric_smoothing',
                   'base_deformer', 'example_stiffness', 'preview', 'live')

CLASSES = (DetailDeformHandle, DetailDeformExample, DetailDeformSettings)


def register():
    transfer_settings.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.detail_deform = PointerProperty(type=DetailDeformSettings)


def unregister():
    del bpy.types.Object.detail_deform
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    transfer_settings.unregister()
