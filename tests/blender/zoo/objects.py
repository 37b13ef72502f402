# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of odd objects: transforms, empties, shape keys, modifiers, shared and linked meshes, modes."""

import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from .kind import Kinds
from .specimen import DoesNotCombine, update

KINDS = kind = Kinds('object')


def _assign(which, name, value):
    """Sets a property of the object ('ob') or of its empty ('empty')."""
    def make(of):
        setattr(getattr(of, which), name, value)
    return make


# ---- transforms

KINDS.each('transform', {f"object {name} {value}": _assign('ob', name, value) for name, value in (
    ('scale', (0, 0, 0)), ('scale', (1, 0, 1)), ('scale', (-1, 1, 1)), ('scale', (1, 20, 0.05)),
    ('scale', (1e-6, 1e-6, 1e-6)), ('scale', (1e-12, 1e-12, 1e-12)), ('scale', (1e6, 1e6, 1e6)),
    ('location', (1e6, 0, -1e6)), ('location', (1e30, 0, 0)), ('location', (float('nan'), 0, 0)),
    ('rotation_euler', (float('inf'), 0, 0)), ('delta_scale', (2, 2, 0.5)))})
KINDS.each('empty', {f"empty {name} {value}": _assign('empty', name, value) for name, value in (
    ('scale', (0, 0, 0)), ('scale', (1, 0, 1)), ('scale', (-1, 1, 1)), ('scale', (1e-6, 1e-6, 1e-6)),
    ('scale', (1e-12, 1e-12, 1e-12)), ('scale', (1e9, 1e9, 1e9)), ('location', (1e8, 0, 0)), ('location', (1e30, 0, 0)),
    ('location', (float('nan'), 0, 0)), ('rotation_euler', (0, float('nan'), 0)))})


@kind("object below a sheared parent", about='transform')
def _sheared(of):
    parent = _empty("Parent")
    parent.scale = (1, 3, 0.2)
    turned = _empty("Turned", parent)
    turned.rotation_euler = (0.6, 0.5, 0.4)
    turned.scale = (1, 0.3, 2)
    of.ob.parent = turned


def _empty(name, parent=None):
    made = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(made)
    made.parent = parent
    return made


@kind("empty below a sheared parent", about='empty')
def _empty_sheared(of):
    parent = _empty("Parent")
    parent.scale, parent.rotation_euler = (1, 4, 0.3), (0.5, 0.6, 0.7)
    of.empty.parent = parent


@kind("empty deleted", about='empty')
def delete_empty(of):
    if of.empty == of.ob:
        raise DoesNotCombine
    bpy.data.objects.remove(of.empty)


@kind("empty not in the scene", about='empty')
def unlink_empty(of):
    for collection in of.empty.users_collection:
        collection.objects.unlink(of.empty)


@kind("empty in an excluded collection", about='empty')
def _excluded(of):
    made = bpy.data.collections.new("Excluded")
    bpy.context.scene.collection.children.link(made)
    unlink_empty(of)
    made.objects.link(of.empty)
    bpy.context.view_layer.layer_collection.children["Excluded"].exclude = True


@kind("empty disabled in the viewport", about='empty')
def _disabled(of):
    of.empty.hide_viewport = True


@kind("empty the mesh itself", about='empty')
def _itself(of):
    of.handle.target = of.ob
    of.is_carried = True  # the object doesn't move relative to itself


@kind("empty another mesh", about='empty')
def _a_mesh(of):
    of.handle.target = of.other("Cube", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])


@kind("empty that follows the mesh's own vertices", about='empty')
def _cycle(of):
    of.empty.parent = of.ob
    of.empty.parent_type = 'VERTEX'
    of.empty.parent_vertices[0] = 0
    of.is_carried = True  # it is moved by vertices that it moves itself, which the status reports


@kind("empty by a driver that fails", about='empty')
def _driven(of):
    driver = of.empty.driver_add('location', 2).driver
    driver.expression = "1 / 0"


@kind("empty on a bone", about='empty')
def _bone(of):
    armature = bpy.data.objects.new("Armature", bpy.data.armatures.new("Armature"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode='EDIT')
    bone = armature.data.edit_bones.new("Bone")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode='OBJECT')
    bpy.context.view_layer.objects.active = of.ob
    of.empty.parent, of.empty.parent_type, of.empty.parent_bone = armature, 'BONE', "Bone"


# ---- shape keys

def _keyed(of):
    if of.ob.data.shape_keys:
        raise DoesNotCombine
    of.ob.shape_key_add(name="Basis", from_mix=False)
    key = of.ob.shape_key_add(name="Up", from_mix=False)
    values = np.zeros(3 * len(of.ob.data.vertices), np.float32)
    if not len(values):
        raise DoesNotCombine
    key.data.foreach_get('co', values)
    values[2::3] += 0.1 * of.size
    key.value = 0  # Blender 5.2 adds keys with the value 1
    key.data.foreach_set('co', values)
    return key


@kind("a shape key at rest", about='keys')
def _key(of):
    _keyed(of)


@kind("a shape key that is shown", about='keys')
def _key_shown(of):
    _keyed(of).value = 0.5
    _starts_from_what_is_seen(of)


def _starts_from_what_is_seen(of):
    update()
    keys = of.ob.data.shape_keys.key_blocks
    values = np.zeros((len(keys), 3 * len(of.ob.data.vertices)), np.float32)
    for row, key in zip(values, keys):
        key.data.foreach_get('co', row)
    mix = values[0].astype(float)
    for row, key in zip(values, keys):
        mix = mix + key.value * (not key.mute) * (row.astype(float) - values[keys.find(key.relative_key.name)])
    of.kept_start = mix.reshape(-1, 3)


