# SPDX-License-Identifier: GPL-3.0-or-later
"""The shown deformation made part of the mesh, for good."""

import numpy as np

from . import mesh_data, node_group, offset_attribute

SHAPE_KEY_NAME = 'Detail Deform'


def shown_offsets(ob):
    """(n, 3) float32: as far as the modifier's Factor and Influence show the deformation."""
    modifier = node_group.find_modifier(ob)
    return offset_attribute.read(ob.data) * (node_group.amount(ob, modifier) if modifier else 1.0)


def save_key(ob, name):
    """A shape key, not shown yet, that holds the deformation as it is shown. Returns its name."""
    offsets = shown_offsets(ob)
    if mesh_data.is_nothing(ob.data, offsets):
        raise mesh_data.MeshProblem("Nothing is deformed that could be saved: move a handle first.")
    return add_key(ob, name, offsets).name


def apply(ob, mode):
    """mode: 'MESH' moves the vertices (of every shape key too, so that keys keep their effect);
    'SHAPE_KEY' adds a key. As far as the modifier's Factor and Influence show the deformation."""
    mesh, offsets = ob.data, shown_offsets(ob)
    if mode == 'SHAPE_KEY':
        add_key(ob, SHAPE_KEY_NAME, offsets).value = 1.0
        return
    _move(mesh.vertices, offsets)
    if mesh.shape_keys:
        for key in mesh.shape_keys.key_blocks:
            _move(key.data, offsets)
    mesh.update()


def _move(points, offsets):
    values = np.empty(offsets.size, np.float32)
    points.foreach_get('co', values)
    points.foreach_set('co', values + offsets.ravel())


def set_key(ob, key, offsets):
    """Makes a present shape key move the mesh by these offsets."""
    key.relative_key = ob.data.shape_keys.reference_key
    key.data.foreach_set('co', (mesh_data.rest(ob.data) + offsets).ravel())


def add_key(ob, name, offsets):
    """A new shape key that moves the mesh by these offsets, not shown yet."""
    if not ob.data.shape_keys:
        ob.shape_key_add(name="Basis", from_mix=False)
    key = ob.shape_key_add(name=name, from_mix=False)
    key.value = 0.0  # from 5.2 on they come with 1
    _move(key.data, offsets)
    return key
