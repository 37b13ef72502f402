# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the displayed deformation into the mesh, as vertex positions or as a shape key."""

import numpy as np

from . import channel, deform_modifier, mesh_data, offset_attribute

SHAPE_KEY_NAME = 'Detail Deform'


def shown_offsets(ob):
    """(n, 3) float32: the offsets times the modifier's Factor and Influence weights."""
    modifier = deform_modifier.find(ob)
    return offset_attribute.read(ob.data) * (deform_modifier.display_weights(ob, modifier) if modifier else 1.0)


def save_key(ob, name):
    """Adds a shape key of value 0 that holds the displayed deformation. Returns its name. Raises MeshProblem."""
    offsets = shown_offsets(ob)
    if mesh_data.are_invisible(ob.data, offsets):
        raise mesh_data.MeshProblem("Nothing is deformed that could be saved: move a handle first.")
    return add_key(ob, name, offsets).name


def apply(ob, mode):
    """Applies shown_offsets(). mode: 'MESH' moves the vertices, and those of every shape key, so that keys keep their
    effect; 'SHAPE_KEY' adds a key of value 1."""
    mesh, offsets = ob.data, shown_offsets(ob)
    channel.remove_key(ob)
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
    """Overwrites an existing shape key: the rest shape plus offsets, (n, 3), relative to the reference key."""
    key.relative_key = ob.data.shape_keys.reference_key
    key.data.foreach_set('co', (mesh_data.rest_positions(ob.data) + offsets).ravel())


def add_key(ob, name, offsets):
    """Adds a shape key of value 0 that moves the mesh by offsets, (n, 3). Returns the key."""
    if not ob.data.shape_keys:
        ob.shape_key_add(name="Basis", from_mix=False)
    key = ob.shape_key_add(name=name, from_mix=False)
    key.value = 0.0  # from 5.2 on, new keys have the value 1
    set_key(ob, key, offsets)  # the vertices, which a new key has, may be others than the reference's
    return key
