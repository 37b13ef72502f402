# SPDX-License-Identifier: GPL-3.0-or-later
"""Object.detail_deform: the user's settings, the stored state of a binding, and read-only status."""

import bpy
from bpy.props import (BoolProperty, CollectionProperty, EnumProperty, FloatProperty,
                       FloatVectorProperty, IntProperty, PointerProperty, StringProperty)

from . import callbacks, transfer_settings
from .declared import declare
from .follow import status
from .library import options
from .scene import handle_owners

AXES = [(letter, letter, f"Across the plane through the object's origin at right angles to its {letter} axis")
        for letter in 'XYZ']


class DetailDeformHandle(bpy.types.PropertyGroup):
    name: StringProperty(
        name="Name", description="Name of this handle", default="Handle", update=callbacks.name_changed)
    vertex_group: StringProperty(
        name="Vertices", update=callbacks.content_changed,
        description="Vertex group that moves as one piece with the empty: the vertices with a weight over 0.5")
    reach: StringProperty(
        name="Reach", update=callbacks.content_changed,
        description="Vertex group of what this handle moves, beside its own vertices: nothing else follows it, and "
                    "those of other handles stay. Empty: it moves the region, together with other handles that do")
    falloff: EnumProperty(
        name="Falloff", update=callbacks.content_changed, items=options.FALLOFFS, options=set(),
        description="How what this handle's reach holds falls off from the handle to the border. Of handles that share "
                    "a reach the first one's counts")
    target: PointerProperty(
        name="Empty", type=bpy.types.Object, poll=lambda self, ob: ob.type in handle_owners.TYPES,
        update=callbacks.target_changed,
        description="Empty that moves, turns and scales these vertices; it may be animated, parented or constrained. "
                    "Or a curve along which they lie: its points, their tilt and radius move those beside them. Or "
                    "an armature whose bones, from First Bone to Last Bone, do so")
    first_bone: StringProperty(
        name="First Bone", update=callbacks.target_changed,
        description="Bone of the armature with which the chain begins. Empty: there is only the last one")
    last_bone: StringProperty(
        name="Last Bone", update=callbacks.target_changed, description="Bone with which the chain ends")
    mirrors: StringProperty(
        name="Mirrors", update=callbacks.target_changed,
        description="Handle whose motion this one mirrors, in place of an empty of its own: for symmetric editing")
    mirror_axis: EnumProperty(
        name="Axis", update=callbacks.target_changed, items=AXES,
        description="Axis of the object across which the motion is mirrored")
    symmetric: EnumProperty(
        name="Symmetric", update=callbacks.result_changed, items=AXES, options={'ENUM_FLAG'},
        description="Keep the motion of these vertices its own mirror image across these planes of the object: they "
                    "stay on the plane, as with Edit Mode's symmetry")
    turns: EnumProperty(
        name="Turns", update=callbacks.result_changed, items=options.HANDLE_TURNS, options=set(),
        description="What turns the vertices of this handle")
    enabled: BoolProperty(
        name="Enabled", default=True, update=callbacks.content_changed,
        description="Let this handle hold and move its vertices. Without it they follow the others like the rest of "
                    "the region. Takes effect at the next Bind")
    rest_matrix: FloatVectorProperty(
        name="Rest Matrix", size=16, options={'HIDDEN'},
        description="Place of the empty relative to the object when it was bound, row by row")
    rest_euler: FloatVectorProperty(
        name="Rest Euler", size=3, options={'HIDDEN'},
        description="The empty's own Euler rotation when it was bound: its whole turns are counted from there")
    rest_order: StringProperty(options={'HIDDEN'}, description="Order of these angles")
    home_matrix: FloatVectorProperty(
        name="Home Matrix", size=16, options={'HIDDEN'},
        description="Where that place is on the mesh without deformation, if the handle was bound to a deformed one")
    home_euler: FloatVectorProperty(
        name="Home Euler", size=3, options={'HIDDEN'}, description="The empty's own Euler rotation there")
    mirror_space: FloatVectorProperty(
        name="Mirror Space", size=16, options={'HIDDEN'},
        description="From the object's space when it was bound to the present one, across a plane of which it mirrors")
    home_order: StringProperty(options={'HIDDEN'}, description="Order of these angles")
    pose_matrix: FloatVectorProperty(
        name="Pose Matrix", size=16, options={'HIDDEN'},
        description="How modifiers had moved the vertices when the empty was placed on them, beside its bone")
    rest_curve: StringProperty(options={'HIDDEN'})  # handle_curves.packed() at Bind
    home_curve: StringProperty(options={'HIDDEN'})  # the same that belongs to home_matrix
    earlier_name: StringProperty(options={'HIDDEN'})
    # Created for this handle, and removed with it.
    own_group: StringProperty(options={'HIDDEN'})
    own_reach: StringProperty(options={'HIDDEN'})
    own_target: PointerProperty(type=bpy.types.Object, options={'HIDDEN'})


