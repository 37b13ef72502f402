# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds other users of the vertex groups and empties that the add-on has made, before they are removed."""

import bpy

from . import deform_modifier, display_key, node_group, node_inputs


def needed_groups(ob, names):
    """{str}: those of these vertex groups that modifiers, shape keys, particles, physics, nodes or constraints refer
    to, apart from Detail Deform. Blender keeps no such list: all string properties are compared with the names."""
    ours = deform_modifier.find(ob)
    modifiers = [modifier for modifier in ob.modifiers if modifier != ours]
    found = set()
    for struct in (*modifiers, *display_key.others(ob.data), *ob.particle_systems):
        found.update(_texts(struct), *map(_texts, _parts(struct)))
    for modifier in modifiers:
        if modifier.type == 'NODES':
            found |= node_inputs.texts(modifier)
            found.update(socket.default_value for node in node_group.nodes_of(modifier.node_group)
                         for socket in node.inputs if socket.type == 'STRING')
    for other in bpy.data.objects:
        for owner in (other, *(other.pose.bones if other.pose else ())):
            found.update(getattr(constraint, 'subtarget', "") for constraint in owner.constraints
                         if getattr(constraint, 'target', None) == ob)
    return found.intersection(names)


def needed_empties(ob, empties):
    """{object}: those of these empties that anything but the object's handles refers to, other than as a parent. One
    pass through the file, as bpy.data.user_map() leaks references to its result in 3.4."""
    wanted, ours = set(empties), deform_modifier.find(ob)
    found = set()
    for other in bpy.data.objects:
        owners = (other, *(other.pose.bones if other.pose else ()))
        found.update(*(_targets(constraint) for owner in owners for constraint in owner.constraints))
        found.update(*(_pointers(modifier) for modifier in other.modifiers if modifier != ours))
        if other != ob and other.type == 'MESH':
            found.update(handle.target for handle in other.detail_deform.handles)
    for kind in _DRIVEN:
        for data in getattr(bpy.data, kind):
            if data != ob and data.animation_data:
                found.update(target.id for curve in data.animation_data.drivers for variable in curve.driver.variables
                             for target in variable.targets)
    return found & wanted


# Collections of bpy.data whose drivers may read an empty's transform.
_DRIVEN = ('objects', 'shape_keys', 'armatures', 'meshes', 'curves', 'lattices', 'materials', 'node_groups', 'lights',
           'cameras', 'scenes', 'worlds')


def _targets(constraint):
    """[object or None]: the targets of a constraint; Armature constraints have several."""
    return [getattr(constraint, 'target', None), *(target.target for target in getattr(constraint, 'targets', ()))]


def _pointers(struct):
    found = (getattr(struct, prop.identifier) for prop in struct.bl_rna.properties if prop.type == 'POINTER')
    return [data for data in found if isinstance(data, bpy.types.Object)]


def _texts(struct):
    """{str}: the values of a struct's string properties, except its name."""
    return {getattr(struct, prop.identifier) for prop in struct.bl_rna.properties
            if prop.type == 'STRING' and prop.identifier != 'name'}


def _parts(struct):
    """Generator: nested settings structs, as of cloth, soft bodies and fluids."""
    for prop in struct.bl_rna.properties:
        if prop.type == 'POINTER' and prop.identifier != 'rna_type' and not isinstance(prop.fixed_type, bpy.types.ID):
            part = getattr(struct, prop.identifier)
            if part is not None and not isinstance(part, bpy.types.ID):
                yield part
