# SPDX-License-Identifier: GPL-3.0-or-later
"""Large meshes and scenes: a draft while a dense mesh is being bound, and bound objects among ten thousand others."""

import bpy
import numpy as np

from desk import (OUT, ROOT, activate, check, coordinates, evaluated, expect, in_view, point_at, screenshot, settle,
                  surface, wait_until, xdotool)


def heavy_plane(side=330):
    """(object, empty): a bumpy plane, by default dense enough for a draft, with a fixed left edge and a handle at the
    right one."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'bumpy_plane.blend'), load_ui=False)
    for ob in list(bpy.data.objects):
        bpy.data.objects.remove(ob)
    with in_view():
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=side - 1, y_subdivisions=side - 1, size=2)
    ob = bpy.context.view_layer.objects.active
    places = coordinates(ob.data)
    places[:, 2] = 0.03 * np.sin(40 * places[:, 0]) * np.cos(31 * places[:, 1])
    ob.data.vertices.foreach_set('co', places.astype(np.float32).ravel())
    for name, chosen in (('region', places[:, 0] > -0.9), ('right', places[:, 0] > 0.9)):
        ob.vertex_groups.new(name=name).add(np.flatnonzero(chosen).tolist(), 1.0, 'REPLACE')
    empty = bpy.data.objects.new("Right", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.location.x = 1
    ob.detail_deform.region = 'region'
    handle = ob.detail_deform.handles.add()
    handle.name = handle.vertex_group = 'right'
    handle.target = empty
    activate(ob)
    return ob, empty


def drafting():
    """Drags a handle while a dense mesh is being bound; the bind seems to be running until the drag has ended."""
    from detail_deform.follow import frame_results
    from detail_deform.library import native
    ob, empty = heavy_plane()
    progress = native.Bind.progress
    native.Bind.progress = lambda bind: (True, *progress(bind)[1:])
    yield from settle()
    with in_view():
        bpy.ops.view3d.view_selected()
        bpy.ops.object.detail_deform_bind()

    def shows_draft():
        record = frame_results.by(ob.data)
        return record is not None and record.is_draft

    yield from expect("a draft is there before a heavy mesh is bound",
                      lambda: shows_draft() and not ob.detail_deform.is_bound)
    activate(empty)
    point_at('VIEW_3D')
    xdotool('key', 'g')
    yield from settle()
    xdotool('key', 'z')
    followed = []
    for _ in range(8):
        xdotool('mousemove_relative', '--', 0, -12)
        yield 0.02
        followed.append((empty.location.z, evaluated(ob)[-1, 2] - coordinates(ob.data)[-1, 2], shows_draft()))
    xdotool('key', 'Return')
    yield from settle()
    moved, seen, drafts = np.array(followed).T
    check("a drag is followed by the draft", drafts.all() and moved[-1] > 0.05 and np.abs(moved - seen).max() < 1e-5)
    draft = evaluated(ob)
    check("which is shown as one", "a draft follows" in ob.detail_deform.status)
    activate(ob)
    yield from settle()
    screenshot('draft')
    native.Bind.progress = progress
    yield from wait_until(lambda: ob.detail_deform.is_bound)
    yield from settle()
    check("until the result takes its place", ob.detail_deform.is_bound and frame_results.by(ob.data).is_final)
    difference = np.abs(evaluated(ob) - draft).max()
    check(f"which is near ({difference:.5f})", 0 < difference < 0.02)
    screenshot('after_draft')


def keeping_track():
    """Bound objects are copied, renamed, deleted, brought back by undo and appended among ten thousand others, and
    still follow their handles."""
    ob, empty = heavy_plane(60)
    pebble = bpy.data.meshes.new("Pebble")
    pebble.from_pydata([(0, 0, 0), (0.02, 0, 0), (0, 0.02, 0)], [], [(0, 1, 2)])
    for number in range(10000):
        other = bpy.data.objects.new(f"Pebble {number}", pebble)
        other.location = (number % 100 / 20 - 2.5, number // 100 / 20 - 2.5, -0.5)
        bpy.context.scene.collection.objects.link(other)
    yield from settle()
    with in_view():
        bpy.ops.view3d.view_all()
        bpy.ops.object.detail_deform_bind()
    yield from wait_until(lambda: ob.detail_deform.is_bound)
    bpy.ops.ed.undo_push(message="Bound")

    def bound():
        return [o for o in bpy.data.objects if o.type == 'MESH' and o.detail_deform.handles]

    def follow(count):
        """Moves all handles; whether there are `count` bound meshes and all of them follow."""
        meshes = bound()
        before = [evaluated(ob)[-1, 2] for ob in meshes]
        for ob in meshes:
            ob.detail_deform.handles[0].target.location.z += 0.1

        def moved():
            return [abs(evaluated(ob)[-1, 2] - height - 0.1) < 1e-5 for ob, height in zip(meshes, before)]

        yield from wait_until(lambda: all(moved()))
        # Every motion by a user ends with an undo step. Undoing changes without one, 4.3 and 5.2 don't evaluate them.
        bpy.ops.ed.undo_push(message="Moved")
        return moved() == count * [True]

    def press(*keys):
        point_at('VIEW_3D')
        for key in keys:
            xdotool('key', key)
            yield from settle()

    check("among ten thousand objects it follows", (yield from follow(1)))
    screenshot('among_many')
    ob, empty = surface()
    activate(ob)
    empty.select_set(True)
    bpy.ops.ed.undo_push(message="Selected")
    yield from settle()
    yield from press('shift+d', 'Return')
    check("so does a copy with a handle of its own", (yield from follow(2)) and
          len({o.detail_deform.handles[0].target.name for o in bound()}) == 2)
    screenshot('copied')
    bound()[1].name = "Another name"
    bpy.ops.ed.undo_push(message="Renamed")
    yield from settle()
    check("and under another name", (yield from follow(2)))
    activate(bound()[0])
    bpy.ops.ed.undo_push(message="Selected")
    yield from settle()
    yield from press('x', 'Return')
    yield from wait_until(lambda: len(bound()) == 1)
    check("one is deleted, the other follows", (yield from follow(1)))
    yield from press('ctrl+z', 'ctrl+z')  # the motion, then the deletion
    yield from wait_until(lambda: len(bound()) == 2)
    check("undo brings it back, and both follow", (yield from follow(2)))
    path = str(OUT / 'pair.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'bumpy_plane.blend'), load_ui=False)
    yield from settle()
    for name in [o.name for o in bound()]:
        bpy.data.objects.remove(bpy.data.objects[name])
    bpy.ops.wm.append(directory=path + '/Object/', filename="Another name")
    yield from settle()
    check("appended to another file, it follows", (yield from follow(1)))
    activate(bound()[0])
    yield from settle()
    screenshot('appended')
