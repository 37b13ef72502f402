# SPDX-License-Identifier: GPL-3.0-or-later
"""Times of scenes that are large otherwise than by one mesh: many objects, many handles, heavy binds.

    blender --background --factory-startup --python native/bench/scenes.py
    python native/bench/scenes.py                                             (bpy as a module)

Prints medians in ms: an update of a scene with 10,000 objects and a frame of its playback without and with the add-on,
nothing bound; Bind and a move with few and with many handles of one vertex each on 50,000 triangles; and what Bind and
Re-bind take from the press of the button on, over the library's bind alone, and over its bind and first update.
"""
import os
import statistics
import sys
import time
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
OBJECTS = 10_000
FEW, MANY, SIDE = 10, 271, 159
HEAVY = (201, 366)  # 40,401 and 133,956 vertices


def milliseconds(body):
    start = time.perf_counter()
    body()
    return 1e3 * (time.perf_counter() - start)


def machine():
    """The processor's name, where the system tells."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
        return next(line.split(':', 1)[1].strip() for line in lines if line.startswith('model name'))
    except (OSError, StopIteration):
        return "an unknown processor"


def empty_scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)


# Nothing bound

def idle(addon, rounds=15):
    empty_scene()
    mesh = bpy.data.meshes.new("Triangle")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    for number in range(OBJECTS):
        ob = bpy.data.objects.new(f"Object {number}", mesh.copy() if number % 10 == 0 else mesh)
        bpy.context.collection.objects.link(ob)
    moved = bpy.data.objects.new("Moved", None)
    bpy.context.collection.objects.link(moved)
    moved.keyframe_insert('location', frame=1)
    moved.location.x = 1
    moved.keyframe_insert('location', frame=100)

    def update():
        moved.location.y += 0.01
        return milliseconds(bpy.context.view_layer.update)

    def frame():
        return milliseconds(lambda: bpy.context.scene.frame_set(bpy.context.scene.frame_current % 99 + 1))

    times = {(what, on): [] for what in ("update", "frame") for on in (False, True)}
    for turn in range(2 * rounds + 2):  # by turns, so that a change of the machine's speed affects both; ends on
        on = bool(turn % 2)
        (addon.register if on else addon.unregister)()
        update(), frame()
        for what, body in (("update", update), ("frame", frame)):
            if turn > 1:
                times[what, on] += [body() for _ in range(3)]
    for what in ("update", "frame"):
        without, enabled = (statistics.median(times[what, on]) for on in (False, True))
        print(f"{OBJECTS:,} objects, nothing bound, a {what}: without the add-on {without:.2f}, with it {enabled:.2f}, "
              f"{enabled / without:.3f} x", flush=True)


# Handles

def bumpy_plane(side):
    """The bumpy plane of the library's benchmarks, with the same order of vertices; active."""
    x, y = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side), indexing='ij')
    away = ((x * 12 % 1 - 0.5) ** 2 + (y * 12 % 1 - 0.5) ** 2) / 0.45 ** 2
    z = np.where(away < 1, 0.0375 * (1 - away) ** 2, 0)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    triangles = np.concatenate([np.stack([corner, corner + side, corner + side + 1], 1),
                                np.stack([corner, corner + side + 1, corner + 1], 1)])
    mesh = bpy.data.meshes.new("Plane")
    mesh.from_pydata(np.stack([x, y, z], -1).reshape(-1, 3).tolist(), [], triangles.tolist())
    ob = bpy.data.objects.new("Plane", mesh)
    bpy.context.collection.objects.link(ob)
    bpy.context.view_layer.objects.active = ob
    ob.select_set(True)
    region = ob.vertex_groups.new(name="Region")
    region.add(range(5 * side, side * side), 1.0, 'REPLACE')
    ob.detail_deform.region = region.name
    return ob


def spread(side, count):
    """Vertices of the plane, spread evenly as in handles.cpp."""
    golden = 1.32471795724474602596
    steps = np.arange(1, count + 1)
    i = 8 + ((0.5 + steps / golden) % 1 * (side - 8)).astype(int)
    return (np.minimum(i, side - 1) * side + ((0.5 + steps / golden ** 2) % 1 * side).astype(int)).tolist()


def add_handles(ob, vertices):
    for vertex in vertices:
        group = ob.vertex_groups.new(name="Handle")
        group.add([vertex], 1.0, 'REPLACE')
        empty = bpy.data.objects.new(group.name, None)
        empty.location = ob.data.vertices[vertex].co
        bpy.context.collection.objects.link(empty)
        handle = ob.detail_deform.handles.add()
        handle.name = handle.vertex_group = group.name
        handle.target = empty
    bpy.context.view_layer.update()
    return [handle.target for handle in ob.detail_deform.handles]


def bind(ob):
    return milliseconds(lambda: bpy.ops.object.detail_deform_bind(wait=True))


def handles(rounds=15):
    found = {}
    for count in (FEW, MANY):
        empty_scene()
        ob = bumpy_plane(SIDE)
        empties = add_handles(ob, spread(SIDE, count))
        binds, moves, of_all = [], [], []
        for _ in range(3):
            ob.data.vertices[0].co.z += 1e-4  # changed content, so that it is bound anew
            binds.append(bind(ob))
        for number in range(rounds):
            empties[0].location.z = 0.01 * number
            moves.append(milliseconds(bpy.context.view_layer.update))
        for number in range(rounds):
            for k, empty in enumerate(empties):
                empty.location.z = 0.03 * np.sin(k + 0.1 * number)
            of_all.append(milliseconds(bpy.context.view_layer.update))
        found[count] = [statistics.median(times) for times in (binds, moves[2:], of_all[2:])]
        print(f"{len(ob.data.polygons):,} triangles, {count} handles: Bind {found[count][0]:.0f} (the library "
              f"{ob.detail_deform.bind_ms:.0f}), a move of one {found[count][1]:.1f}, of all {found[count][2]:.1f}",
              flush=True)
    print(f"{MANY} handles against {FEW}: " + ", ".join(
        f"{what} {many / few:.2f} x" for what, few, many in zip(("Bind", "a move of one", "of all"), *found.values())),
        flush=True)


def binds():
    for side in HEAVY:
        empty_scene()
        ob = bumpy_plane(side)
        add_handles(ob, [side * side - 1])
        whole, library, first, again = [], [], [], []
        for _ in range(5):
            ob.data.vertices[0].co.z += 1e-4  # changed content, so that it is bound anew
            whole.append(bind(ob))
            library.append(ob.detail_deform.bind_ms)
            first.append(library[-1] + ob.detail_deform.update_ms)
            again.append(milliseconds(lambda: bpy.ops.object.detail_deform_bind(wait=True, keep_rest=True)))
        whole, library, first, again = (statistics.median(times) for times in (whole, library, first, again))
        print(f"{len(ob.data.vertices):,} vertices: Bind {whole:.0f}, the library {library:.0f}, "
              f"{whole / library:.2f} x, with the first update {first:.0f}, {whole / first:.2f} x; bound again "
              f"unchanged {again:.0f}, {again / whole:.2f} x", flush=True)


def main():
    sys.path.insert(0, str(ROOT / 'addon'))
    import detail_deform

    print(f"Blender {bpy.app.version_string}, {machine()}, {os.cpu_count()} threads; medians in ms", flush=True)
    detail_deform.register()
    wanted = sys.argv[sys.argv.index('--') + 1:] if '--' in sys.argv else ['idle', 'handles', 'binds']
    if 'idle' in wanted:
        idle(detail_deform)
    if 'handles' in wanted:
        handles()
    if 'binds' in wanted:
        binds()
    detail_deform.unregister()


main()
