# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether something of the user's needs what was made here: vertex groups and empties."""

import bpy

from . import node_group


def need_group(ob, name):
    """Whether modifiers, shape keys, particles, physics, nodes or constraints name a group of the object, beside what
    Detail Deform does with it. Blender keeps no list of who does: all texts that may be such a name are compared."""
    ours = node_group.find_modifier(ob)
    keys = ob.data.shape_keys
    structs = [*(modifier for modifier in ob.modifiers if modifier != ours), *(keys.key_blocks if keys else ()),
               *ob.particle_systems]
    if any(_names(struct, name) or any(_names(part, name) for part in _parts(struct)) for struct in structs):
        return True
    if any(modifier.type == 'NODES' and modifier != ours and _nodes_name(modifier, name) for modifier in ob.modifiers):
        return True
    return any(getattr(constraint, 'target', None) == ob and getattr(constraint, 'subtarget', '') == name
               for other in bpy.data.objects
               for owner in (other, *(other.pose.bones if other.pose else ())) for constraint in owner.constraints)


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


def _names(struct, name):
    """Whether one of its texts is this name, but what it is called itself."""
    return any(prop.type == 'STRING' and prop.identifier != 'name' and getattr(struct, prop.identifier) == name
               for prop in struct.bl_rna.properties)


def _parts(struct):
    """Its settings that are structs of their own, as those of cloth, soft bodies and fluids."""
    for prop in struct.bl_rna.properties:
        if prop.type == 'POINTER' and prop.identifier != 'rna_type' and not isinstance(prop.fixed_type, bpy.types.ID):
            part = getattr(struct, prop.identifier)
            if part is not None and not isinstance(part, bpy.types.ID):
                yield part


def _nodes_name(modifier, name):
    """By an input of the modifier, or in its nodes."""
    return name in node_group.texts(modifier) or _tree_names(modifier.node_group, name, set())


def _tree_names(tree, name, seen):
    if tree is None or tree.name in seen:
        return False
    seen.add(tree.name)
    return any(any(getattr(socket, 'default_value', None) == name for socket in node.inputs if socket.type == 'STRING')
               or _tree_names(getattr(node, 'node_tree', None), name, seen) for node in tree.nodes)
