# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether something of the user's needs what was made here: vertex groups and empties."""

import bpy

from . import node_group


def needed_groups(ob, names):
    """Those of these vertex groups that modifiers, shape keys, particles, physics, nodes or constraints name, beside
    what Detail Deform does with them. Blender keeps no list of who does: all texts that may be one are compared."""
    ours, keys = node_group.find_modifier(ob), ob.data.shape_keys
    modifiers = [modifier for modifier in ob.modifiers if modifier != ours]
    found = set()
    for struct in (*modifiers, *(keys.key_blocks if keys else ()), *ob.particle_systems):
        found.update(_texts(struct), *map(_texts, _parts(struct)))
    for modifier in modifiers:
        if modifier.type == 'NODES':
            found |= node_group.texts(modifier)
            found.update(socket.default_value for node in node_group.all_nodes(modifier.node_group)
                         for socket in node.inputs if socket.type == 'STRING')
    for other in bpy.data.objects:
        for owner in (other, *(other.pose.bones if other.pose else ())):
            found.update(getattr(constraint, 'subtarget', "") for constraint in owner.constraints
                         if getattr(constraint, 'target', None) == ob)
    return found.intersection(names)


def needed_empties(ob, empties):
    """Those of these empties that anything but the object's handles refers to, other than as a parent. In one pass
    through the file: bpy.data.user_map() would tell it, and in 3.4 it never lets go of what it has named."""
    wanted, ours = set(empties), node_group.find_modifier(ob)
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


# What may have drivers that read an empty's place.
_DRIVEN = ('objects', 'shape_keys', 'armatures', 'meshes', 'curves', 'lattices', 'materials', 'node_groups', 'lights',
           'cameras', 'scenes', 'worlds')


def _targets(constraint):
    """Armature constraints have several."""
    return [getattr(constraint, 'target', None), *(target.target for target in getattr(constraint, 'targets', ()))]


def _pointers(struct):
    found = (getattr(struct, prop.identifier) for prop in struct.bl_rna.properties if prop.type == 'POINTER')
    return [data for data in found if isinstance(data, bpy.types.Object)]


def _texts(struct):
    """Its texts, but what it is called itself."""
    return {getattr(struct, prop.identifier) for prop in struct.bl_rna.properties
            if prop.type == 'STRING' and prop.identifier != 'name'}


def _parts(struct):
    """Its settings that are structs of their own, as those of cloth, soft bodies and fluids."""
    for prop in struct.bl_rna.properties:
        if prop.type == 'POINTER' and prop.identifier != 'rna_type' and not isinstance(prop.fixed_type, bpy.types.ID):
            part = getattr(struct, prop.identifier)
            if part is not None and not isinstance(part, bpy.types.ID):
                yield part
