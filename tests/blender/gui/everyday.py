# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull on posed meshes, in Local View, inside another pull, across a symmetry plane and on loose parts; a deleted
empty, an edited cage, and a plate that is painted rigid."""

import bpy
import numpy as np

from curves import tentacle
from desk import (activate, area, check, coordinates, evaluated, expect, in_hand, in_view, new_scene, offsets, point_at,
                  screenshot, settle, show_modifiers, surface, wait_until, xdotool)


def select(ob, chosen):
    """Selects vertices and enters Edit Mode. chosen: (n,) bool."""
    with in_view():
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='DESELECT')
        bpy.ops.object.mode_set(mode='OBJECT')
        ob.data.vertices.foreach_set('select', chosen)
        bpy.ops.object.mode_set(mode='EDIT')


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
    """Pulls the tip of a mesh that a modifier poses, in Local View."""
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
    xdotool('key', 'Escape')  # ends the move by the mouse
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
    """Deletes an empty by the key X; the panel's button brings it back."""
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
    """A small pull inside a large one moves the vertices that were coloured, and no others."""
    yield from new_scene()
    with in_view():
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=60, y_subdivisions=60)
        bpy.ops.view3d.view_axis(type='TOP')
        bpy.ops.view3d.view_selected()
    ob = bpy.context.active_object
    p = coordinates(ob.data)
    select(ob, np.linalg.norm(p[:, :2], axis=1) < 0.15)
    with in_view():
        bpy.ops.object.detail_deform_pull(radius=0.8)
        activate(ob)
    select(ob, np.linalg.norm(p[:, :2] - (0.45, 0), axis=1) < 0.06)
    point_at('VIEW_3D')
    yield from settle()
    with in_view():
        bpy.ops.object.detail_deform_pull('INVOKE_DEFAULT')
    xdotool('key', '0', 'period', '4')
    yield from settle()
    xdotool('key', 's')  # the key for the falloff, without effect here: a shared reach keeps its falloff
    yield from settle()
    screenshot('inside-shared')  # the whole region, as it reaches the other handle
    xdotool('key', 'BackSpace', '1', '5', 's', 's')
    yield from settle()
    screenshot('inside-choosing')
    xdotool('key', 'Return')
    yield from wait_until(in_hand)
    yield from settle()
    xdotool('key', 'Escape')  # ends the move by the mouse
    yield from settle()
    ob, _ = surface()
    check("the second pull has a reach of its own", ob.detail_deform.handles[1].reach == "Reach")
    check("and the falloff that was chosen", ob.detail_deform.handles[1].falloff == 'SHARP'
          and ob.detail_deform.smoothness == 2)
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


def pulling_across_the_middle():
    """With X symmetry, pulls vertices on the plane and on one side of it, aside and up."""
    yield from new_scene()
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        bpy.ops.view3d.view_axis(type='FRONT')
        bpy.ops.view3d.view_selected()
    ob = bpy.context.active_object
    p = coordinates(ob.data)
    ob.data.use_mirror_x = True
    select(ob, (p[:, 2] < -0.7) & (p[:, 0] > -1e-3))
    point_at('VIEW_3D')
    yield from settle()
    with in_view():
        bpy.ops.object.detail_deform_pull('INVOKE_DEFAULT')
    xdotool('key', 'Return')
    yield from wait_until(in_hand)
    yield from settle()
    for _ in range(3):
        xdotool('mousemove_relative', '--', 25, 25)
        yield from settle()
    xdotool('click', 1)
    yield from expect("a pull across the middle moves", lambda: np.abs(offsets()).max() > 0.1)
    screenshot('middle')
    from detail_deform.scene import components, mesh_data
    parts = components.labels(len(p), mesh_data.edges(surface()[0].data))
    is_eye = parts != parts[p[:, 2].argmin()]  # eyes have vertices at the same places as their sockets
    image = (np.linalg.norm(p[:, None] * (-1, 1, 1) - p, axis=2) + (is_eye[:, None] != is_eye)).argmin(1)
    moved = offsets()
    check("both sides alike", np.abs(moved[image] * (-1, 1, 1) - moved).max() < 1e-4)


