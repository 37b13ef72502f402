# SPDX-License-Identifier: GPL-3.0-or-later
"""The Geometry Nodes modifier that displays the result: position + Factor × Influence × offset attribute."""

import os

import bpy
import numpy as np

from . import mesh_data, offset_attribute

NAME = 'Detail Deform'
CACHE_NAME = 'Detail Deform Cache'
_MARK = 'detail_deform_nodes'
_VERSION = 2  # of the node group: 2 added Influence


_INPUTS = {'Geometry': 'NodeSocketGeometry', 'Factor': 'NodeSocketFloat', 'Influence': 'NodeSocketString',
           'Invert': 'NodeSocketBool', 'Base': 'NodeSocketObject'}


def new_socket(group, name, kind, in_out='INPUT'):
    if hasattr(group, 'interface'):  # 4.0 on
        return group.interface.new_socket(name, in_out=in_out, socket_type=kind)
    return (group.inputs if in_out == 'INPUT' else group.outputs).new(kind, name)


def _new_interface(group):
    """Creates the sockets of the group; returns that of Factor. No node uses Base: as an input of the modifier it is a
    dependency on the base object's geometry, which Blender then evaluates even where it is hidden."""
    made = {name: new_socket(group, name, kind) for name, kind in _INPUTS.items()}
    new_socket(group, 'Geometry', 'NodeSocketGeometry', 'OUTPUT')
    made['Influence'].description = "Vertex group by whose weights the deformation is shown; all of it when empty"
    made['Invert'].description = "Show the deformation where the group's weights are low"
    made['Base'].description = "The base object, if there is one: set by Bind"
    return made['Factor']


def _make_group():
    group = bpy.data.node_groups.new(NAME, 'GeometryNodeTree')
    group[_MARK] = _VERSION
    factor = _new_interface(group)
    factor.default_value = 1.0
    factor.min_value = 0.0
    factor.max_value = 1.0
    factor.description = "How much of the deformation is shown: 0 is the rest shape, 1 the result"

    def node(kind, x, y):
        made = group.nodes.new(kind)
        made.location = (x, y)
        return made

    source, target = node('NodeGroupInput', -1800, 0), node('NodeGroupOutput', 200, 0)
    link = group.links.new

    def attribute(kind, x, y):
        made = node('GeometryNodeInputNamedAttribute', x, y)
        made.data_type = kind
        value = 'VECTOR' if kind == 'FLOAT_VECTOR' else 'VALUE'
        return made, next(s for s in made.outputs if s.name == 'Attribute' and s.type == value)

    def math(operation, x, *values):
        made = node('ShaderNodeMath', x, -400)
        made.operation = operation
        for socket, value in zip(made.inputs, values):
            if isinstance(value, float):
                socket.default_value = value
            else:
                link(value, socket)
        return made.outputs[0]

    offset, vector = attribute('FLOAT_VECTOR', -600, -200)
    offset.inputs['Name'].default_value = offset_attribute.DISPLAYED_OFFSETS
    weights, weight = attribute('FLOAT', -1600, -400)
    link(source.outputs['Influence'], weights.inputs['Name'])
    # The weight, or 1 - weight if Invert is on; 1 where no group is named.
    invert = source.outputs['Invert']
    shown = math('MULTIPLY_ADD', -1200, math('MULTIPLY_ADD', -1400, invert, -2.0, 1.0), weight, invert)
    length = node('FunctionNodeStringLength', -1600, -600)
    link(source.outputs['Influence'], length.inputs[0])
    named = math('MINIMUM', -1200, length.outputs[0], 1.0)
    shown = math('MULTIPLY_ADD', -800, named, math('SUBTRACT', -1000, shown, 1.0), 1.0)
    amount = math('MULTIPLY', -600, shown, source.outputs['Factor'])
    scale = node('ShaderNodeVectorMath', -300, -150)
    scale.operation = 'SCALE'
    move = node('GeometryNodeSetPosition', 0, 0)
    link(vector, scale.inputs[0])
    link(amount, scale.inputs['Scale'])
    link(source.outputs['Geometry'], move.inputs['Geometry'])
    link(scale.outputs[0], move.inputs['Offset'])
    link(move.outputs['Geometry'], target.inputs['Geometry'])
    return group


def find_modifier(ob):
    for modifier in ob.modifiers:
        if modifier.type == 'NODES' and modifier.node_group and _MARK in modifier.node_group:
            return modifier
    return None


def after(ob):
    """[modifier]: those after the deformation's in the stack; all if it has none yet."""
    modifiers, modifier = list(ob.modifiers), find_modifier(ob)
    return modifiers[modifiers.index(modifier) + 1:] if modifier else modifiers


def user_count():
    """Number of users of the add-on's node groups in this file; it changes when modifiers come or go."""
    return sum(group.users for group in bpy.data.node_groups if _MARK in group)


def find_cache(ob):
    """The Mesh Cache modifier that plays a bake in place of the deformation's; None if there is none."""
    cache = ob.modifiers.get(ob.detail_deform.cache_modifier)
    return cache if cache and cache.type == 'MESH_CACHE' else None


def is_shown(modifier, depsgraph):
    """Whether a modifier, or None, has an effect in the viewport, or in renders where the depsgraph is a render's."""
    return modifier is not None and (
        modifier.show_render if depsgraph.mode == 'RENDER' else modifier.show_viewport)


