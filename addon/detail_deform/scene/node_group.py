# SPDX-License-Identifier: GPL-3.0-or-later
"""The Geometry Nodes group that displays the result: position + Factor × Influence × offset attribute, unless a shape
key does."""

import bpy

from . import offset_attribute
from .node_inputs import KINDS

NAME = 'Detail Deform'
_MARK = 'detail_deform_nodes'
_VERSION = 3  # of the nodes: 2 added Influence, 3 By Shape Key


def new_socket(group, name, kind, in_out='INPUT'):
    if hasattr(group, 'interface'):  # 4.0 on
        return group.interface.new_socket(name, in_out=in_out, socket_type=kind)
    return (group.inputs if in_out == 'INPUT' else group.outputs).new(kind, name)


def _new_interface(group):
    """Creates the sockets of the group; returns that of Factor. No node uses Base: as an input of the modifier it is a
    dependency on the base object's geometry, which Blender then evaluates even where it is hidden."""
    made = {name: new_socket(group, name, kind) for name, kind in KINDS.items()}
    new_socket(group, 'Geometry', 'NodeSocketGeometry', 'OUTPUT')
    made['Influence'].description = "Vertex group by whose weights the deformation is shown; all of it when empty"
    made['Invert'].description = "Show the deformation where the group's weights are low"
    made['Base'].description = "The base object, if there is one: set by Bind"
    made['By Shape Key'].description = "A shape key shows the deformation in place of these nodes: set by Show As"
    return made['Factor']


def _make():
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

    source, target = node('NodeGroupInput', -1800, 0), node('NodeGroupOutput', 400, 0)
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
    choice = node('GeometryNodeSwitch', 200, 0)
    choice.input_type = 'GEOMETRY'
    switch, moved, passed, *_ = [socket for socket in choice.inputs if socket.enabled]
    link(source.outputs['By Shape Key'], switch)
    link(move.outputs['Geometry'], moved)
    link(source.outputs['Geometry'], passed)
    link(next(socket for socket in choice.outputs if socket.enabled), target.inputs['Geometry'])
    return group












def is_own(group):
    """Whether it is one of the add-on's node groups, of any version."""
    return _MARK in group


def is_current(group):
    """Whether its nodes are those of this version."""
    return group.get(_MARK) == _VERSION


def ensure():
    """The node group of this version in this file; made if there is none."""
    present = (group for group in bpy.data.node_groups if is_current(group) and not group.library)
    return next(present, None) or _make()


def nodes_of(tree):
    """Generator: all nodes of a node tree, or none of None, and of the node groups in it; each tree once."""
    trees, seen = [tree] * (tree is not None), set()
    while trees:
        tree = trees.pop()
        if tree.name not in seen:
            seen.add(tree.name)
            yield from tree.nodes
            trees += filter(None, (getattr(node, 'node_tree', None) for node in tree.nodes))