def pulling_a_whole_part():
    """A pull that moves a whole loose part rigidly is reported."""
    yield from new_scene()
    with in_view():
        bpy.ops.mesh.primitive_uv_sphere_add(location=(3, 0, 0))
        bpy.ops.mesh.primitive_uv_sphere_add()
        bpy.context.view_layer.objects[0].select_set(True)
        bpy.ops.object.join()
    ob = bpy.context.active_object
    p = coordinates(ob.data)
    select(ob, (p[:, 2] > 0.9) & (np.abs(p[:, 0] - p[:, 0].max()) < 1.2))
    with in_view():
        bpy.ops.object.detail_deform_pull(radius=9.0)
        activate(ob)
    yield from settle()
    show_modifiers(ob)
    yield from settle()
    screenshot('whole-part')
    check("a reach that holds a whole part says so", "hold all of the loose part" in ob.detail_deform.status)


def editing_a_cage():
    """Edits a cage by G in Edit Mode: the surface follows, and Re-bind keeps its shape."""
    yield from new_scene()
    with in_view():
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=30, y_subdivisions=30)
        ob = bpy.context.active_object
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=6, y_subdivisions=6)
    cage = bpy.context.active_object
    ob.detail_deform.base, ob.detail_deform.base_object = 'OBJECT', cage
    activate(ob)
    yield from settle()
    with in_view():
        bpy.ops.object.detail_deform_bind(keep_rest=False)
    yield from wait_until(lambda: ob.detail_deform.is_bound)
    activate(cage)
    select(cage, np.linalg.norm(coordinates(cage.data), axis=1) < 0.5)
    point_at('VIEW_3D')
    yield from settle()
    xdotool('key', 'g', 'z', '0', 'period', '5', 'Return')
    yield from settle()
    xdotool('key', 'Tab')
    lifted = lambda: max(v.vector[2] for v in ob.data.attributes['detail_deform_offset'].data)  # noqa: E731
    yield from expect("an edit of the cage deforms", lambda: cage.mode == 'OBJECT' and lifted() > 0.2)
    screenshot('cage-edited')
    activate(ob)
    with in_view():
        bpy.ops.object.detail_deform_bind(keep_rest=True)
    yield from expect("and a new bind keeps it", lambda: ob.detail_deform.is_bound and lifted() > 0.2)


def off_rigid(ob, part):
    """How far these vertices are off the rigid motion that fits them best, as a fraction of their largest extent."""
    rest, now = coordinates(ob.data)[part], evaluated(ob)[part]
    a, b = rest - rest.mean(axis=0), now - now.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    u[:, 2] *= np.linalg.det(u @ v)
    return np.linalg.norm(a @ (u @ v) - b, axis=1).max() / np.ptp(rest, axis=0).max()


def stiffening():
    """Bends a limb, makes a plate on it rigid by a vertex group, and repaints that in Weight Paint mode: it is bound
    again by itself, in the same pose."""
    yield from new_scene()
    ob = tentacle()
    activate(ob)
    x, y, z = coordinates(ob.data).T
    plate = np.flatnonzero((np.abs(x - 1.8) < 0.4) & (np.abs(np.arctan2(y, -z)) < 1.2))
    select(ob, x > 3.7)
    with in_view():
        bpy.ops.object.detail_deform_pull('EXEC_DEFAULT', radius=3.2)
        bpy.ops.view3d.view_axis(type='FRONT')
    ob, empty = surface()
    empty.rotation_euler.y += 1.5
    empty.location.x, empty.location.z = 2.4, -1.9
    yield from settle()
    check("a plate bends with its limb", off_rigid(ob, plate) > 0.02)
    place = evaluated(ob)[x > 3.7]
    ob.vertex_groups.new(name="Armour").add(plate.tolist(), 1.0, 'REPLACE')
    ob.detail_deform.stiff_parts = "Armour"
    yield from expect("bound again by itself, it is rigid", lambda: ob.detail_deform.is_bound
                      and off_rigid(ob, plate) < 1e-3)
    check("and the handle is where it was", np.abs(evaluated(ob)[x > 3.7] - place).max() < 1e-3)
    activate(ob)
    yield from settle()
    show_modifiers(ob)
    with in_view():
        bpy.ops.view3d.view_selected()
        bpy.ops.object.mode_set(mode='WEIGHT_PAINT')
    ob.vertex_groups.active_index = ob.vertex_groups["Armour"].index
    yield from settle()
    screenshot('stiff-parts')
    ob.vertex_groups["Armour"].add(plate.tolist(), 0.25, 'REPLACE')
    ob.data.update()
    yield from expect("with less weight it bends a little", lambda: ob.detail_deform.is_bound
                      and 2e-3 < off_rigid(ob, plate) < 0.06)
    with in_view():
        bpy.ops.object.mode_set(mode='OBJECT')