@kind("a muted shape key", about='keys')
def _key_muted(of):
    key = _keyed(of)
    key.value, key.mute = 1, True


@kind("shape keys relative to each other", about='keys')
def _key_chain(of):
    up = _keyed(of)
    more = of.ob.shape_key_add(name="More", from_mix=False)
    up.value = more.value = 0.7
    more.relative_key = up
    _starts_from_what_is_seen(of)


@kind("absolute shape keys", about='keys')
def _key_absolute(of):
    _keyed(of)
    of.ob.data.shape_keys.use_relative = False


@kind("a shape key of NaN at rest", about='keys')
def _key_nan(of):
    key = _keyed(of)
    key.data[0].co = (float('nan'), 0, 0)


@kind("a shape key of NaN that is shown", about='keys')
def _key_nan_shown(of):
    _key_nan(of)
    of.ob.data.shape_keys.key_blocks[1].value = 1
    of.shows_own_faults = True


@kind("a basis of NaN", about='keys')
def _basis_nan(of):
    _keyed(of)
    of.ob.data.shape_keys.key_blocks[0].data[0].co = (float('nan'), 0, 0)
    of.shows_own_faults = True


@kind("an empty shape key's weights", about='keys')
def _key_group(of):
    key = _keyed(of)
    key.value, key.vertex_group = 1, 'right'
    of.is_carried = True  # leaves handles unchecked: the start by masked keys isn't computed here


# ---- modifiers

MODIFIERS = {
    'SUBSURF': {}, 'MIRROR': {}, 'ARRAY': {}, 'DECIMATE': {'ratio': 0.5}, 'WELD': {'merge_threshold': 0.01},
    'TRIANGULATE': {}, 'SOLIDIFY': {}, 'MASK': {'vertex_group': 'right'}, 'WAVE': {}, 'SMOOTH': {}, 'CAST': {},
    'SIMPLE_DEFORM': {}, 'LATTICE': {}, 'ARMATURE': {}, 'SHRINKWRAP': {}, 'DISPLACE': {'strength': 0.1},
    'BEVEL': {'width': 0.01}, 'REMESH': {'mode': 'BLOCKS', 'octree_depth': 3}, 'WIREFRAME': {}, 'EDGE_SPLIT': {},
    'SCREW': {}, 'BUILD': {}, 'MULTIRES': {}, 'DATA_TRANSFER': {}, 'WEIGHTED_NORMAL': {}, 'NODES': {}, 'CLOTH': {}}


def _modifier(kind_, settings, before):
    def make(of):
        try:
            made = of.ob.modifiers.new(kind_.title(), kind_)
        except RuntimeError:
            raise DoesNotCombine from None
        for name, value in settings.items():
            setattr(made, name, value)
        if before:
            bpy.context.view_layer.objects.active = of.ob
            bpy.ops.object.modifier_move_to_index(modifier=made.name, index=0)
        of.shows_own_faults = True
        of.is_carried |= kind_ == 'MIRROR'  # vertices on its plane don't follow their handle off it
    return make


for before in (True, False):
    KINDS.each(f'modifier {before}', {
        f"modifier {kind_} {'before' if before else 'after'}": _modifier(kind_, settings, before)
        for kind_, settings in MODIFIERS.items()})


@kind("its modifier hidden", about='own modifier')
def _hidden(of):
    for modifier in of.ob.modifiers:
        modifier.show_viewport = False


@kind("its modifier removed", about='own modifier')
def _removed(of):
    of.ob.modifiers.clear()


# ---- shared, copied and linked meshes, modes and visibility

@kind("mesh of two objects", about='owner')
def _shared(of):
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Twin", of.ob.data))


@kind("a copied object", about='owner')
def _copied(of):
    ob = of.ob
    copy = ob.copy()
    copy.data = ob.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    for other in bpy.context.selected_objects:
        other.select_set(False)
    bpy.context.view_layer.objects.active = copy
    of.name = copy.name


@kind("mesh linked from another file", about='owner')
def _linked(of):
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, "library.blend"))
        bpy.data.libraries.write(path, {of.ob.data}, fake_user=True)
        with bpy.data.libraries.load(path, link=True) as (_, target):
            target.meshes = [of.ob.data.name]
    of.ob.data = target.meshes[0]


@kind("in Edit Mode", about='mode')
def _edit_mode(of):
    update()
    if of.ob.data.library:
        raise DoesNotCombine
    bpy.context.view_layer.objects.active = of.ob
    bpy.ops.object.mode_set(mode='EDIT')


@kind("in Sculpt Mode", about='mode')
def _sculpt_mode(of):
    update()
    bpy.context.view_layer.objects.active = of.ob
    if not len(of.ob.data.vertices):
        raise DoesNotCombine
    if of.ob.data.library:
        raise DoesNotCombine
    bpy.ops.object.mode_set(mode='SCULPT')


@kind("instanced by a collection", about='owner')
def _instanced(of):
    made = bpy.data.collections.new("Instanced")
    made.objects.link(of.ob)
    instance = _empty("Instance")
    instance.instance_type, instance.instance_collection = 'COLLECTION', made


@kind("hidden in the viewport", about='seen')
def _hide(of):
    of.ob.hide_set(True)


@kind("disabled in the viewport", about='seen')
def _disable(of):
    of.ob.hide_viewport = True


@kind("instances on its faces", about='owner')
def _instancer(of):
    of.ob.instance_type = 'FACES'
    child = of.other("Child", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    child.parent = of.ob
    child.matrix_parent_inverse = Matrix()
