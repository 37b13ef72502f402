# SPDX-License-Identifier: GPL-3.0-or-later
"""What a handle's move costs in Blender, and how much of it is the library.

    blender --background --factory-startup --python native/bench/live_update.py
    python native/bench/live_update.py          (bpy as a module)

Opens blend_fixtures/bumpy_plane.blend (80,000 triangles), lifts its handle in steps, without and with
refinement, and prints medians: the whole of view_layer.update(), the library's call in it, and the rest, which is the
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

    def timed(self, *arguments, **look):
        start = time.perf_counter()
        result = compute(self, *arguments, **look)
        inside.append(1e3 * (time.perf_counter() - start))
        return result

    native.Deformer.offsets = timed
    for refine in (0, 4):
        ob.detail_deform.refine = refine
        inside.clear()
        whole = []
        for step in range(STEPS):
            empty.location.z = 0.3 * (step + 1) / STEPS
            start = time.perf_counter()
            bpy.context.view_layer.update()
            whole.append(1e3 * (time.perf_counter() - start))
        assert len(inside) == STEPS, "an update was missed"
        rest = [total - library for total, library in zip(whole, inside)]
        print(f"Blender {bpy.app.version_string}, {STEPS} moves, refine {refine}, median ms: "
              f"whole {statistics.median(whole):.2f}, library {statistics.median(inside):.2f}, "
              f"add-on and Blender {statistics.median(rest):.2f}")
    native.Deformer.offsets = compute
    detail_deform.unregister()


main()