class DetailDeformExample(bpy.types.PropertyGroup):
    name: StringProperty(
        name="Example", update=callbacks.example_changed,
        description="Shape key that is this example pose, unless there is an object for it")
    object: PointerProperty(
        name="Object", type=bpy.types.Object, update=callbacks.example_changed,
        poll=lambda self, ob: ob.type == 'MESH' and ob != self.id_data,
        description="Object with the same vertices and faces in another pose; "
                    "its mesh without modifiers and shape keys counts")
    is_object: BoolProperty(options={'HIDDEN'})
    enabled: BoolProperty(
        name="Enabled", default=True, update=callbacks.example_changed,
        description="Take this example into account. Takes effect at the next Bind")
    weight: FloatProperty(
        name="Weight", soft_min=0.0, soft_max=1.0, min=-10.0, max=10.0, update=callbacks.result_changed,
        description="How much of this example the pose has, where weights are set by sliders")
    limited: BoolProperty(
        name="Limit Weight", default=False, update=callbacks.result_changed,
        description="Keep the weight that handles ask for between Least and Largest")
    least_weight: FloatProperty(
        name="Least", default=0.0, min=-10.0, max=0.0, soft_min=-1.0, update=callbacks.result_changed,
        description="Least weight that handles give this example, below which they exaggerate its opposite")
    largest_weight: FloatProperty(
        name="Largest", default=1.0, min=0.0, max=10.0, soft_max=2.0, update=callbacks.result_changed,
        description="Largest weight that handles give this example, beyond which they exaggerate it")
    found_weight: FloatProperty(
        name="Weight", get=lambda self: status.example_weight(self.id_data, self),
        description="How much of this example the handles asked for")


class DetailDeformMissingExample(bpy.types.PropertyGroup):
    name: StringProperty(name="Pose", description="Frame, marker or action of this pose")
    frame: FloatProperty(name="Frame", description="Where it is found: in the scene, or in the action")
    action: StringProperty(name="Action", description="The action that is this pose, of a pose library")
    mean_error: FloatProperty(
        name="Mean Error", precision=2,
        description="How far from this pose the examples leave the mesh in the mean, in percent of its size")
    largest_error: FloatProperty(
        name="Largest Error", precision=2, description="The same of the vertex that is farthest from its place")
    mark: StringProperty(options={'HIDDEN'})  # key of its errors, which are kept in memory only


class DetailDeformExpression(bpy.types.PropertyGroup):
    name: StringProperty(name="Expression", description="Shape key that was saved here")


