# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull by keys and mouse, the tool Pull, and the dots at the handles."""

import bpy
import numpy as np

from desk import (activate, area, call_pull, check, coordinates, expect, held, in_hand, in_view, new_scene, offsets,
                  point_at, screenshot, settle, surface, wait_until, xdotool)


def pulling():
    """From Suzanne in a new scene to the first deformation, by keys."""
    yield from new_scene()
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        bpy.context.active_object.modifiers.new("Subdivision", 'SUBSURF').levels = 2
        bpy.ops.object.modifier_apply(modifier="Subdivision")
        bpy.ops.view3d.view_selected()
    ob = bpy.context.active_object
    chosen = np.array([v.co.x > 1.1 for v in ob.data.vertices])
    ob.data.vertices.foreach_set('select', chosen)
    ob.data.edges.foreach_set('select', np.zeros(len(ob.data.edges), bool))
    ob.data.polygons.foreach_set('select', np.zeros(len(ob.data.polygons), bool))
    point_at('VIEW_3D')
    yield from settle()
    xdotool('key', 'Tab')
    yield from settle()
    yield from choosing_and_cancelling(ob)
    yield from call_pull()
    xdotool('key', '9')
    xdotool('key', 'BackSpace', '0', 'period', '6', 'Return')
    yield from wait_until(in_hand)
    yield from settle()
    for _ in range(2):
        xdotool('mousemove_relative', '--', 30, -30)
        yield from settle()
    screenshot('pull-in-hand')
    xdotool('click', 1)
    yield from settle()
    reached = region_of(surface()[0])
    low = coordinates(surface()[0].data)[chosen, 0].min()
    edge = coordinates(surface()[0].data)[reached, 0].min()
    check("the reach that was typed is that of the region", low - 0.6 <= edge < low - 0.2)
    lengths = np.linalg.norm(offsets(), axis=1)
    check("Pull, a click and a move of the mouse deform Suzanne", lengths[chosen].min() > 0.05)
    check("around her ear only", not lengths[[v.co.x < 0 for v in surface()[0].data.vertices]].any())
    screenshot('pulled')


def region_of(ob):
    index = ob.vertex_groups["Region"].index
    return np.array([any(g.group == index for g in v.groups) for v in ob.data.vertices])


def choosing_and_cancelling(ob):
    """Chooses the reach by the mouse and the wheel, cancels by Esc, and undoes."""
    blocks = len(bpy.data.objects), len(bpy.data.collections), len(bpy.data.node_groups)
    yield from call_pull()
    for _ in range(10):
        xdotool('mousemove_relative', '--', 8, 0)
        yield 0.02
    yield from settle()
    screenshot('pull-choosing')
    for _ in range(4):
        xdotool('click', 5)  # the wheel, down
        yield 0.05
    yield from settle()
    screenshot('pull-choosing-less')
    xdotool('key', 'Escape')
    yield from settle()
    check("Esc while choosing leaves nothing behind", ob.mode == 'EDIT' and not ob.vertex_groups
          and (len(bpy.data.objects), len(bpy.data.collections), len(bpy.data.node_groups)) == blocks)
    sizes = []
    view, window = area('VIEW_3D'), bpy.context.window_manager.windows[0]
    middle = view.x + view.width // 2, window.height - view.y - view.height // 2
    for clicks, from_a_menu in ((0, False), (4, False), (0, True)):
        start = (yield from mouse_in_corner()) if from_a_menu else middle
        yield from call_pull()
        for k in range(1, 21 if from_a_menu else 1):
            xdotool('mousemove', *(int(a + (b - a) * k / 20) for a, b in zip(start, middle)))
            yield 0.02
        for _ in range(clicks):
            xdotool('click', 4)
            yield 0.05
        xdotool('key', 'Return')
        yield from wait_until(in_hand)
        yield from settle()
        xdotool('mousemove_relative', '--', 40, 0)
        yield from settle()
        xdotool('click', 1)
        yield from settle()
        yield from expect("it is bound, in the hand, and moves",
                          lambda: np.linalg.norm(offsets(), axis=1).max() > 0.02)
        sizes.append(int(region_of(surface()[0]).sum()))
        xdotool('key', 'ctrl+z')
        yield from expect("undo takes the move back alone",
                          lambda: surface()[0].detail_deform.is_bound and np.abs(offsets()).max() < 1e-6)
        xdotool('key', 'ctrl+z')
        yield from expect("and then Pull", lambda: was_undone(blocks))
    check(f"the wheel makes the region larger, {sizes}", sizes[1] > 1.1 * sizes[0])
    check("the reach is not spent on the way back from a menu", sizes[2] > 0.5 * sizes[0])


def mouse_in_corner():
    """Moves the mouse to a corner of the view, where a menu could have been; returns its place."""
    view, window = area('VIEW_3D'), bpy.context.window_manager.windows[0]
    region = next(r for r in view.regions if r.type == 'WINDOW')
    at = region.x + region.width - 60, window.height - region.y - 60
    xdotool('mousemove', *at)
    yield from settle()
    return at


def was_undone(blocks):
    found = bpy.context.active_object
    return found.mode == 'EDIT' and not found.vertex_groups and len(bpy.data.objects) == blocks[0]


