# SPDX-License-Identifier: GPL-3.0-or-later
"""The Geometry Nodes modifier that displays the result: found, added, removed, and its settings."""

import bpy
import numpy as np

from . import actions, display_key, mesh_data, node_group, node_inputs


def find(ob):
    for modifier in ob.modifiers:
        if modifier.type == 'NODES' and modifier.node_group and node_group.is_own(modifier.node_group):
            return modifier
    return None


def before(ob):
    """[modifier]: those before the deformation in the stack; none if it has none yet, or is displayed by a shape
    key."""
    modifiers, modifier = list(ob.modifiers), find(ob)
    return modifiers[:modifiers.index(modifier)] if modifier and not display_key.find(ob.data) else []


def after(ob):
    """[modifier]: those after the deformation in the stack; all others where before() has none."""
    modifier, earlier = find(ob), before(ob)
    return [other for other in list(ob.modifiers)[len(earlier):] if other != modifier]


def user_count():
    """Number of users of the add-on's node groups in this file; it changes when modifiers come or go."""
    return sum(group.users for group in bpy.data.node_groups if node_group.is_own(group))


def is_shown(modifier, depsgraph):
    """Whether a modifier, or None, has an effect in the viewport, or in renders where the depsgraph is a render's."""
    return modifier is not None and (
        modifier.show_render if depsgraph.mode == 'RENDER' else modifier.show_viewport)


def ensure(ob):
    """The deformation's modifier with the nodes of this version; added at the end of the stack if there is none."""
    modifier = find(ob)
    if modifier and node_group.is_current(modifier.node_group):
        return modifier
    if modifier is None:
        modifier = ob.modifiers.new(node_group.NAME, 'NODES')
        modifier.show_expanded = False
        modifier.show_on_cage = True  # so that selecting for the next pull happens on the displayed surface
    modifier.node_group = node_group.ensure()
    return modifier


def remove(ob):
    """Removes the deformation's modifier, and its node group if it has no other user."""
    modifier = find(ob)
    if modifier is None:
        return
    group = modifier.node_group
    ob.modifiers.remove(modifier)
    if group.users == 0:
        bpy.data.node_groups.remove(group)


def factor_property(ob, modifier):
    """(data, property) of the deformation's factor for layout.prop(): the value of its shape key, if there is one, or
    the modifier's Factor; None if its node group has none."""
    key = display_key.find(ob.data)
    if key is not None:
        return key, 'value'
    socket = node_inputs.socket_of(modifier.node_group, 'Factor')
    if socket is None:
        return None
    identifier, inputs = socket.identifier, node_inputs.values_of(modifier)
    return (getattr(inputs, identifier), 'value') if inputs is not None else (modifier, f'["{identifier}"]')


def animated_factor_path(ob, modifier):
    """The data path of the modifier's own Factor, where it is keyed or driven; else ''."""
    socket, inputs = node_inputs.socket_of(modifier.node_group, 'Factor'), node_inputs.values_of(modifier)
    if socket is None or ob.animation_data is None:
        return ""
    path = (f'{modifier.path_from_id()}["{socket.identifier}"]' if inputs is None else
            getattr(inputs, socket.identifier).path_from_id('value'))
    return path if actions.is_path_animated(ob, path) or ob.animation_data.drivers.find(path) else ""


def factor(ob, modifier):
    """The factor of the deformation; 1 if the modifier's has no numeric value, as when an attribute supplies it."""
    key = display_key.find(ob.data)
    return float(node_inputs.value(modifier, 'Factor')) if key is None else display_key.factor(ob, key)


def set_factor(modifier, value):
    """Sets the modifier's own Factor."""
    node_inputs.set_value(modifier, 'Factor', value)


def influence(modifier):
    """(name of the influence group, or '', whether it is inverted)"""
    return node_inputs.value(modifier, 'Influence'), bool(node_inputs.value(modifier, 'Invert'))


def display_weights(ob, modifier):
    """The factor by which offsets are displayed: a number, or (n, 1) per vertex where there is an influence group."""
    return factor(ob, modifier) * influence_weights(ob, modifier)


def influence_weights(ob, modifier):
    """The same without the deformation's factor."""
    name, invert = influence(modifier)
    if not name:
        return 1.0
    weights = np.zeros(len(ob.data.vertices), np.float32)
    if name in ob.vertex_groups:
        weights = mesh_data.group_weights(ob, [name])[0]
    return (1 - weights if invert else weights)[:, None]


def set_influence(modifier, group_name, invert):
    node_inputs.set_value(modifier, 'Influence', group_name)
    node_inputs.set_value(modifier, 'Invert', invert)


def set_base(modifier, base):
    """Makes the object depend on the geometry of base, an object or None."""
    node_inputs.set_value(modifier, 'Base', base)


def set_passing(modifier, is_passing):
    """Makes the modifier pass the geometry on, as a shape key displays the deformation."""
    node_inputs.set_value(modifier, 'By Shape Key', is_passing)
