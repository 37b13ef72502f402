# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens around a pull: another pose, a local view, a deleted empty, a split mesh."""

import bpy
import numpy as np

from desk import (activate, area, check, evaluated, expect, in_hand, in_view, new_scene, offsets, point_at, screenshot,
                  settle, show_modifiers, surface, wait_until, xdotool)


def posed_limb():
    """A tube along z, bent over by a Simple Deform, its tip selected in Edit Mode."""
    with in_view():
        bpy.ops.mesh.primitive_cylinder_add(vertices=24, radius=0.3, depth=3, location=(0, 0, 1.5))
        bpy.ops.object.transform_apply(location=True)
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='SELECT')
        bpy.ops.mesh.subdivide(number_cuts=5)
        bpy.ops.mesh.select_all(action='DESELECT')
        bpy.ops.object.mode_set(mode='OBJECT')
    ob = bpy.context.active_object
    ob.name = "Limb"
    bend = ob.modifiers.new("Bend", 'SIMPLE_DEFORM')
    bend.deform_method, bend.deform_axis, bend.angle = 'BEND', 'X', 1.5
    tip = np.array([v.co.z > 2.7 for v in ob.data.vertices])
    ob.data.vertices.foreach_set('select', tip)
    with in_view():
        bpy.ops.view3d.view_axis(type='RIGHT')
        bpy.ops.view3d.view_selected()
        bpy.ops.object.mode_set(mode='EDIT')
    return ob, tip


def tip_in_world(ob, tip):
    world = np.array(ob.matrix_world)
    return (evaluated(ob)[tip] @ world[:3, :3].T + world[:3, 3]).mean(axis=0)


def pulling_what_is_posed():
    """In a local view."""
    yield from new_scene()
    ob, tip = posed_limb()
    with in_view():
        bpy.ops.object.mode_set(mode='OBJECT')
        seen = tip_in_world(ob, tip)
        bpy.ops.view3d.localview(frame_selected=True)
        bpy.ops.object.mode_set(mode='EDIT')
    point_at('VIEW_3D')
    yield from settle()
    with in_view():
        bpy.ops.object.detail_deform_pull('INVOKE_DEFAULT')
    yield from settle()
    screenshot('posed-choosing')
    xdotool('key', 'Return')
    yield from wait_until(in_hand)
    yield from settle()
    ob, empty = surface()
    space = area('VIEW_3D').spaces.active
    seen_there = empty.evaluated_get(bpy.context.evaluated_depsgraph_get()).visible_in_viewport_get(space)
    check("in Local View the empty is there, too", space.local_view and seen_there)
    xdotool('key', 'Escape')  # what has it go with the mouse
    yield from settle()
    place = np.array(empty.matrix_world.translation)
    check("the empty stands on what is seen", np.linalg.norm(place - seen) < 0.02)
    empty.location.z += 0.3
    yield from expect("and pulls the way it is moved",
                      lambda: np.abs(tip_in_world(ob, tip) - seen - (0, 0, 0.3)).max() < 0.1)
    screenshot('posed-pulled')
    activate(ob)
    with in_view():
        bpy.ops.object.mode_set(mode='EDIT')
    yield from settle()
    screenshot('posed-on-cage')
    modifier = next(m for m in ob.modifiers if m.type == 'NODES')
    check("Edit Mode's cage is what is pulled", modifier.show_on_cage)
    with in_view():
        bpy.ops.object.mode_set(mode='OBJECT')
        bpy.ops.view3d.localview()


def deleting_an_empty():
    """By its key, as a user does; the panel brings it back."""
    ob, empty = surface()
    with in_view():
        activate(ob)
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='DESELECT')
        bpy.ops.object.mode_set(mode='OBJECT')
    shown = offsets().copy()
    activate(empty)
    point_at('VIEW_3D')
    yield from settle()
    xdotool('key', 'x')
    yield from settle()
    xdotool('key', 'Return')
    yield from expect("the empty is deleted", lambda: empty.name not in bpy.context.view_layer.objects)
    ob = bpy.data.objects["Limb"]
    activate(ob)
    yield from settle()
    show_modifiers(ob)
    yield from settle()
    screenshot('empty-deleted')
    check("which is said", "lost their empties" in ob.detail_deform.status)
    check("and what it holds stays", np.abs(offsets() - shown).max() < 1e-5)
    with in_view():
        bpy.ops.object.detail_deform_bring_back()
    there = bpy.context.view_layer.objects
    yield from expect("it comes back", lambda: surface()[1] is not None and surface()[1].name in there
                      and "lost" not in ob.detail_deform.status)
    screenshot('empty-back')


def pulling_inside():
    """A small pull inside a large one: what is coloured is what moves."""
    yield from new_scene()
    with in_view():
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=60, y_subdivisions=60)
        bpy.ops.view3d.view_axis(type='TOP')
        bpy.ops.view3d.view_selected()
    ob = bpy.context.active_object
    p = np.array([v.co for v in ob.data.vertices])

    def select(x, radius):
        with in_view():
            bpy.ops.mesh.select_all(action='DESELECT')
            bpy.ops.object.mode_set(mode='OBJECT')
            ob.data.vertices.foreach_set('select', np.linalg.norm(p[:, :2] - (x, 0), axis=1) < radius)
            bpy.ops.object.mode_set(mode='EDIT')

    with in_view():
        bpy.ops.object.mode_set(mode='EDIT')
    select(0.0, 0.15)
    with in_view():
        bpy.ops.object.detail_deform_pull(radius=0.8)
        activate(ob)
        bpy.ops.object.mode_set(mode='EDIT')
    select(0.45, 0.06)
    point_at('VIEW_3D')
    yield from settle()
    with in_view():
        bpy.ops.object.detail_deform_pull('INVOKE_DEFAULT')
    xdotool('key', '0', 'period', '4')
    yield from settle()
    screenshot('inside-shared')  # the whole region, as it reaches the other handle
    xdotool('key', 'BackSpace', '1', '5')
    yield from settle()
    screenshot('inside-choosing')
    xdotool('key', 'Return')
    yield from wait_until(in_hand)
    yield from settle()
    xdotool('key', 'Escape')  # what has it go with the mouse
    yield from settle()
    ob, _ = surface()
    check("the second pull has a reach of its own", ob.detail_deform.handles[1].reach == "Reach")
    bpy.context.active_object.location.z += 0.3
    yield from expect("and moves it", lambda: np.abs(offsets()).max() > 0.29)
    away = np.linalg.norm(p[:, :2] - (0.45, 0), axis=1)
    moved = np.abs(offsets()).max(axis=1)
    check("to its circle and no farther", moved[away > 0.06 + 0.15 + 0.05].max() == 0 and (moved > 0).sum() > 50)
    activate(ob)
    yield from settle()
    show_modifiers(ob)
    yield from settle()
    screenshot('inside-pulled')