def drag(name, place, right, down, before_release=()):
    """Drags with the left button from a place in the world, by pixels. name: of the screenshot before the release.
    before_release: [(key or button, how often)] of xdotool's, pressed before that."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    view, window = area('VIEW_3D'), bpy.context.window_manager.windows[0]
    region = next(r for r in view.regions if r.type == 'WINDOW')
    at = location_3d_to_region_2d(region, view.spaces.active.region_3d, place)
    xdotool('mousemove', int(region.x + at.x), int(window.height - region.y - at.y))
    yield from settle()
    xdotool('mousedown', 1)
    yield from settle()
    for _ in range(8):
        xdotool('mousemove_relative', '--', right // 8, down // 8)
        yield 0.03
    yield from settle()
    for what, times in before_release:
        for _ in range(times):
            xdotool('click' if isinstance(what, int) else 'key', what)
            yield 0.05
    yield from settle()
    screenshot(name)
    xdotool('mouseup', 1)
    yield from settle()


def show_tool(name='tool'):
    """Scrolls the toolbar to its end, which is below the window's edge, and takes a screenshot."""
    view, window = area('VIEW_3D'), bpy.context.window_manager.windows[0]
    region = next(r for r in view.regions if r.type == 'TOOLS')
    xdotool('mousemove', region.x + region.width // 3, window.height - region.y - region.height // 2)
    for _ in range(15):
        xdotool('click', 5)  # the wheel, down
        yield 0.02
    yield from settle()
    screenshot(name)


def suzanne():
    return bpy.data.objects["Suzanne"]


def by_hand():
    """The tool in Edit Mode's toolbar, and the dots at the handles."""
    yield from new_scene()
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        bpy.ops.view3d.view_axis(type='FRONT')
        bpy.ops.view3d.view_selected()
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='DESELECT')
        bpy.ops.wm.tool_set_by_id(name='detail_deform.pull')
    yield from settle()
    yield from show_tool()
    ob = bpy.context.active_object
    brow = max(ob.data.vertices, key=lambda v: v.co.z - v.co.y).co.copy()
    ob.update_from_editmode()
    yield from drag('by_hand-box', brow + type(brow)((-2, 0, 0)), 300, 150)  # from an empty place
    ob = bpy.context.active_object
    ob.update_from_editmode()
    check("the tool selects by a box where nothing is", any(v.select for v in ob.data.vertices)
          and not ob.detail_deform.handles)
    with in_view():
        bpy.ops.mesh.select_all(action='DESELECT')
    yield from drag('by_hand-pull', brow, 80, -80)
    yield from expect("the tool pulls a vertex by one drag", lambda: suzanne().detail_deform.handles
                      and surface()[1].location.z > brow.z + 0.1 and np.abs(offsets()).max() > 0.1)
    yield from expect("which ends as the button is let go, in Edit Mode as it began",
                      lambda: bpy.context.mode == 'EDIT_MESH' and bpy.context.active_object == suzanne())
    screenshot('by_hand-again')
    moved = surface()[1].location.copy()
    xdotool('mousemove_relative', '--', -100, 50)
    yield from settle()
    check("and follows the mouse no more", surface()[1].location == moved)
    xdotool('key', 'ctrl+z')
    yield from expect("undo takes back that it is edited again", lambda: suzanne().mode == 'OBJECT')
    yield from settle()
    xdotool('key', 'ctrl+z')
    yield from expect("and one more step the pull", lambda: not suzanne().detail_deform.handles
                      and suzanne().mode == 'EDIT')
    yield from settle()
    xdotool('key', 'ctrl+shift+z')
    yield from expect("redo brings it again", lambda: suzanne().detail_deform.handles
                      and np.abs(offsets()).max() > 0.1 and surface()[1].location == moved)
    xdotool('key', 'ctrl+shift+z')
    yield from expect("in Edit Mode", lambda: suzanne().mode == 'EDIT')
    ear = max(suzanne().data.vertices, key=lambda v: v.co.x).co.copy()
    yield from drag('by_hand-second', ear, 80, 0)
    yield from expect("the next vertex is pulled by one more drag", lambda: len(suzanne().detail_deform.handles) == 2
                      and suzanne().mode == 'EDIT' and np.abs(offsets()).max() > 0.1)
    yield from settle()
    second = suzanne().detail_deform.handles[1].target.location.copy()
    yield from drag('by_hand-dot-edit', second, 40, 40)
    yield from expect("and a dot is dragged in Edit Mode", lambda: suzanne().mode == 'EDIT' and (
        suzanne().detail_deform.handles[1].target.location - second).length > 0.05)
    activate(suzanne())
    with in_view():
        bpy.ops.object.mode_set(mode='OBJECT')
    yield from settle()
    screenshot('dots')
    yield from drag('by_hand-dot', moved, -80, 40)
    ob, empty = surface()
    check("a dot at the handle is dragged while the mesh is active", bpy.context.active_object == empty
          and empty.location.x < moved.x - 0.1)
    check("and the surface follows", np.allclose(offsets()[held()], empty.location - brow, atol=1e-4))
    with in_view():
        bpy.ops.wm.tool_set_by_id(name='builtin.select_box')
