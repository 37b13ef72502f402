# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups read a whole group at a time.

No version of Blender has a foreach_get for them, and Python goes through them vertex by vertex. Geometry Nodes copy a
group into an attribute, which is read at once: of an object in a scene of its own, both gone when this is done."""

from contextlib import contextmanager

import bpy
import numpy as np

from . import mesh_data, node_group

# What Python takes for so many vertices is what a group's nodes take to be made, and a scene that of some more groups.
# Of each object Blender looks anew at what it depends on, as after every object that comes or goes.
_VERTICES_A_GROUP, _SCENE = 2000, 5
_VERTICES_AN_OBJECT = 100
_SAMPLES = 50  # of a group's members, and of all vertices

_NAME = "Detail Deform Reads Groups"


def entries(ob, names):
    """As mesh_data.group_entries, but for weights of 0. For operators: it makes data, and takes them away again."""
    if not _pays(ob.data, names):
        return mesh_data.group_entries(ob, names)
    distinct = list(dict.fromkeys(names))
    columns = dict(zip(distinct, _columns(ob.data, distinct)))
    if not all(_is_of(ob, name, column) for name, column in columns.items()):
        return mesh_data.group_entries(ob, names)
    members = [np.flatnonzero(columns[name]) for name in names]
    return (np.concatenate(members), np.repeat(np.arange(len(names)), [len(of_one) for of_one in members]),
            np.concatenate([columns[name][of_one] for name, of_one in zip(names, members)]))


def _pays(mesh, names):
    """Whether it can be done, and is the faster way. In Edit Mode the groups are elsewhere; what drives the mesh or its
    shape keys would be evaluated, too, and may be any rig."""
    least = _VERTICES_A_GROUP * (len(names) + _SCENE) + _VERTICES_AN_OBJECT * len(bpy.data.objects)
    if not names or len(mesh.vertices) < least or mesh.is_editmode:
        return False
    blocks = [block for block in (mesh, mesh.shape_keys) if block and block.animation_data]
    return not any(block.animation_data.drivers for block in blocks)


def _is_of(ob, name, column):
    """Whether it is the group that was copied: nodes give something else, or nothing, for a name that means something
    to Blender, as "position" and "crease", which are others in each version. What has no member may be such a one."""
    group, members = ob.vertex_groups[name].index, np.flatnonzero(column)
    chosen = {*members[::max(1, len(members) // _SAMPLES)].tolist(),
              *range(0, len(column), max(1, len(column) // _SAMPLES))}
    return bool(len(members)) and all(
        column[vertex] == next((element.weight for element in ob.data.vertices[vertex].groups
                                if element.group == group), 0.0) for vertex in chosen)


def _columns(mesh, names):
    """(groups, n) float32"""
    made = []
    try:
        made.append(scene := bpy.data.scenes.new(_NAME))
        made.append(ob := bpy.data.objects.new(_NAME, mesh))
        made.append(nodes := bpy.data.node_groups.new(_NAME, 'GeometryNodeTree'))
        _copy(nodes, names)
        ob.modifiers.new(_NAME, 'NODES').node_group = nodes
        scene.collection.objects.link(ob)
        # An update of its view layer would also write what is animated into the originals.
        with _nobody_told():
            scene.frame_set(scene.frame_current)
        attributes = ob.evaluated_get(scene.view_layers[0].depsgraph).data.attributes
        result = np.empty((len(names), len(mesh.vertices)), np.float32)
        for number, column in enumerate(result):
            attributes[_copy_of(number)].data.foreach_get('value', column)
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


@contextmanager
def _nobody_told():
    """Whoever listens to Blender's updates would be shown a scene that nobody has made."""
    lists = [getattr(bpy.app.handlers, f'{event}_{when}')
             for event in ('depsgraph_update', 'frame_change') for when in ('pre', 'post')]
    kept = [list(of_one) for of_one in lists]
    for of_one in lists:
        of_one.clear()
    try:
        yield
    finally:
        for of_one, functions in zip(lists, kept):
            of_one[:] = functions
