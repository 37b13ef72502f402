# SPDX-License-Identifier: GPL-3.0-or-later
"""Where in the modifier stack the deformation belongs. It applies to the mesh's own vertices, as a shape key does: so
it goes before modifiers that move vertices or change their count, and after those that overwrite positions: caches read
from files, and clothes bound to a body. Some modifiers can't come after Geometry Nodes; users are told what that
entails."""

import bpy

from . import cache_modifier, deform_modifier, display_key, node_group

# Read positions from a file.
_FILE_READERS = {'MESH_CACHE', 'MESH_SEQUENCE_CACHE'}
# Modifiers that want the mesh itself and so can't come after Geometry Nodes, and the consequence for users unless a
# shape key displays the deformation (channel.py).
_MUST_PRECEDE = {'MULTIRES': "what was sculpted only moves along and doesn't turn",
                 'SOFT_BODY': "it doesn't feel the deformation"}
# What goes wrong if the deformation comes after a modifier of this type.
_DEFORMERS = {'ARMATURE', 'CAST', 'CORRECTIVE_SMOOTH', 'CURVE', 'DISPLACE', 'HOOK', 'LAPLACIANDEFORM', 'LATTICE',
              'MESH_DEFORM', 'SIMPLE_DEFORM', 'SURFACE_DEFORM', 'WARP', 'WAVE'}
_HARM_BEFORE = {'MIRROR': "its mirrored half moves the wrong way",
                'SUBSURF': "what is pulled isn't smoothed by it",
                **dict.fromkeys(_DEFORMERS, "the shape breaks where it bends or turns the mesh")}


def overwrites(modifier):
    """Whether the modifier's result does not depend on the positions of its input."""
    if modifier.type == 'SURFACE_DEFORM':
        return modifier.is_bound and modifier.strength == 1
    if modifier.type == 'LAPLACIANDEFORM':
        return modifier.is_bind
    if modifier.type == 'MESH_CACHE':
        return bool(modifier.filepath) and modifier.deform_mode == 'OVERWRITE' and modifier.factor == 1
    if modifier.type == 'MESH_SEQUENCE_CACHE':
        return modifier.cache_file is not None
    return modifier.type == 'NODES' and any(map(_sets_positions, node_group.nodes_of(modifier.node_group)))


# Nodes that pass on the vertices of their first input.
_PASS_VERTICES_ON = {'GeometryNodeSetPosition', 'GeometryNodeStoreNamedAttribute', 'GeometryNodeCaptureAttribute',
                     'GeometryNodeRemoveAttribute', 'GeometryNodeSetShadeSmooth', 'GeometryNodeSetMaterial',
                     'NodeReroute'}


def _sets_positions(node):
    """Whether this Set Position node sets all positions of the modifier's input geometry to values that don't depend on
    the vertices' positions. Follows links backwards; a node group on the way counts as unknown, and so as no."""
    if (node.bl_idname != 'GeometryNodeSetPosition' or node.mute or node.inputs['Selection'].is_linked
            or not node.inputs['Position'].is_linked):
        return False
    sources = {link.to_socket.as_pointer(): link.from_node for link in node.id_data.links}
    return _is_of_input(node, sources) and not _depends_on_positions(
        sources[node.inputs['Position'].as_pointer()], sources, set())


def _is_of_input(node, sources):
    while node is not None and node.bl_idname in _PASS_VERTICES_ON:
        node = sources.get(node.inputs[0].as_pointer())
    return node is not None and node.bl_idname == 'NodeGroupInput'


def _depends_on_positions(node, sources, seen):
    """Whether this node, or one upstream of it, outputs the vertices' own positions, or may, as a node group."""
    if node.bl_idname == 'GeometryNodeInputPosition' or getattr(node, 'node_tree', None) is not None:
        return True
    if node.bl_idname == 'GeometryNodeInputNamedAttribute' and node.inputs['Name'].default_value == 'position':
        return True
    seen.add(node.name)
    before = filter(None, (sources.get(socket.as_pointer()) for socket in node.inputs))
    return any(node.name not in seen and _depends_on_positions(node, sources, seen) for node in before)


def move_to(ob, modifier, index):
    if list(ob.modifiers).index(modifier) == index:
        return  # the operator evaluates the scene twice, even where nothing moves
    with bpy.context.temp_override(object=ob, active_object=ob):
        bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=index)


def move_after(ob, modifier, other):
    """Moves a modifier directly after another one."""
    modifiers = list(ob.modifiers)
    at, behind = modifiers.index(modifier), modifiers.index(other)
    move_to(ob, modifier, behind + (at > behind))


