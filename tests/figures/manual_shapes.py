# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual's pictures of shapes, rendered by Workbench: each method, the modifier order, expressions.

blender --background --factory-startup --python-exit-code 1 --python tests/figures/manual_shapes.py
"""
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / 'addon' / 'manual'
sys.path[:0] = [str(ROOT / 'addon'), str(Path(__file__).parent)]
import detail_deform  # noqa: E402
import shapes  # noqa: E402

SIZE = (400, 330)
COLUMNS, ROWS, LENGTH = 205, 121, 1.7  # of the thorny plate
EDGE = 41  # columns fixed on the left, and in the handle on the right: one row of thorns each


def render(name):
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.image_settings.file_format, scene.render.image_settings.quality = 'JPEG', 80
    scene.render.filepath = str(OUT / name)
    for stamp in (name for name in dir(scene.render) if name.startswith('use_stamp')):
        setattr(scene.render, stamp, False)  # so that a picture made again has the same bytes
    bpy.ops.render.render(write_still=True)


def look(eye, at, lens):
    camera = bpy.context.scene.camera
    camera.location, camera.data.lens = eye, lens
    camera.rotation_euler = (Vector(at) - Vector(eye)).to_track_quat('-Z', 'Y').to_euler()


def update():
    bpy.context.view_layer.update()


def activate(ob):
    update()  # the view layer may still hold what was removed
    for other in bpy.context.view_layer.objects:
        other.select_set(other == ob)
    bpy.context.view_layer.objects.active = ob
    return ob


def add(name, positions, faces, color):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(positions.tolist(), [], faces.tolist())
    mesh.polygons.foreach_set('use_smooth', np.ones(len(mesh.polygons), bool))
    ob = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(ob)
    ob.color = color
    return activate(ob)


def group(ob, name, chosen):
    ob.vertex_groups.new(name=name).add(np.flatnonzero(chosen).tolist(), 1.0, 'REPLACE')


def rolled(positions, angle):
    """The plate rolled up: bent along an arc between its edges, of which the left one stays."""
    x, z = positions[:, 0], positions[:, 2]
    begin = EDGE * LENGTH / (COLUMNS - 1)
    length = LENGTH - 2 * begin
    turn = angle * np.clip((x - begin) / length, 0, 1)
    radius, beyond = length / angle - z, np.clip(x - begin - length, 0, None)
    return np.stack([np.minimum(x, begin) + radius * np.sin(turn) + beyond * np.cos(turn), positions[:, 1],
                     length / angle - radius * np.cos(turn) + beyond * np.sin(turn)], -1)


def methods():
    """A thorny plate whose right edge is lifted, by each method; and at rest."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'bumpy_plane.blend'), load_ui=False)
    bpy.data.objects.remove(bpy.data.objects["Bumpy Plane"])
    positions, faces = shapes.thorns(COLUMNS, ROWS, 5, 3)
    example = add("Rolled up", rolled(positions, 1.2), faces, (1, 1, 1, 1))
    example.hide_render = True
    ob = add("Plate", positions, faces, (0.84, 0.58, 0.30, 1))
    column = np.arange(len(positions)) // ROWS
    group(ob, "region", column >= EDGE)
    group(ob, "right", column >= COLUMNS - EDGE)
    ob.detail_deform.region = "region"
    bpy.ops.object.detail_deform_handle_add(vertex_group="right", align=False)
    look((0.7, -4.7, 1.9), (0.8, 0.5, 0.42), 84)
    update()
    render('method-rest.jpg')
    example.select_set(True)
    bpy.ops.object.detail_deform_examples_from_objects()
    bpy.ops.object.detail_deform_bind(wait=True)
    settings = ob.detail_deform
    settings.handles[0].target.location += Vector((-0.45, 0, 0.72))
    for method, name in (('TRANSFER', 'detail-transfer'), ('EXAMPLES', 'examples'),
                         ('VARIATIONAL', 'smooth-displacement'), ('NORMAL', 'normal-displacement'),
                         ('GRADIENT', 'gradient-editing'), ('VOLUMES', 'displacement-volumes')):
        settings.method = method
        update()
        bpy.ops.object.detail_deform_update()
        render(f'method-{name}.jpg')  # a render waits for slow results
    settings.method, settings.output = 'TRANSFER', 'BASE'
    update()
    render('method-preview.jpg')


def half_a_monkey():
    bpy.ops.mesh.primitive_monkey_add(calc_uvs=False)
    ob = bpy.context.object
    ob.modifiers.new("Subdivision", 'SUBSURF').levels = 2
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    positions = np.array([vertex.co for vertex in ob.data.vertices])
    faces = np.array([face.vertices for face in ob.data.polygons])
    kept = (positions[faces][:, :, 0] < 1e-5).all(1)
    used, corners = np.unique(faces[kept], return_inverse=True)
    bpy.data.objects.remove(ob)
    half = add("Half", positions[used], corners.reshape(-1, 4), (0.55, 0.70, 0.50, 1))
    half.modifiers.new("Mirror", 'MIRROR')
    group(half, "ear", positions[used][:, 0] < -1.15)
    return half


def order():
    """A mirrored half with Detail Deform before the Mirror modifier, and behind it."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'suzanne.blend'), load_ui=False)
    for ob in [ob for ob in bpy.data.objects if ob.type != 'CAMERA']:
        bpy.data.objects.remove(ob)
    ob = half_a_monkey()
    bpy.ops.object.detail_deform_handle_add(vertex_group="ear", align=False)
    bpy.ops.object.detail_deform_region_around(radius=0.9)
    bpy.ops.object.detail_deform_bind(wait=True)
    ob.detail_deform.handles[0].target.location += Vector((-0.55, 0, 0.6))
    look((0, -7.5, 0.9), (0, 0, 0.22), 72)
    update()
    render('order-right.jpg')
    bpy.ops.object.modifier_move_to_index(modifier="Detail Deform", index=1)
    update()
    render('order-wrong.jpg')


def expressions():
    """Two expressions that were saved one after the other, and both together."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'suzanne.blend'), load_ui=False)
    ob = activate(bpy.data.objects["Suzanne"])
    bpy.ops.object.detail_deform_bind(wait=True)
    look((-1.2, -7.0, 1.0), (-0.2, 0, 0.2), 72)
    handles = ob.detail_deform.handles
    moves = {"Ear": (0, Vector((-0.35, 0, 0.5)), 40), "Brow": (1, Vector((0, -0.08, 0.2)), -12)}
    for name, (number, move, degrees) in moves.items():
        target = handles[number].target
        place = target.matrix_world.copy()
        middle = Matrix.Translation(place.translation)
        target.matrix_world = (Matrix.Translation(move) @ middle @ Matrix.Rotation(np.radians(degrees), 4, 'Y')
                               @ middle.inverted() @ place)
        update()
        render(f'expression-{name.lower()}.jpg')
        bpy.ops.object.detail_deform_save_key(name=name)
    update()
    render('expression-rest.jpg')
    for name in moves:
        ob.data.shape_keys.key_blocks[name].value = 1
    update()
    render('expression-both.jpg')


def main():
    detail_deform.register()
    methods()
    order()
    expressions()
    detail_deform.unregister()


main()
