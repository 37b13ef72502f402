# SPDX-License-Identifier: GPL-3.0-or-later
"""Sculpts with Multires that several test files pull, and what a shape key displays of it."""

import bpy
import numpy as np

from conftest import activate, evaluated, make_strip, own, script_copy, update

KEY = 'Detail Deform'


def sculpt(ob, height):
    """Adds three Multires levels to the object, and presses a relief of this height into them."""
    modifier = ob.modifiers.new("Multires", 'MULTIRES')
    activate(ob)
    for _ in range(3):
        bpy.ops.object.multires_subdivide(modifier="Multires", mode='CATMULL_CLARK')
    update()
    points = evaluated(ob)
    points[:, 2] += height * np.sin(60 * points[:, 0]) * np.sin(60 * points[:, 1])
    press(ob, points)
    assert np.abs(evaluated(ob) - points).max() < 1e-5
    return modifier


def press(ob, points):
    """Makes Multires give these positions, (n, 3), as sculpting does."""
    mesh = bpy.data.meshes.new_from_object(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()))
    mesh.vertices.foreach_set('co', points.astype(np.float32).ravel())
    mesh.update()
    relief = bpy.data.objects.new("Relief", mesh)
    bpy.context.scene.collection.objects.link(relief)
    activate(ob)
    relief.select_set(True)
    update()
    assert bpy.ops.object.multires_reshape(modifier="Multires") == {'FINISHED'}
    bpy.data.objects.remove(relief)
    update()


def subdivide(ob):
    """Subdivides all of the mesh in Edit Mode."""
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode='OBJECT')
    update()


def make_sculpt(n=13, height=0.02):
    ob = make_strip(n)
    sculpt(ob, height)
    return ob


def pose(ob, angle=1.2):
    """Turns the handle by an angle about y, and lifts it. Returns the evaluated positions."""
    target = ob.detail_deform.handles[0].target
    target.location, target.rotation_euler = (0.8, 0.5, 0.5), (0, -angle, 0)
    update()
    return evaluated(ob)


def keys(ob):
    return [key.name for key in ob.data.shape_keys.key_blocks] if ob.data.shape_keys else []


def key(ob):
    return ob.data.shape_keys.key_blocks[KEY]


def add_key(ob, name):
    """Adds a shape key of value 0, after a reference key."""
    if not keys(ob):
        ob.shape_key_add(name="Basis", from_mix=False)
    made = ob.shape_key_add(name=name, from_mix=False)
    made.value = 0.0
    return made


def offsets_of(ob):
    """(n, 3): the offsets that are displayed."""
    offsets = np.empty(3 * len(ob.data.vertices), np.float32)
    ob.data.attributes['detail_deform_offset'].data.foreach_get('vector', offsets)
    return offsets.reshape(-1, 3).astype(float)


def displaced(ob):
    """The evaluated positions of a copy whose vertices are where the offsets put them, without Detail Deform and shape
    keys: what Blender makes of such a mesh."""
    copy = script_copy(ob)
    copy.detail_deform.live, copy.detail_deform.signature = False, ""
    for modifier in list(copy.modifiers):
        if modifier.type == 'NODES':
            copy.modifiers.remove(modifier)
    if copy.data.shape_keys:
        copy.shape_key_clear()
    copy.data.vertices.foreach_set('co', (own(ob) + offsets_of(ob)).astype(np.float32).ravel())
    copy.data.update()
    update()
    result = evaluated(copy)
    bpy.data.objects.remove(copy)
    update()
    return result
