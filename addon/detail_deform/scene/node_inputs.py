# SPDX-License-Identifier: GPL-3.0-or-later
"""The input values of Geometry Nodes modifiers, which Blender stores differently from 5.2 on."""

KINDS = {'Geometry': 'NodeSocketGeometry', 'Factor': 'NodeSocketFloat', 'Influence': 'NodeSocketString',
         'Invert': 'NodeSocketBool', 'Base': 'NodeSocketObject',
         'By Shape Key': 'NodeSocketBool'}  # inputs of the add-on's node group


def socket_of(group, name):
    """The input socket of this name and its type in KINDS; None if the node group has none."""
    sockets = (group.interface.items_tree if hasattr(group, 'interface') else group.inputs)
    return next((s for s in sockets if s.name == name and getattr(s, 'in_out', 'INPUT') == 'INPUT'
                 and getattr(s, 'bl_socket_idname', "").startswith(KINDS[name])), None)


def values_of(modifier):
    """The struct of the modifier's input values by identifier, from 5.2 on; None before."""
    return getattr(getattr(modifier, 'properties', None), 'inputs', None)


def texts(modifier):
    """{str}: the strings among the inputs of any Geometry Nodes modifier, which may name attributes and groups."""
    if modifier.node_group is None:  # in 5.2 it then has no inputs or properties
        return set()
    inputs = values_of(modifier)
    if inputs is None:
        found = [modifier[key] for key in modifier.keys()]
    else:
        parts = [getattr(inputs, prop.identifier) for prop in inputs.bl_rna.properties if prop.type == 'POINTER']
        found = [getattr(part, name, None) for part in parts for name in ('value', 'attribute_name')]
    return {text for text in found if isinstance(text, str)}


def value(modifier, name):
    """The value of an input; its default where it has none, as when an attribute supplies it."""
    usual, found = {'Factor': 1.0, 'Influence': "", 'Invert': False, 'By Shape Key': False}[name], None
    socket, inputs = socket_of(modifier.node_group, name), values_of(modifier)
    if socket is not None:  # missing in a group that was edited
        found = (getattr(inputs, socket.identifier).value if inputs is not None else
                 modifier.get(socket.identifier, socket.default_value))
    return found if isinstance(found, str if name == 'Influence' else (bool, int, float)) else usual


def set_value(modifier, name, value):
    """Sets an input and updates the object's dependencies. None removes the value."""
    socket = socket_of(modifier.node_group, name)
    if socket is None:
        return
    identifier, inputs = socket.identifier, values_of(modifier)
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
