# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups read a whole group at a time.

Python goes through them vertex by vertex. Geometry Nodes copy a group into an attribute, which is read at once: of an
object in a scene of its own, both gone when this is done."""

import bpy
import numpy as np

from . import mesh_data, node_group

# The break-even with Python's loop, in vertices that it visits in the same time (native/README.md has the measurement).
# The nodes of a group take as long as 2,000 vertices, the temporary scene as long as five groups. Besides, Blender
# rebuilds its dependency graph, which takes as long as 100 vertices for each object of the file.
_VERTICES_A_GROUP, _SCENE = 2000, 5
_VERTICES_AN_OBJECT = 100
_MOST_GROUPS = 64  # bounds the memory, n floats each
_SAMPLES = 50  # vertices of each group, and of all, whose weights are compared with Python's


def entries(ob, names):
    """As mesh_data.group_entries, but for weights of 0. For Bind: it makes data, and takes them away again."""
    columns = _columns(ob.data, list(dict.fromkeys(names))) if _pays(ob.data, names) else {}
    if not columns or not all(_is_of(ob, name, *column) for name, column in columns.items()):
        return mesh_data.group_entries(ob, names)
    vertices, weights = zip(*(columns[name] for name in names))
    return (np.concatenate(vertices), np.repeat(np.arange(len(names)), [len(of_one) for of_one in vertices]),
            np.concatenate(weights))


def _pays(mesh, names):
    """Whether it can be done, and is the faster way. In Edit Mode the groups are elsewhere; of a group and an attribute
    with one name, nodes see but one; what drives the mesh, its keys or its materials would be evaluated, too, and may
    be any rig; and a render must not find what it works on gone."""
    least = _VERTICES_A_GROUP * (len(names) + _SCENE) + _VERTICES_AN_OBJECT * len(bpy.data.objects)
    if not 0 < len(names) <= _MOST_GROUPS or len(mesh.vertices) < least or mesh.is_editmode:
        return False
    materials = [material for material in mesh.materials if material]
    blocks = [mesh, mesh.shape_keys, *materials, *(material.node_tree for material in materials)]
    return not (set(names) & set(mesh.attributes.keys()) or bpy.app.is_job_running('RENDER')
                or any(block and block.animation_data and block.animation_data.drivers for block in blocks))


def _is_of(ob, name, members, weights):
    """Whether it is the group that was copied: nodes give something else, or nothing, for a name that means something
    to Blender, as "position" and "crease", which are others in each version. What has no member may be such a one."""
    if not len(members):
        return False
    group, count = ob.vertex_groups[name].index, len(ob.data.vertices)
    chosen = np.union1d(np.arange(0, count, max(1, count // _SAMPLES)), members[::max(1, len(members) // _SAMPLES)])
    places = np.searchsorted(members, chosen).clip(max=len(members) - 1)
    copied = np.where(members[places] == chosen, weights[places], 0)
    return all(weight == next((element.weight for element in ob.data.vertices[vertex].groups
                               if element.group == group), 0.0)
               for vertex, weight in zip(chosen.tolist(), copied.tolist()))


def _columns(mesh, names):
    """By name the vertices with a weight, and their weights; {} where nodes don't give one."""
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
            if len(evaluated.vertices) != len(column) or not mesh_data.copied(
                    evaluated, _copy_of(number), 'value', column):
                return {}
            members = np.flatnonzero(column)
            result[name] = members, column[members]
        return result
    finally:
        for item in made:
            bpy.data.batch_remove([item])  # all at once they take the mesh's users for changed


def _copy_of(number):
    return f".detail_deform_group_{number}"


def _copy(nodes, names):
    """Makes the nodes that copy each of these groups into an attribute."""
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
    """Of those with this name, one for each type, that of the node's type."""
    return next(socket for socket in sockets if socket.name == name and socket.enabled)


def _depsgraph(scene):
    """The evaluated depsgraph of a scene that has none yet; None where Blender doesn't make one, as while its interface
    is locked. An update of the view layer would also write what is animated into the originals, and a change of the
    frame is told to all who listen, who would be shown a scene that nobody has made. The statistics make a depsgraph
    that writes nothing back, and of the first evaluation of a depsgraph Blender tells nobody."""
    layer = scene.view_layers[0]
    scene.statistics(layer)
    if layer.depsgraph is not None:
        layer.depsgraph.update()
    return layer.depsgraph
