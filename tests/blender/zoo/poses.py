# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of changes of a bound object: extreme motions, edits, and lost data."""

import tempfile
from pathlib import Path

import bpy

from . import objects
from .kind import Kinds
from .specimen import RIGHT, DoesNotCombine, update

KINDS = kind = Kinds('pose')


def _placed(name, value):
    def make(of):
        setattr(of.empty, name, value)
    return make


KINDS.each('pose', {f"then empty {name} {value}": _placed(name, value) for name, value in (
    ('location', (1e3, 0, 0)), ('location', (1e8, 0, 0)), ('location', (1e20, 0, 0)), ('location', (3e38, 0, 0)),
    ('location', (float('nan'), 0, 0)), ('location', (float('inf'), 0, 0)), ('scale', (0, 0, 0)),
    ('scale', (1, 0, 1)), ('scale', (-1, 1, 1)), ('scale', (-1, -1, -1)), ('scale', (1e-20, 1, 1)),
    ('scale', (1e6, 1e6, 1e6)), ('scale', (float('nan'), 1, 1)), ('rotation_euler', (3.14159265, 0, 0)),
    ('rotation_euler', (0, 0, 3.2)), ('rotation_euler', (0, 40, 0)), ('rotation_euler', (0, 1e9, 0)),
    ('rotation_euler', (float('nan'), 0, 0)))})


KINDS.each('pose', {"then the empty is deleted": objects.delete_empty,
                    "then the empty leaves the scene": objects.unlink_empty})


@kind("then object's scale is 0", about='pose')
def _no_scale(of):
    of.ob.scale = (0, 0, 0)


@kind("then a vertex moves", about='edit')
def _vertex(of):
    if not len(of.ob.data.vertices):
        raise DoesNotCombine
    of.ob.data.vertices[len(of.ob.data.vertices) // 2].co.z += 0.1 * of.size
    of.ob.data.update()


@kind("then a vertex becomes NaN", about='edit')
def _nan(of):
    if not len(of.ob.data.vertices):
        raise DoesNotCombine
    of.ob.data.vertices[len(of.ob.data.vertices) // 2].co.z = float('nan')
    of.ob.data.update()


@kind("then it has other faces", about='edit')
def _faces(of):
    of.ob.data.clear_geometry()
    of.ob.data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    of.ob.data.update()


@kind("then it has nothing", about='edit')
def _nothing(of):
    of.ob.data.clear_geometry()
    of.ob.data.update()


@kind("then it has another mesh", about='edit')
def _mesh(of):
    mesh = bpy.data.meshes.new("Another")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    of.ob.data = mesh


@kind("then the handle's group is gone", about='edit')
def _group(of):
    group = of.ob.vertex_groups.get(RIGHT)
    if group is None:
        raise DoesNotCombine
    of.ob.vertex_groups.remove(group)
    _settle()


@kind("then the handle's group is empty", about='edit')
def _group_empty(of):
    of.weights(RIGHT, {})
    of.ob.data.update_tag()
    _settle()


def _settle():
    """Updates, as an edit of groups by a script is noticed only then."""
    try:
        bpy.ops.object.detail_deform_update()
    except RuntimeError:
        pass  # the refusal is in the status too


@kind("then the handles are gone", about='edit')
def _handles(of):
    of.ob.detail_deform.handles.clear()
    _settle()


@kind("then the modifier is gone", about='edit')
def _modifiers(of):
    of.ob.modifiers.clear()


@kind("then a modifier comes that makes vertices", about='edit')
def _subdivided(of):
    of.ob.modifiers.new("Subdivision", 'SUBSURF')


def _enter_edit_mode(of):
    bpy.context.view_layer.objects.active = of.ob
    if of.ob.hide_get() or of.ob.hide_viewport:
        raise DoesNotCombine
    bpy.ops.object.mode_set(mode='EDIT')


@kind("then it is edited", about='edit')
def _edited(of):
    _enter_edit_mode(of)
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.ops.mesh.duplicate()  # not Subdivide, which crashes Blender 5.2 on duplicate faces
    bpy.ops.object.mode_set(mode='OBJECT')


@kind("then it is looked at in Edit Mode", about='edit')
def _looked_at(of):
    _enter_edit_mode(of)
    of.empty.location.x += 0.01 * of.size
    update()
    bpy.ops.object.mode_set(mode='OBJECT')


@kind("then it is saved and loaded", about='edit')
def _saved(of):
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, "saved.blend"))
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
    of.empty.location.x += 0.01 * of.size


@kind("then it plays", about='edit')
def _played(of):
    empty = of.empty
    empty.keyframe_insert('location', frame=1)
    empty.location.z += 0.1 * of.size
    empty.keyframe_insert('location', frame=5)
    bpy.context.scene.frame_set(3)


@kind("then it is bound again where it is", about='edit')
def _bound_again(of):
    try:
        bpy.ops.object.detail_deform_bind(wait=True, keep_rest=True)
    except RuntimeError:
        pass  # the refusal is in the status too


@kind("then it is bound anew", about='edit')
def _bound_anew(of):
    try:
        bpy.ops.object.detail_deform_bind(wait=True)
    except RuntimeError:
        pass
