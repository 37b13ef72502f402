# SPDX-License-Identifier: GPL-3.0-or-later
"""The Geometry Nodes modifier that shows the result: position + Factor × offset attribute."""

import bpy

from . import mesh_data

NAME = 'Detail Deform'
CACHE_NAME = 'Detail Deform Cache'
_MARK = 'detail_deform_nodes'


def _new_interface(group):
    """Sockets of the group; returns that of Factor. Nothing uses Base: a modifier that has an object
    there needs that object's geometry, so Blender evaluates it even where it is hidden."""
    inputs = (('Geometry', 'NodeSocketGeometry'), ('Factor', 'NodeSocketFloat'),
              ('Base', 'NodeSocketObject'))
    if hasattr(group, 'interface'):  # 4.0 on
        made = {name: group.interface.new_socket(name, in_out='INPUT', socket_type=kind)
                for name, kind in inputs}
        group.interface.new_socket('Geometry', in_out='OUTPUT', socket_type='NodeSocketGeometry')
    else:
        made = {name: group.inputs.new(kind, name) for name, kind in inputs}
        group.outputs.new('NodeSocketGeometry', 'Geometry')
    made['Base'].description = "The base object, if there is one: set by Bind"
    return made['Factor']


def _make_group():
    group = bpy.data.node_groups.new(NAME, 'GeometryNodeTree')
    group[_MARK] = 1
    factor = _new_interface(group)
    factor.default_value = 1.0
    factor.min_value = 0.0
    factor.max_value = 1.0
    factor.description = "How much of the deformation is shown: 0 is the rest shape, 1 the result"

    def node(kind, x, y):
        made = group.nodes.new(kind)
        made.location = (x, y)
        return made

    source, target = node('NodeGroupInput', -600, 0), node('NodeGroupOutput', 200, 0)
    attribute = node('GeometryNodeInputNamedAttribute', -600, -200)
    attribute.data_type = 'FLOAT_VECTOR'
    attribute.inputs['Name'].default_value = mesh_data.OFFSET_ATTRIBUTE
    scale = node('ShaderNodeVectorMath', -300, -150)
    scale.operation = 'SCALE'
    move = node('GeometryNodeSetPosition', 0, 0)
    vector = next(s for s in attribute.outputs if s.name == 'Attribute' and s.type == 'VECTOR')
    link = group.links.new
    link(vector, scale.inputs[0])
    link(source.outputs['Factor'], scale.inputs['Scale'])
    link(source.outputs['Geometry'], move.inputs['Geometry'])
    link(scale.outputs[0], move.inputs['Offset'])
    link(move.outputs['Geometry'], target.inputs['Geometry'])
    return group


def find_modifier(ob):
    for modifier in ob.modifiers:
        if modifier.type == 'NODES' and modifier.node_group and _MARK in modifier.node_group:
            return modifier
    return None


def find_cache(ob):
    """The modifier that plays a baked cache in the place of this one."""
    cache = ob.modifiers.get(CACHE_NAME)
    return cache if cache and cache.type == 'MESH_CACHE' else None


def is_shown(ob, depsgraph):
    modifier = find_modifier(ob)
    return modifier is not None and (
        modifier.show_render if depsgraph.mode == 'RENDER' else modifier.show_viewport)


def ensure_modifier(ob):
    """The object's modifier, added at the end of the stack when there is none."""
    modifier = find_modifier(ob)
    if modifier is None:
        group = next((g for g in bpy.data.node_groups if _MARK in g and not g.library), None)
        modifier = ob.modifiers.new(NAME, 'NODES')
        modifier.node_group = group or _make_group()
        modifier.show_expanded = False
    return modifier


def remove_modifier(ob):
    """Removes the modifier, and the node group when nobody else uses it."""
    modifier = find_modifier(ob)
    if modifier is None:
        return
    group = modifier.node_group
    ob.modifiers.remove(modifier)
    if group.users == 0:
        bpy.data.node_groups.remove(group)


def move_behind(ob, modifier, other):
    """Puts a modifier directly behind another one."""
    modifiers = list(ob.modifiers)
    at, behind = modifiers.index(modifier), modifiers.index(other)
    with bpy.context.temp_override(object=ob, active_object=ob):
        bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=behind + (at > behind))


def _socket(group, name):
    sockets = (group.interface.items_tree if hasattr(group, 'interface') else group.inputs)
    return next(s for s in sockets if s.name == name and getattr(s, 'in_out', 'INPUT') == 'INPUT')


def factor(modifier):
    """The modifier's Factor; 1 when it is driven by an attribute."""
    socket = _socket(modifier.node_group, 'Factor')
    inputs = getattr(getattr(modifier, 'properties', None), 'inputs', None)
    if inputs is not None:  # 5.2 on
        return float(getattr(inputs, socket.identifier).value)
    return float(modifier.get(socket.identifier, socket.default_value))


def set_base(modifier, base):
    """Makes the modifier need this object's geometry, or none."""
    identifier = _socket(modifier.node_group, 'Base').identifier
    inputs = getattr(getattr(modifier, 'properties', None), 'inputs', None)
    if inputs is not None:  # 5.2 on
        getattr(inputs, identifier).value = base
    elif base is None:
        if identifier in modifier:
            del modifier[identifier]
    else:
        modifier[identifier] = base
    # Setting the value alone doesn't tell Blender that the object now depends on another one.
    modifier.node_group = modifier.node_group