def ensure_modifier(ob):
    """The deformation's modifier with the nodes of this version; added at the end of the stack if there is none."""
    modifier = find_modifier(ob)
    if modifier and modifier.node_group[_MARK] == _VERSION:
        return modifier
    group = next((g for g in bpy.data.node_groups if g.get(_MARK) == _VERSION and not g.library), None)
    if modifier is None:
        modifier = ob.modifiers.new(NAME, 'NODES')
        modifier.show_expanded = False
        modifier.show_on_cage = True  # so that selecting for the next pull happens on the displayed surface
    modifier.node_group = group or _make_group()
    return modifier


def remove_modifier(ob):
    """Removes the deformation's modifier, and its node group if it has no other user."""
    modifier = find_modifier(ob)
    if modifier is None:
        return
    group = modifier.node_group
    ob.modifiers.remove(modifier)
    if group.users == 0:
        bpy.data.node_groups.remove(group)


def set_up_cache(cache, path, start):
    """Sets up a Mesh Cache modifier to play a point cache from frame start on."""
    cache.cache_format = 'PC2'
    # Blender and Python resolve relative paths against different folders.
    cache.filepath = path if path.startswith('//') else os.path.abspath(path)
    cache.frame_start = start
    cache.interpolation = 'LINEAR'


def _socket(group, name):
    """The input socket of this name and its type in _INPUTS; None if the node group has none."""
    sockets = (group.interface.items_tree if hasattr(group, 'interface') else group.inputs)
    return next((s for s in sockets if s.name == name and getattr(s, 'in_out', 'INPUT') == 'INPUT'
                 and getattr(s, 'bl_socket_idname', "").startswith(_INPUTS[name])), None)


def _inputs(modifier):
    """The struct of the modifier's input values by identifier, from 5.2 on; None before."""
    return getattr(getattr(modifier, 'properties', None), 'inputs', None)


def nodes_of(tree):
    """Generator: all nodes of a node tree, or none of None, and of the node groups in it; each tree once."""
    trees, seen = [tree] * (tree is not None), set()
    while trees:
        tree = trees.pop()
        if tree.name not in seen:
            seen.add(tree.name)
            yield from tree.nodes
            trees += filter(None, (getattr(node, 'node_tree', None) for node in tree.nodes))


def texts(modifier):
    """{str}: the strings among the inputs of any Geometry Nodes modifier, which may name attributes and groups."""
    if modifier.node_group is None:  # in 5.2 it then has no inputs or properties
        return set()
    inputs = _inputs(modifier)
    if inputs is None:
        found = [modifier[key] for key in modifier.keys()]
    else:
        parts = [getattr(inputs, prop.identifier) for prop in inputs.bl_rna.properties if prop.type == 'POINTER']
        found = [getattr(part, name, None) for part in parts for name in ('value', 'attribute_name')]
    return {text for text in found if isinstance(text, str)}


def _get(modifier, name):
    usual, found = {'Factor': 1.0, 'Influence': "", 'Invert': False}[name], None
    socket, inputs = _socket(modifier.node_group, name), _inputs(modifier)
    if socket is not None:  # missing in a group that was edited
        found = (getattr(inputs, socket.identifier).value if inputs is not None else
                 modifier.get(socket.identifier, socket.default_value))
    return found if isinstance(found, str if name == 'Influence' else (bool, int, float)) else usual


def _set(modifier, name, value):
    socket = _socket(modifier.node_group, name)
    if socket is None:
        return
    identifier, inputs = socket.identifier, _inputs(modifier)
    if value == (getattr(inputs, identifier).value if inputs is not None else modifier.get(identifier)):
        return
    if inputs is not None:
        getattr(inputs, identifier).value = value
    elif value is None:
        if identifier in modifier:
            del modifier[identifier]
    else:
        modifier[identifier] = value
    # Setting the value alone neither tags the object for evaluation nor updates its dependencies.
    modifier.node_group = modifier.node_group


def factor_property(modifier):
    """(data, property) of the modifier's Factor for layout.prop(); None if its node group has none."""
    socket = _socket(modifier.node_group, 'Factor')
    if socket is None:
        return None
    identifier, inputs = socket.identifier, _inputs(modifier)
    return (getattr(inputs, identifier), 'value') if inputs is not None else (modifier, f'["{identifier}"]')


def factor(modifier):
    """The modifier's Factor; 1 if it has no numeric value, as when an attribute supplies it."""
    return float(_get(modifier, 'Factor'))


def display_weights(ob, modifier):
    """The factor by which offsets are displayed: a number, or (n, 1) per vertex where there is an influence group."""
    name, invert = _get(modifier, 'Influence'), bool(_get(modifier, 'Invert'))
    if not name:
        return factor(modifier)
    weights = np.zeros(len(ob.data.vertices), np.float32)
    if name in ob.vertex_groups:
        weights = mesh_data.group_weights(ob, [name])[0]
    return factor(modifier) * (1 - weights if invert else weights)[:, None]


def set_influence(modifier, group_name, invert):
    _set(modifier, 'Influence', group_name)
    _set(modifier, 'Invert', invert)


def set_base(modifier, base):
    """Makes the object depend on the geometry of base, an object or None."""
    _set(modifier, 'Base', base)
