# SPDX-License-Identifier: GPL-3.0-or-later
"""Times of a handle's move and of a frame of an animation in Blender, and the library's share of them.

    blender --background --factory-startup --python native/bench/live_update.py
    python native/bench/live_update.py                                        (bpy as a module)
    xvfb-run blender --factory-startup --python native/bench/live_update.py   (with its window)

Opens blend_fixtures/bumpy_plane.blend (80,000 triangles), lifts its handle in steps, without and with
refinement, then plays blend_fixtures/animated.blend (33,374 triangles), and prints medians: the whole of
the update, the library's call in it, and the rest, which is the add-on's own work and Blender's evaluation
of the modifier. With a window, also what drawing it takes.
"""
import contextlib
import statistics
import sys
import time
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[2]
STEPS = 60


class Stopwatch:
    """Times a step of Blender's, and the library's calls within."""

    def __init__(self, native):
        self._native, self._compute = native, native.Deformer.offsets
        self.whole, self.library, self.drawing = [], [], []

    def __enter__(self):
        def timed(deformer, *arguments, **look):
            start = time.perf_counter()
            result = self._compute(deformer, *arguments, **look)
            self.library.append(1e3 * (time.perf_counter() - start))
            return result

        self._native.Deformer.offsets = timed
        return self

    def __exit__(self, *_):
        self._native.Deformer.offsets = self._compute

    def step(self, body):
        start = time.perf_counter()
        body()
        self.whole.append(1e3 * (time.perf_counter() - start))
        if not bpy.app.background:
            start = time.perf_counter()
            bpy.ops.wm.redraw_timer(type='DRAW_WIN_SWAP', iterations=1)
            self.drawing.append(1e3 * (time.perf_counter() - start))

    def report(self, what):
        assert len(self.library) == len(self.whole), "an update was missed, or made twice"
        rest = [whole - library for whole, library in zip(self.whole, self.library)]
        drawn = f", drawing {statistics.median(self.drawing):.2f}" if self.drawing else ""
        print(f"Blender {bpy.app.version_string}, {len(self.whole)} {what}, median ms: "
              f"whole {statistics.median(self.whole):.2f}, library {statistics.median(self.library):.2f}, "
              f"add-on and Blender {statistics.median(rest):.2f}{drawn}", flush=True)


def in_window():
    """A context with a window: a timer has none, and opening a file replaces it."""
    if bpy.app.background:
        return contextlib.nullcontext()
    return bpy.context.temp_override(window=bpy.context.window_manager.windows[0])


def open_bound(name):
    with in_window():
        bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / f'{name}.blend'), load_ui=False)
    with in_window():
        ob = next(ob for ob in bpy.data.objects if ob.type == 'MESH')
        bpy.context.view_layer.objects.active = ob
        bpy.ops.object.detail_deform_bind(wait=True)
    return ob


def moves(native):
    ob = open_bound('bumpy_plane')
    empty = bpy.data.objects['Right']
    with in_window():
        move(native, ob, empty)


def move(native, ob, empty):
    for refine in (0, 4):
        ob.detail_deform.refine = refine
        empty.location.z = -0.01
        bpy.context.view_layer.update()  # the first update by a method prepares it
        with Stopwatch(native) as watch:
            for step in range(STEPS):
                empty.location.z = 0.3 * (step + 1) / STEPS
                watch.step(bpy.context.view_layer.update)
        watch.report(f"moves, refine {refine}")


def playback(native):
    open_bound('animated')
    scene = bpy.context.scene
    scene.frame_set(scene.frame_start)
    with in_window(), Stopwatch(native) as watch:
        for frame in range(scene.frame_start + 1, scene.frame_end + 1):
            watch.step(lambda at=frame: scene.frame_set(at))
    watch.report("frames")


def main():
    sys.path.insert(0, str(ROOT / 'addon'))
    import detail_deform
    from detail_deform.library import native

    detail_deform.register()
    moves(native)
    playback(native)
    detail_deform.unregister()
    if not bpy.app.background:
        # Not at once: the window of this call went with the file that was open then.
        bpy.app.timers.register(lambda: bpy.ops.wm.quit_blender() and None)


if bpy.app.background:
    main()
else:
    bpy.app.timers.register(main, first_interval=1.0)
