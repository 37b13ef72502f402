# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull in the hand, and the tool with the dots at the handles."""

import bpy
import numpy as np

from desk import (activate, area, call_pull, check, coordinates, held, in_hand, in_view, offsets, point_at, screenshot,
                  surface, wait_until, xdotool)


def pulling():
    """From Suzanne in a new scene to the first deformation, by keys."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    yield 1.0
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        bpy.context.active_object.modifiers.new("Subdivision", 'SUBSURF').levels = 3
        bpy.ops.object.modifier_apply(modifier="Subdivision")
        bpy.ops.view3d.view_selected()
    ob = bpy.context.active_object
    chosen = np.array([v.co.x > 1.1 for v in ob.data.vertices])
    ob.data.vertices.foreach_set('select', chosen)
    ob.data.edges.foreach_set('select', np.zeros(len(ob.data.edges), bool))
    ob.data.polygons.foreach_set('select', np.zeros(len(ob.data.polygons), bool))
    point_at('VIEW_3D')
    yield 0.3
    xdotool('key', 'Tab')
    yield 0.5
    yield from choosing_and_cancelling(ob)
    yield from call_pull()
    xdotool('key', '9')
    xdotool('key', 'BackSpace', '0', 'period', '6', 'Return')
    yield from wait_until(in_hand)
    yield 0.3
    for _ in range(2):
        xdotool('mousemove_relative', '--', 30, -30)
        yield 0.2
    screenshot('pull-in-hand')
    xdotool('click', 1)
    yield 0.3
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
    """The reach by the wheel and the mouse; what Esc leaves, and undo."""
    blocks = len(bpy.data.objects), len(bpy.data.collections), len(bpy.data.node_groups)
    yield from call_pull()
    for _ in range(10):
        xdotool('mousemove_relative', '--', 8, 0)
        yield 0.02
    yield 0.2
    screenshot('pull-choosing')
    for _ in range(4):
        xdotool('click', 5)  # the wheel, down
        yield 0.05
    yield 0.2
    screenshot('pull-choosing-less')
    xdotool('key', 'Escape')
    yield 0.3
    check("Esc while choosing leaves nothing behind", ob.mode == 'EDIT' and not ob.vertex_groups
          and (len(bpy.data.objects), len(bpy.data.collections), len(bpy.data.node_groups)) == blocks)
    sizes = []
    for clicks in (0, 4):
        yield from call_pull()
        for _ in range(clicks):
            xdotool('click', 4)
            yield 0.05
        xdotool('click', 1)
        yield from wait_until(in_hand)
        yield 0.3
        xdotool('mousemove_relative', '--', 40, 0)
        yield 0.2
        xdotool('click', 1)
        yield 0.3
        check("it is bound, in the hand, and moves", np.linalg.norm(offsets(), axis=1).max() > 0.02)
        sizes.append(region_of(surface()[0]).sum())
        xdotool('key', 'ctrl+z')
        yield 0.5
        check("undo takes the move back alone", surface()[0].detail_deform.is_bound and np.abs(offsets()).max() < 1e-6)
        xdotool('key', 'ctrl+z')
        yield 0.5
        found = bpy.context.active_object
        check("and then Pull", found.mode == 'EDIT' and not found.vertex_groups and len(bpy.data.objects) == blocks[0])
    check(f"the wheel makes the region larger, {sizes}", sizes[1] > 1.1 * sizes[0])


def drag(place, right, down):
    """From a place in the world, by pixels, with the left button."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    view, window = area('VIEW_3D'), bpy.context.window_manager.windows[0]
    region = next(r for r in view.regions if r.type == 'WINDOW')
    at = location_3d_to_region_2d(region, view.spaces.active.region_3d, place)
    xdotool('mousemove', int(region.x + at.x), int(window.height - region.y - at.y))
    yield 0.4
    xdotool('mousedown', 1)
    yield 0.2
    for _ in range(8):
        xdotool('mousemove_relative', '--', right // 8, down // 8)
        yield 0.03
    yield 0.2
    screenshot('by_hand')
    xdotool('mouseup', 1)
    yield 0.5


def by_hand():
    """The tool in Edit Mode's toolbar, and the dots at the handles."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    yield 1.0
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        bpy.ops.view3d.view_axis(type='FRONT')
        bpy.ops.view3d.view_selected()
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='DESELECT')
        bpy.ops.wm.tool_set_by_id(name='detail_deform.pull')
    yield 0.5
    ob = bpy.context.active_object
    brow = max(ob.data.vertices, key=lambda v: v.co.z - v.co.y).co.copy()
    ob.update_from_editmode()
    yield from drag(brow + type(brow)((-2, 0, 0)), 300, 150)  # from where nothing is
    ob = bpy.context.active_object
    ob.update_from_editmode()
    check("the tool selects by a box where nothing is", any(v.select for v in ob.data.vertices)
          and not ob.detail_deform.handles)
    with in_view():
        bpy.ops.mesh.select_all(action='DESELECT')
    yield from drag(brow, 80, -80)
    check("the tool pulls a vertex by one drag", surface()[1].location.z > brow.z + 0.1
          and np.abs(offsets()).max() > 0.1)
    check("which ends as the button is let go", bpy.context.active_object == surface()[1])
    moved = surface()[1].location.copy()
    xdotool('mousemove_relative', '--', -100, 50)
    yield 0.3
    check("and follows the mouse no more", surface()[1].location == moved)
    xdotool('key', 'ctrl+z')
    yield 0.5
    ob = bpy.data.objects["Suzanne"]
    check("one step of undo takes it back", not ob.detail_deform.handles and ob.mode == 'EDIT')
    xdotool('key', 'ctrl+shift+z')
    yield 0.5
    ob, empty = surface()
    check("and redo brings it again", np.abs(offsets()).max() > 0.1 and empty.location == moved)
    activate(ob)
    yield 0.5
    yield from drag(moved, -80, 40)
    ob, empty = surface()
    check("a dot at the handle is dragged while the mesh is active", bpy.context.active_object == empty
          and empty.location.x < moved.x - 0.1)
    check("and the surface follows", np.allclose(offsets()[held()], empty.location - brow, atol=1e-4))
    with in_view():
        bpy.ops.wm.tool_set_by_id(name='builtin.select_box')