class DetailDeformSettings(bpy.types.PropertyGroup):
    region: StringProperty(
        name="Region", update=callbacks.region_changed,
        description="Vertex group of the part that may deform: the vertices with a weight over 0.5. The rest of the "
                    "mesh stays where it is. Empty: the whole mesh may deform")
    own_region: StringProperty(options={'HIDDEN'})
    pulled_region: BoolProperty(options={'HIDDEN'})  # whether Pull made the region, and may change it
    join_split: BoolProperty(
        name="Join Split Vertices", default=True, update=callbacks.content_changed,
        description="Take vertices for one where two borders of the mesh lie on one another, as importers split it "
                    "along seams of UVs and normals. Off: the surface may open there. Takes effect at the next Bind")
    handles: CollectionProperty(
        type=DetailDeformHandle, name="Handles",
        description="Groups of vertices that are held, each moved by an empty; the rest of the region follows them")
    handle_collection: PointerProperty(
        type=bpy.types.Collection, options={'HIDDEN'}, description="Where the empties are that were made here")
    handle_index: IntProperty(name="Active Handle", options={'HIDDEN'})
    examples: CollectionProperty(
        type=DetailDeformExample, name="Examples",
        description="Poses that the method Examples mixes, beside the rest shape")
    example_index: IntProperty(name="Active Example", options={'HIDDEN'})
    posed_by: StringProperty(options={'HIDDEN'})  # modifiers whose poses are examples: lines of type and name
    missing_examples: CollectionProperty(
        type=DetailDeformMissingExample, name="Missing Examples",
        description="Poses of which the examples make something else, the worst first")
    missing_of: StringProperty(options={'HIDDEN'})  # signature of the binding when the list was made
    missing_index: IntProperty(name="Active Pose", options={'HIDDEN'}, update=callbacks.preview_changed)
    show_error: BoolProperty(
        name="Show Error", update=callbacks.preview_changed,
        description="Colour the vertices in the viewport by how far the examples left them from the active pose of the "
                    "list")
    expressions: CollectionProperty(
        type=DetailDeformExpression, name="Expressions", description="Shape keys that were saved of the deformation")
    base_object: PointerProperty(
        name="Base Object", type=bpy.types.Object, update=callbacks.base_object_changed,
        poll=lambda self, ob: ob.type == 'MESH' and ob != self.id_data,
        description="A smooth copy of this mesh, or a cage or a coarser mesh near it whose nearest points are "
                    "followed. Its own mesh at Bind is its rest, what edits and modifiers make of it the base; "
                    "where they make vertices, their shape at Bind is the rest")
    base_rest_matrix: FloatVectorProperty(
        name="Base Rest Matrix", size=16, options={'HIDDEN'},
        description="Place of the base object relative to this one when it was bound, row by row")
    base_rest_mesh: PointerProperty(type=bpy.types.Mesh, options={'HIDDEN'})  # in this object's space
    base_rest_made: BoolProperty(options={'HIDDEN'})  # whether that is the evaluated mesh, not its own
    base_rest_of: PointerProperty(type=bpy.types.Object, options={'HIDDEN'})  # the base object with this rest
    influence: StringProperty(
        name="Influence", update=callbacks.influence_changed,
        description="Vertex group by whose weights the result is shown, as with other modifiers: a soft border, or a "
                    "part that stays. All of it when empty. Needs no new Bind")
    invert_influence: BoolProperty(
        name="Invert", update=callbacks.influence_changed,
        description="Show the result where the weights of the influence group are low")
    transfer: PointerProperty(
        type=transfer_settings.DetailDeformTransfer, name="Transfer",
        description="From where and how deformations are carried over to this mesh")

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

    # The binding, saved with the file: the signature of its content, how the content has changed since (stale), and
    # why the handles can't be followed (problem).
    signature: StringProperty(options={'HIDDEN'})
    stale: StringProperty(options={'HIDDEN'})
    bound_points: StringProperty(options={'HIDDEN'})
    known_groups: StringProperty(options={'HIDDEN'})  # last names of its vertex groups, one a line
    begun_as: StringProperty(options={'HIDDEN'})  # its name at Bind or Follow, which tells copies apart
    proportions: FloatVectorProperty(
        name="Proportions", size=9, options={'HIDDEN'},
        description="How the object was scaled in the scene when it was bound, row by row: its surface is deformed as "
                    "it was seen")
    compared_handles: StringProperty(options={'HIDDEN'})
    problem: StringProperty(options={'HIDDEN'})
    render_problem: StringProperty(options={'HIDDEN'})
    cache_modifier: StringProperty(options={'HIDDEN'})
    cached_points: StringProperty(options={'HIDDEN'})  # carried.sample_points() when its cache began to play
    baked_file: StringProperty(options={'HIDDEN'})
    dependency: FloatProperty(
        name="Dependency", options={'HIDDEN', 'ANIMATABLE'},
        description="Its driver keeps the empties evaluated where they are hidden; the value is of no use")


_UPDATE_CALLBACKS = {'method': callbacks.method_changed, 'weights_by': callbacks.weights_by_changed,
                     'base': callbacks.base_changed, 'preview': callbacks.preview_changed,
                     'soft_border': callbacks.result_changed, 'loose_parts': callbacks.result_changed,
                     'stiff_parts': callbacks.content_changed, 'show_as': callbacks.display_changed}
_UPDATE_CALLBACKS_BY_STRUCT = {options.BIND: callbacks.content_changed,
                               **dict.fromkeys(options.OF_UPDATE, callbacks.result_changed)}
declare(DetailDeformSettings, options.SETTINGS,
        lambda option: _UPDATE_CALLBACKS.get(option.name, _UPDATE_CALLBACKS_BY_STRUCT.get(option.struct)))

CLASSES = (DetailDeformHandle, DetailDeformExample, DetailDeformMissingExample, DetailDeformExpression,
           DetailDeformSettings)
_register_classes, _unregister_classes = bpy.utils.register_classes_factory(CLASSES)


def register():
    transfer_settings.register()
    _register_classes()
    bpy.types.Object.detail_deform = PointerProperty(type=DetailDeformSettings)


def unregister():
    del bpy.types.Object.detail_deform
    _unregister_classes()
    transfer_settings.unregister()
