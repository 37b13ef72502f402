# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes addon/manual/gallop.jpg: a horse's gallop in six phases, and a camel that follows it by three markers.

blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_gallop.py
"""
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / 'addon'), str(Path(__file__).parent)]
import animals  # noqa: E402
import detail_deform  # noqa: E402
import studio  # noqa: E402
from detail_deform.scene import mesh_data  # noqa: E402

# Places of the horse's markers and of the camel's: the muzzle, the tail's end, the left forefoot.
MARKERS = (((1.60, 0, 1.43), (1.90, 0, 2.05)), ((-1.01, 0, 0.49), (-0.84, 0, 0.79)),
           ((0.59, .17, 0.02), (0.62, .17, 0.03)))
SPACING = 2.70
SIZE = (1600, 290)
TURN = 0.50  # of each animal about the vertical, towards the camera, in radians


def shape(ob):
    return mesh_data.positions(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data)


def line_up(ob, poses):
    """Copies of an animal in its poses, beside one another, each at its phase's height over the ground."""
    turn = np.array(Matrix.Rotation(-TURN, 3, 'Z'))
    for k, points in enumerate(poses):
        points = points - [*(points.min(0) + np.ptp(points, axis=0) / 2)[:2], points[:, 2].min()]
        points[:, 2] += animals.swings(k / animals.PHASES)[1]
        copy = ob.data.copy()
        copy.vertices.foreach_set('co', np.float32(points @ turn.T).ravel())
        copy.update()
        one = bpy.data.objects.new(f"{ob.name} {k + 1}", copy)
        one.location.x = (k - (len(poses) - 1) / 2) * SPACING
        bpy.context.scene.collection.objects.link(one)
        yield one


def main():
    detail_deform.register()
    studio.prepare()
    horse, camel = animals.add_horse(), animals.add_camel()
    for ob, places in zip((horse, camel), zip(*MARKERS)):
        studio.add_markers(ob, places)
        print(f"{ob.name}: {len(ob.data.vertices)} vertices, {len(mesh_data.triangles(ob.data))} triangles")
    animals.add_gallop(horse)
    bpy.context.scene.frame_set(0)
    poses = {horse: [], camel: []}
    studio.activate(camel)
    bpy.ops.object.detail_deform_transfer_match(source=horse.name)
    bpy.ops.object.detail_deform_transfer_live(source=horse.name)
    for frame in range(1, animals.PHASES + 1):
        bpy.context.scene.frame_set(frame)
        for ob, found in poses.items():
            found.append(shape(ob))
    bpy.ops.object.detail_deform_transfer_live(on=False)
    studio.add_floor()
    studio.add_light("Key", (-7, -9, 11), (0, 0, 1), 5, 2100, (1, 0.95, 0.88))
    studio.add_light("Fill", (10, -9, 4), (0, 0, 1), 8, 260, (0.85, 0.92, 1), False)
    studio.add_light("Rim", (3, 11, 9), (0, 0, 1.2), 8, 1300, shadow=False)
    rows = []
    for ob, found in poses.items():
        horse.hide_render = camel.hide_render = True
        copies = list(line_up(ob, found))
        high = 1.02 if ob == horse else 1.12
        studio.look((0, -60, 9), (0, 0, high), 128)
        rows.append([studio.on_paper(studio.picture(SIZE))])
        for copy in copies:
            bpy.data.objects.remove(copy)
    studio.save(studio.sheet(rows), ROOT / 'addon' / 'manual' / 'gallop.jpg')
    detail_deform.unregister()


main()
