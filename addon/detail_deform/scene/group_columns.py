# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads whole vertex groups in bulk.

Python can read them vertex by vertex only. Geometry Nodes copy each group to an attribute, which is read at once; they
run on a temporary object in a temporary scene."""

import bpy
import numpy as np

from . import mesh_data, node_group

# Break-even with Python's loop. Costs are in vertices that the loop visits in the same time; measured, see
# native/bench/RESULTS.md. Each group's nodes cost 2,000 vertices, the temporary scene as much as five groups, and
# rebuilding the relations of the dependency graphs 100 vertices for each object of the file.
_VERTICES_A_GROUP, _SCENE = 2000, 5
_VERTICES_AN_OBJECT = 100
_MAX_GROUPS = 64  # bounds the memory: n floats a group
_SAMPLES = 50  # about as many members of each group, and vertices of the mesh, are compared with Python's weights


def entries(ob, names):
    """As mesh_data.group_entries(), without entries of weight 0. For Bind alone, as it creates and removes temporary
    data-blocks."""
    columns = _columns(ob.data, list(dict.fromkeys(names))) if _pays(ob.data, names) else {}
    if not columns or not all(_is_of(ob, name, *column) for name, column in columns.items()):
        return mesh_data.group_entries(ob, names)
    vertices, weights = zip(*(columns[name] for name in names))
    return (np.concatenate(vertices), np.repeat(np.arange(len(names)), [len(of_one) for of_one in vertices]),
            np.concatenate(weights))


def _pays(mesh, names):
    """Whether nodes can read these groups and are faster than the loop. Not in Edit Mode, where the groups are in the
    BMesh. Not where an attribute has a group's name, as nodes see only one of them. Not where the mesh, its keys or
    materials have drivers, which would be evaluated with all that they depend on. Not during a render job, which may
    hold the temporary data."""
    least = _VERTICES_A_GROUP * (len(names) + _SCENE) + _VERTICES_AN_OBJECT * len(bpy.data.objects)
    if not 0 < len(names) <= _MAX_GROUPS or len(mesh.vertices) < least or mesh.is_editmode:
        return False
    materials = [material for material in mesh.materials if material]
    blocks = [mesh, mesh.shape_keys, *materials, *(material.node_tree for material in materials)]
    return not (set(names) & set(mesh.attributes.keys()) or bpy.app.is_job_running('RENDER')
                or any(block and block.animation_data and block.animation_data.drivers for block in blocks))


def _is_of(ob, name, members, weights):
    """Whether the copy is the group's, by samples: for a built-in name, such as "position" or "crease", nodes give
    another attribute or none. These names depend on Blender's version. A copy without members counts as failed."""
    if not len(members):
        return False
    group, count = ob.vertex_groups[name].index, len(ob.data.vertices)
    chosen = np.union1d(np.arange(0, count, max(1, count // _SAMPLES)), members[::max(1, len(members) // _SAMPLES)])
    indices = np.searchsorted(members, chosen).clip(max=len(members) - 1)
    copied = np.where(members[indices] == chosen, weights[indices], 0)
    return all(weight == next((element.weight for element in ob.data.vertices[vertex].groups
                               if element.group == group), 0.0)
               for vertex, weight in zip(chosen.tolist(), copied.tolist()))


def _columns(mesh, names):
    """{name: (vertices, weights)} of the non-zero weights of each group; {} where the nodes fail for one of them."""
    made = []
    try:
        made.append(scene := bpy.data.scenes.new(node_group.NAME))
        made.append(ob := bpy.data.objects.new(node_group.NAME, mesh))
        made.append(nodes := bpy.data.node_groups.new(node_group.NAME, 'GeometryNodeTree'))
        _copy(nodes, names)
        ob.modifiers.new(node_group.NAME, 'NODES').node_group = nodes
        scene.collection.objects.link(ob)
        depsgraph = _depsgraph(scene)
        if depsgraph is None:
            return {}
        evaluated = ob.evaluated_get(depsgraph).data
        result, column = {}, np.empty(len(mesh.vertices), np.float32)
        for number, name in enumerate(names):
            if len(evaluated.vertices) != len(column) or not mesh_data.read_attribute_into(
                    evaluated, _copy_of(number), 'value', column):
                return {}
            members = np.flatnonzero(column)
            result[name] = members, column[members]
        return result
    finally:
        for item in made:
            bpy.data.batch_remove([item])  # one by one: removed together, they tag the users of the mesh as changed


def _copy_of(number):
    return f".detail_deform_group_{number}"


def _copy(nodes, names):
    """Adds the nodes that store each of these groups as an attribute, named by _copy_of()."""
    for in_out in ('INPUT', 'OUTPUT'):
        node_group.new_socket(nodes, 'Geometry', 'NodeSocketGeometry', in_out)
    last = nodes.nodes.new('NodeGroupInput').outputs[0]
    for number, name in enumerate(names):
        group, copy = (nodes.nodes.new(kind) for kind in (
            'GeometryNodeInputNamedAttribute', 'GeometryNodeStoreNamedAttribute'))
        group.data_type = copy.data_type = 'FLOAT'
        group.inputs['Name'].default_value = name
        copy.inputs['Name'].default_value = _copy_of(number)
        nodes.links.new(_shown(group.outputs, 'Attribute'), _shown(copy.inputs, 'Value'))
        nodes.links.new(last, copy.inputs['Geometry'])
        last = copy.outputs['Geometry']
    nodes.links.new(last, nodes.nodes.new('NodeGroupOutput').inputs[0])


def _shown(sockets, name):
    """The enabled socket of this name: nodes have one for each data type."""
    return next(socket for socket in sockets if socket.name == name and socket.enabled)


def _depsgraph(scene):
    """The evaluated depsgraph of a new scene; None where Blender doesn't create one, as while its interface is locked.

    An update of the view layer would write animated values back to the originals, and a change of the frame would call
    handlers with a scene unknown to the user. Scene.statistics() creates a depsgraph that writes nothing back, and the
    first evaluation of a depsgraph calls no handlers."""
    layer = scene.view_layers[0]
    scene.statistics(layer)
    if layer.depsgraph is not None:
        layer.depsgraph.update()
    return layer.depsgraph