def index_of_its_place(ob):
    """The number of other modifiers that belong before the deformation's."""
    own = deform_modifier.find(ob), cache_modifier.find(ob)
    others = [other for other in ob.modifiers if other not in own]
    last = max((k for k, other in enumerate(others) if other.type in _MUST_PRECEDE or overwrites(other)), default=-1)
    first_user = next((k for k, other in enumerate(others) if other.type not in _FILE_READERS), len(others))
    return max(last + 1, first_user)


def move_to_its_place(ob):
    """Moves the deformation's modifier to its place in the stack, and its baked cache directly after it."""
    modifier, cache = deform_modifier.find(ob), cache_modifier.find(ob)
    move_to(ob, modifier, index_of_its_place(ob))
    if cache:
        place_cache(ob, cache)


def place_cache(ob, cache):
    """Moves the baked cache to where it replaces the deformation."""
    if display_key.find(ob.data) is None:
        move_after(ob, cache, deform_modifier.find(ob))
    else:
        move_to(ob, cache, 0)


def wanting_mesh(ob):
    """[modifier]: those that want the mesh itself, so that no nodes can stand before them."""
    return [modifier for modifier in ob.modifiers if modifier.type in _MUST_PRECEDE]


def overwriting(ob):
    """[modifier]: those shown that overwrite positions, but for the deformation's baked cache."""
    cache = cache_modifier.find(ob)
    return [modifier for modifier in ob.modifiers if (modifier.show_viewport or modifier.show_render)
            and modifier != cache and overwrites(modifier)]


def why_no_key(ob):
    """Why no shape key can display the deformation: a clause, or ''."""
    keys, over = ob.data.shape_keys, overwriting(ob)
    if keys and not keys.use_relative:
        return f"the shape keys of '{ob.name}' are absolute"
    return f"'{over[0].name}' sets positions whatever it gets" if over else ""


def _shown_before(ob, types):
    return [other for other in deform_modifier.before(ob) if other.type in types and other.show_viewport]


def misplaced_before(ob):
    """[modifier]: those before the deformation's that belong after it. [] if a modifier of _MUST_PRECEDE prevents
    moving it."""
    if _shown_before(ob, _MUST_PRECEDE):
        return []
    found = _shown_before(ob, _HARM_BEFORE)
    modifiers = list(ob.modifiers)
    last = max((k for k, other in enumerate(modifiers) if other.show_viewport and overwrites(other)), default=-1)
    return [other for other in found if modifiers.index(other) > last]


def overwriting_after(ob):
    """[modifier]: the shown ones after the deformation's that overwrite its result."""
    later = deform_modifier.after(ob)
    return [other for other in overwriting(ob) if other in later and other.show_viewport]


def is_misplaced(ob):
    """Whether the deformation's modifier is in the wrong place and can be moved."""
    return bool(misplaced_before(ob) or overwriting_after(ob))


def why_misplaced(ob):
    """A sentence on what is wrong with the place of the deformation's modifier, or ''."""
    over = overwriting_after(ob)
    if over:
        return (f"'{over[-1].name}' comes behind Detail Deform in the modifier stack and sets positions whatever it "
                "gets, so nothing is seen: press Move to Its Place.")
    fixed, no_key = _shown_before(ob, _MUST_PRECEDE), why_no_key(ob)
    if fixed:
        harm = f"'{fixed[-1].name}' has to come before Detail Deform, so {_MUST_PRECEDE[fixed[-1].type]}"
        return (f"{harm}, and no shape key can help, for {no_key}: apply that modifier first." if no_key else
                f"{harm}: set Show As to Automatic (Advanced).")
    if no_key and ob.detail_deform.show_as == 'SHAPE_KEY':
        return f"The modifier shows the deformation, and no shape key, for {no_key}."
    found = misplaced_before(ob)
    if not found:
        return ""
    return (f"'{found[-1].name}' comes before Detail Deform in the modifier stack, so {_HARM_BEFORE[found[-1].type]}: "
            "press Move to Its Place.")


def names_kept_after(ob):
    """[str]: names of the modifiers after the deformation's that must not come before it."""
    return [other.name for other in deform_modifier.after(ob) if other.type in _HARM_BEFORE]


def ensure_modifier(ob):
    """The deformation's modifier; if there is none, it is added at its place in the stack."""
    is_new = deform_modifier.find(ob) is None
    modifier = deform_modifier.ensure(ob)
    if is_new and len(ob.modifiers) > 1:
        move_to_its_place(ob)
    return modifier
