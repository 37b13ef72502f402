# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes creatures.jpg: a calf's poses carried over to a giraffe, and the calf posed by example.

blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_creatures.py
"""
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "addon"), str(Path(__file__).parent)]
import detail_deform  # noqa: E402
import studio  # noqa: E402
from detail_deform.scene import mesh_data  # noqa: E402
from detail_deform.setup import markers  # noqa: E402

FRAMES = (9, 17, 24)
SIZE = (480, 400)


def transferred():
    """The giraffe follows the calf."""
    bpy.context.view_layer.objects.active = bpy.data.objects["Giraffe"]
    bpy.ops.object.detail_deform_transfer_match()
    bpy.ops.object.detail_deform_transfer_live()
    for frame in (1, *FRAMES):
        bpy.context.scene.frame_set(frame)
        studio.look((6.4, -10.0, 3.2), (0.3, 1.0, 1.72), 77)
        yield studio.picture(SIZE)
    bpy.ops.object.detail_deform_transfer_live(on=False)


def posed():
    """The calf's own poses as examples, pulled by its hooves and its muzzle."""
    scene, calf = bpy.context.scene, bpy.data.objects["Calf"]
    bpy.data.objects["Giraffe"].hide_render = True
    examples = []
    for frame in FRAMES:
        scene.frame_set(frame)
        mesh = bpy.data.meshes.new_from_object(calf.evaluated_get(bpy.context.evaluated_depsgraph_get()))
        example = bpy.data.objects.new(f"Frame {frame}", mesh)
        scene.collection.objects.link(example)
        example.hide_render = True
        examples.append(example)
    scene.frame_set(1)
    calf.modifiers.remove(calf.modifiers["Armature"])
    for other in scene.objects:
        other.select_set(other in examples)
    bpy.context.view_layer.objects.active = calf
    settings = calf.detail_deform
    settings.method = "EXAMPLES"
    bpy.ops.object.detail_deform_examples_from_objects()
    points, targets = mesh_data.positions(calf.data), {}
    for name, marker in (("muzzle", 1), ("hoof L", 26), ("hoof R", 27), ("heel L", 36), ("heel R", 37)):
        near = np.linalg.norm(points - points[markers.of(calf)[marker]], axis=1) < 0.09
        calf.vertex_groups.new(name=name).add(np.flatnonzero(near).tolist(), 1.0, "REPLACE")
        bpy.ops.object.detail_deform_handle_add(vertex_group=name, align=False)
        targets[name] = settings.handles[-1].target
        targets[name].empty_display_size = 0.15
    bpy.context.view_layer.update()
    bpy.ops.object.detail_deform_bind(wait=True)
    for name, move in ((None, None), ("hoof L", (0.32, 0, 0.30)), ("muzzle", (-0.25, 0, -0.75)),
                       ("heel R", (-0.22, 0, 0.10))):
        if name:
            targets[name].location += Vector(move)
            bpy.context.view_layer.update()
        studio.look((2.5, -5.4, 2.0), (0.1, 0, 0.78), 68)
        yield studio.picture(SIZE)


def main():
    detail_deform.register()
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "blend_fixtures" / "creatures.blend"))
    rows = [list(make()) for make in (transferred, posed)]
    studio.save(studio.sheet(rows), Path(__file__).parent / "creatures.jpg")
    detail_deform.unregister()


main()
