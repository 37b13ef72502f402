# SPDX-License-Identifier: GPL-3.0-or-later
"""A file with a handle: opened, its problem vertices selected, bound, dragged, undone and reopened."""

import bmesh
import bpy
import numpy as np
from mathutils import Vector

from desk import (OUT, ROOT, activate, area, check, expect, held, in_view, is_drawn, offsets, point_at, screenshot,
                  settle, show_modifiers, surface, wait_until, xdotool)


def opening():
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'bumpy_plane.blend'), load_ui=False)
    yield from settle()
    show_modifiers(surface()[0])
    yield from settle()
    panel = area('PROPERTIES')
    # Clicks on the panel's header, below the editor's own header and the list of modifiers.
    xdotool('mousemove', panel.x + 60, bpy.context.window_manager.windows[0].height - panel.y - panel.height + 118,
            'click', 1)
    yield from settle()
    check("the panel is opened by a click on its header", (yield from is_drawn('OBJECT_PT_detail_deform')))
    screenshot('unbound')


def selecting_problems():
    """Select Problem Vertices selects the vertices of a sentence and moves the view to them; undo."""
    ob, _ = surface()
    for vertex in (7, 9):
        ob.data.vertices[vertex].co.z = float('nan')
    ob.data.update()
    with in_view():
        bpy.ops.object.detail_deform_bind()
    yield from wait_until(lambda: ob.detail_deform.problem)
    check("a refusal from the background is in the panel", "Vertex 7 " in ob.detail_deform.status)
    yield from settle()
    screenshot('refused')
    yield from select_problems()
    check("all that it is about is selected", selected() == [7, 9])
    xdotool('key', 'ctrl+z')
    yield from expect("undo leaves Edit Mode again", lambda: surface()[0].mode == 'OBJECT')
    yield from settle()
    ob, _ = surface()
    for vertex in (7, 9):
        ob.data.vertices[vertex].co.z = 0
    ob.data.vertices.add(2)
    count = len(ob.data.vertices)
    for vertex in (count - 2, count - 1):
        ob.data.vertices[vertex].co = (5, 5, 5)
    ob.data.update()
    ob.vertex_groups[ob.detail_deform.region].add([count - 2, count - 1], 1, 'REPLACE')
    with in_view():
        bpy.ops.object.detail_deform_bind(wait=True)
    yield from select_problems()
    check("so is what the status warns of", selected() == [count - 2, count - 1])
    place = area('VIEW_3D').spaces.active.region_3d.view_location
    check("and in the middle of the view", (place - surface()[0].matrix_world @ Vector((5, 5, 5))).length < 1e-3)
    bpy.ops.object.mode_set(mode='OBJECT')
    yield from settle()
    screenshot('warned')
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'bumpy_plane.blend'), load_ui=False)
    yield from settle()
    activate(surface()[0])
    with in_view():
        bpy.ops.view3d.view_all()


def select_problems():
    point_at('VIEW_3D')
    with in_view():
        bpy.ops.ed.undo_push(message="Before")
        bpy.ops.object.detail_deform_select_problem('INVOKE_DEFAULT', True)
    yield from settle()


def selected():
    found = bmesh.from_edit_mesh(surface()[0].data)
    return [vertex.index for vertex in found.verts if vertex.select]


def binding():
    with in_view():
        bpy.ops.object.detail_deform_bind()
    yield from expect("a bind in the background ends with the surface bound",
                      lambda: surface()[0].detail_deform.is_bound)
    yield from settle()
    screenshot('bound')


def is_whole():
    """Whether the displayed result is the final one, which no slower result will replace."""
    from detail_deform.follow import frame_results
    return frame_results.by(surface()[0].data).is_final


def dragging():
    _, empty = surface()
    activate(empty)
    height, followed = empty.location.z, []
    members = held()
    point_at('VIEW_3D')
    yield from settle()
    xdotool('key', 'g')
    yield from settle()
    xdotool('key', 'z')
    for _ in range(20):
        xdotool('mousemove_relative', '--', 0, -6)
        yield 0.02
        _, empty = surface()
        followed.append((empty.location.z - height, offsets()[members][0, 2]))
    xdotool('key', 'Return')
    yield from settle()
    moved, shown = np.array(followed).T
    check("a drag moves the empty in many steps", len(set(np.round(moved, 6))) > 10 and moved[-1] > 0.05)
    check("the surface follows at every step", np.abs(moved - shown).max() < 1e-5)
    _, empty = surface()
    yield from wait_until(is_whole)  # on a busy machine a drag shows a quick result
    check("and stays when the drag ends", np.allclose(offsets()[members], (0, 0, empty.location.z - height), atol=1e-5))
    surface()[0].detail_deform.preview = True
    activate(surface()[0])
    yield from settle()
    screenshot('dragged')
    surface()[0].detail_deform.preview = False


def undoing():
    before = offsets()
    point_at('VIEW_3D')
    yield from settle()
    activate(surface()[1])
    bpy.ops.ed.undo_push(message="Selected")
    yield from settle()
    for _ in range(2):  # the selection, then the drag
        xdotool('key', 'ctrl+z')
        yield from settle()
    yield from expect("undo takes a drag back", lambda: np.abs(offsets()).max() < 1e-6)
    for _ in range(2):
        xdotool('key', 'ctrl+shift+z')
        yield from settle()
    yield from expect("redo brings it again", lambda: np.abs(offsets() - before).max() < 1e-6)
    check("and it is bound", surface()[0].detail_deform.is_bound)


def reopening():
    from detail_deform.follow import auto_bind
    before, path = offsets(), str(OUT / 'posed.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    yield from settle()
    check("a reopened file shows what was saved", np.abs(offsets() - before).max() < 1e-6)
    _, empty = surface()
    empty.location.z += 0.1
    yield from wait_until(lambda: surface()[0].detail_deform.is_bound)
    yield from settle()
    check("binds by itself when a handle moves, and follows",
          np.allclose((offsets() - before)[held()], (0, 0, 0.1), atol=1e-5))
    ob, _ = surface()
    ob.detail_deform.auto_bind = False
    ob.data.vertices[0].co.z += 0.5
    ob.data.update()
    yield from expect("an edit of the mesh is noticed", lambda: "were moved since Bind" in ob.detail_deform.status)
    activate(ob)
    yield from settle()
    screenshot('stale')
    ob.detail_deform.auto_bind = True
    auto_bind._LIMIT_SECONDS = 60  # so that binding isn't taken for slow on a busy machine
    ob.data.vertices[0].co.z -= 0.1
    ob.data.update()
    bound_to = ob.detail_deform.signature
    yield from expect("and it is bound again by itself",
                      lambda: ob.detail_deform.is_bound and ob.detail_deform.signature != bound_to)
    yield from settle()
    check("with its pose", np.allclose((offsets() - before)[held()], (0, 0, 0.1), atol=1e-5))
