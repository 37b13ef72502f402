# SPDX-License-Identifier: GPL-3.0-or-later
"""What a handle's move costs in Blender, and how much of it is the library.

    blender --background --factory-startup --python native/bench/live_update.py
    python native/bench/live_update.py          (bpy as a module)

Opens blend_fixtures/bumpy_plane.blend (80,000 triangles), lifts its handle in steps and prints
medians: the whole of view_layer.update(), the library's call in it, and the rest, which is the
add-on's own work and Blender's evaluation of the modifier.
"""
import statistics
import sys
import time
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[2]
STEPS = 60


def main():
    sys.path.insert(0, str(ROOT / 'addon'))
    import detail_deform
    from detail_deform import native

    detail_deform.register()
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'bumpy_plane.blend'), load_ui=False)
    ob, empty = bpy.data.objects['Bumpy Plane'], bpy.data.objects['Right']
    bpy.context.view_layer.objects.active = ob
    bpy.ops.object.detail_deform_bind(wait=True)

    inside = []
    compute = native.Deformer.offsets

    def timed(self, *arguments):
        start = time.perf_counter()
        result = compute(self, *arguments)
        inside.append(1e3 * (time.perf_counter() - start))
        return result

    native.Deformer.offsets = timed
    whole = []
    for step in range(STEPS):
        empty.location.z = 0.3 * (step + 1) / STEPS
        start = time.perf_counter()
        bpy.context.view_layer.update()
        whole.append(1e3 * (time.perf_counter() - start))
    native.Deformer.offsets = compute
    assert len(inside) == STEPS, "an update was missed"

    rest = [total - library for total, library in zip(whole, inside)]
    print(f"Blender {bpy.app.version_string}, {STEPS} moves, median ms: whole {statistics.median(whole):.2f}, "
          f"library {statistics.median(inside):.2f}, add-on and Blender {statistics.median(rest):.2f}")
    detail_deform.unregister()


main()
