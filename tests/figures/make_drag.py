# SPDX-License-Identifier: GPL-3.0-or-later
"""The animated picture of a drag in the README: Suzanne's ear and brow pulled by their empties.

    blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_drag.py

Writes drag.gif beside this file. Needs a release build and ImageMagick's convert.
"""
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import bpy
from mathutils import Matrix

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "addon"))

FRAMES = 26


def show(empty):
    """Adds three rods along an empty's axes, as renders leave empties out."""
    mesh = bpy.data.meshes.new("Axes")
    size = empty.empty_display_size
    corners, faces, colours = [], [], []
    for axis in range(3):
        thin = [0.03 * size] * 3
        thin[axis] = 0.0
        for end in (0.0, size):
            for signs in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner, rest = [0.0] * 3, iter(signs)
                for k in range(3):
                    corner[k] = end if k == axis else next(rest) * thin[k]
                corners.append(corner)
        first = 8 * axis
        faces += [[first + (k + j) % 4 + h for j, h in ((0, 0), (1, 0), (1, 4), (0, 4))] for k in range(4)]
        faces.append([first + 4 + k for k in range(4)])
        colours += [axis] * 5
    mesh.from_pydata(corners, [], faces)
    for colour in ((0.9, 0.15, 0.15, 1), (0.25, 0.7, 0.1, 1), (0.15, 0.35, 0.95, 1)):
        material = bpy.data.materials.new("Axis")
        material.diffuse_color = colour
        mesh.materials.append(material)
    mesh.polygons.foreach_set('material_index', colours)
    rods = bpy.data.objects.new("Axes", mesh)
    bpy.context.scene.collection.objects.link(rods)
    rods.parent = empty


def main():
    import detail_deform
    detail_deform.register()
    bpy.ops.wm.open_mainfile(filepath=str(HERE.parents[1] / "blend_fixtures" / "suzanne.blend"), load_ui=False)
    ob = bpy.data.objects["Suzanne"]
    bpy.context.view_layer.objects.active = ob
    bpy.context.view_layer.update()
    bpy.ops.object.detail_deform_bind(wait=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 400, 320
    scene.display.shading.color_type = 'MATERIAL'
    handles = {handle.name: handle.target for handle in ob.detail_deform.handles}
    rest = {name: target.matrix_world.copy() for name, target in handles.items()}
    for target in handles.values():
        show(target)
    with tempfile.TemporaryDirectory() as folder:
        for frame in range(FRAMES):
            there = math.sin(math.pi * frame / FRAMES) ** 2
            for name, (shift, turn) in {"Ear": ((-0.45, -0.1, 0.6), 0.9), "Brow": ((0, -0.15, 0.25), -0.3)}.items():
                start = rest[name].translation
                motion = Matrix.Translation([there * s for s in shift]) @ Matrix.Translation(start) @ Matrix.Rotation(
                    there * turn, 4, 'Y') @ Matrix.Translation(-start)
                handles[name].matrix_world = motion @ rest[name]
            bpy.context.view_layer.update()
            scene.render.filepath = f"{folder}/{frame:03d}.png"
            bpy.ops.render.render(write_still=True)
        subprocess.run(['convert', '-delay', '7', '-loop', '0', f"{folder}/*.png", '-colors', '96', '-layers',
                        'Optimize', str(HERE / "drag.gif")], check=True)
    detail_deform.unregister()


main()
