# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes addon/manual/rig.jpg: a calf as its armature poses it; by examples of two other frames, pulled by handles that
six of its bones carry; and with the example that Find Missing lists first. Red are vertices that lie 5% of the calf's
size and more from where the armature has them.

blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_rig.py
"""
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "addon"), str(Path(__file__).parent)]
import detail_deform  # noqa: E402
import studio  # noqa: E402
from detail_deform.scene import mesh_data  # noqa: E402
from detail_deform.setup import markers  # noqa: E402

FRAMES = (6, 13, 21)  # not among the examples
SIZE = (400, 300)
WORST = 0.05  # error, as a fraction of the calf's box, that is shown in full red
HANDLES = (("muzzle", 1, "head - muzzle"), ("hoof L", 26, "fetlock.L - hoof.L"), ("hoof R", 27, "fetlock.R - hoof.R"),
           ("heel L", 36, "pastern.L - heel.L"), ("heel R", 37, "pastern.R - heel.R"), ("rump", None, "rump - belly"))


def shape(ob):
    return mesh_data.positions(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data)


def add_handles(calf, rig):
    points, settings = mesh_data.positions(calf.data), calf.detail_deform
    for name, marker, bone in HANDLES:
        centre = points[markers.of(calf)[marker]] if marker else np.array(rig.data.bones[bone].head_local)
        far = np.linalg.norm(points - centre, axis=1)
        near = far < (0.09 if marker else far.min() + 0.05)
        calf.vertex_groups.new(name=name).add(np.flatnonzero(near).tolist(), 1.0, "REPLACE")
        empty = bpy.data.objects.new(name, None)
        bpy.context.scene.collection.objects.link(empty)
        empty.parent, empty.parent_type, empty.parent_bone = rig, "BONE", bone
        bpy.context.view_layer.update()
        empty.matrix_world = Matrix.Translation(points[near].mean(axis=0))
        handle = settings.handles.add()
        handle.name, handle.vertex_group, handle.target = name, name, empty
    bpy.context.view_layer.update()


def colour(calf, errors):
    """Grey where there is no error, red where it is WORST and more."""
    share = np.clip(errors / WORST, 0, 1)[:, None]
    studio.colour(calf.data, (1 - share) * np.float32([0.6, 0.6, 0.6]) + share * np.float32([0.9, 0.05, 0.02]))


def main():
    detail_deform.register()
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "blend_fixtures" / "creatures.blend"))
    scene, calf, rig = bpy.context.scene, bpy.data.objects["Calf"], bpy.data.objects["Calf Rig"]
    bpy.data.objects["Giraffe"].hide_render = True
    scene.display.shading.color_type = "VERTEX"
    bpy.context.view_layer.objects.active = calf
    settings, size = calf.detail_deform, np.linalg.norm(np.ptp(mesh_data.positions(calf.data), axis=0))
    rig.data.pose_position = "REST"
    add_handles(calf, rig)
    rig.data.pose_position = "POSE"
    studio.look((2.5, -5.4, 2.0), (0.1, 0, 0.78), 70)
    rows, truths = [[]], {}
    colour(calf, np.zeros(len(calf.data.vertices)))
    for frame in FRAMES:
        scene.frame_set(frame)
        truths[frame] = shape(calf)
        rows[0].append(studio.picture(SIZE))
    scene.frame_set(1)
    settings.method = "EXAMPLES"
    bpy.ops.object.detail_deform_examples_from_poses(frames="RANGE", step=8)
    bpy.context.view_layer.update()
    bpy.ops.object.detail_deform_bind(wait=True)
    for is_complete in (False, True):
        rows.append([])
        for frame in FRAMES:
            scene.frame_set(frame)
            errors = np.linalg.norm(shape(calf) - truths[frame], axis=1) / size
            print(f"Frame {frame} by", ", ".join(f"{e.found_weight:.2f} of {e.name}" for e in settings.examples),
                  f"- mean error {100 * errors.mean():.2f}%, largest {100 * errors.max():.2f}% of the calf's size")
            colour(calf, errors)
            bpy.context.view_layer.update()
            rows[-1].append(studio.picture(SIZE))
        if not is_complete:
            bpy.ops.object.detail_deform_examples_find_missing(frames="RANGE")
            bpy.ops.object.detail_deform_example_add_missing()
    studio.save(studio.sheet(rows), ROOT / "addon" / "manual" / "rig.jpg")
    detail_deform.unregister()


main()
