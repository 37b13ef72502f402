# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions, renders and baked files."""

import threading
import time
from pathlib import Path

import bmesh
import bpy
import numpy as np

from desk import (EEVEE, OUT, activate, area, call_pull, check, click_button, coordinates, expect, in_hand, in_view,
                  is_drawn, new_scene, point_at, screenshot, settle, show_modifiers, show_sidebar, surface, wait_until,
                  xdotool)


def saved(ob):
    return ob.data.shape_keys and ob.data.shape_keys.key_blocks.get("Expression")


def expressing():
    """From Suzanne to a symmetric expression saved as a shape key, counting the user's actions."""
    yield from new_scene()
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        bpy.ops.view3d.view_selected()
    ob = bpy.context.active_object
    ob.modifiers.new("Subdivision", 'SUBSURF').levels = 2
    chosen = np.array([v.co.x > 1.2 for v in ob.data.vertices])
    point_at('VIEW_3D')
    yield from settle()
    show_modifiers(ob)
    actions = 0

    def done(count=1):
        nonlocal actions
        actions += count
        yield from settle()

    xdotool('key', 'Tab')
    yield from done()
    ob.data.use_mirror_x = True  # X among the symmetry buttons in the header
    yield from done()
    mesh = bmesh.from_edit_mesh(ob.data)
    for vertex in mesh.verts:
        vertex.select_set(bool(chosen[vertex.index]))
    bmesh.update_edit_mesh(ob.data)
    yield from done()  # a click with the circle
    yield from call_pull()
    yield from done(2)  # right click, and the entry
    xdotool('click', 1)  # the reach
    yield from wait_until(in_hand)
    yield from done()
    for _ in range(2):
        xdotool('mousemove_relative', '--', 25, -35)
        yield from settle()
    xdotool('click', 1)
    yield from done()
    ob, empty = surface()
    places = coordinates(ob.data)
    image = np.linalg.norm(places[:, None] * (-1, 1, 1) - places, axis=2).argmin(1)
    moved = np.array([v.vector for v in ob.data.attributes['detail_deform_offset'].data])
    check("both of her ears move", np.linalg.norm(moved[chosen], axis=1).min() > 0.05)
    check("as mirror images", np.abs(moved[image] * (-1, 1, 1) - moved).max() < 1e-4)
    check("before her subdivision", ob.modifiers[0].name == "Detail Deform")
    in_object = yield from is_drawn('OBJECT_PT_detail_deform_empty')
    in_modifiers = yield from is_drawn('OBJECT_PT_detail_deform_empty_modifiers')
    check("the empty's panel is in the tab that Blender goes to from her modifiers", in_object != in_modifiers)
    yield from show_sidebar('VIEW3D_PT_detail_deform')
    yield from done(2)  # N, and the tab
    screenshot('expression')
    yield from click_button(117, 'object.detail_deform_save_key')
    yield from done()
    yield from expect("the expression is a shape key", lambda: saved(ob) is not None and saved(ob).value == 0)
    key = saved(ob)
    check("and the face is at rest, still bound", ob.detail_deform.is_bound and not np.abs(
        [v.vector for v in ob.data.attributes['detail_deform_offset'].data]).max() > 1e-6)
    check(f"in {actions} actions, at most 10", actions <= 10)
    key.value = 1
    xdotool('mousemove', 400, 400)
    yield from settle()
    screenshot('expression-saved')
    check("the empty is active", bpy.context.active_object == empty)
    yield from expressing_again(ob)
    area('VIEW_3D').spaces.active.show_region_ui = False
    yield from settle()


def expressing_again(ob):
    """A second expression with another handle, made and saved without leaving Edit Mode."""
    others = {handle.name for handle in ob.detail_deform.handles}
    saved(ob).value = 0
    xdotool('key', 'Tab')
    yield from settle()
    check("Tab goes from the empty to the Edit Mode of its mesh",
          bpy.context.active_object == ob and ob.mode == 'EDIT')
    mesh = bmesh.from_edit_mesh(ob.data)
    for vertex in mesh.verts:
        vertex.select_set(vertex.co.z > 0.9)
    bmesh.update_edit_mesh(ob.data)
    point_at('VIEW_3D')
    yield from settle()
    yield from call_pull()
    xdotool('key', 'Tab')
    yield from settle()
    screenshot('expression-stay')
    xdotool('click', 1)
    yield from wait_until(in_hand)
    yield from settle()
    xdotool('mousemove_relative', '--', 0, -40)
    yield from settle()
    xdotool('click', 1)
    yield from expect("with Tab while the reach is chosen, Pull ends in Edit Mode",
                      lambda: ob.mode == 'EDIT' and bpy.context.active_object == ob)
    check("and has pulled", len({handle.name for handle in ob.detail_deform.handles} - others) == 1)
    yield from settle()
    screenshot('expression-in-edit-mode')
    count = len(ob.data.shape_keys.key_blocks)
    with in_view():
        bpy.ops.object.detail_deform_save_key('INVOKE_DEFAULT')
    yield from settle()
    check("which is saved from there", len(ob.data.shape_keys.key_blocks) == count + 1)
    check("and edited on", ob.mode == 'EDIT')
    xdotool('key', 'Tab')
    yield from expect("until Tab", lambda: ob.mode == 'OBJECT')
    last = ob.data.shape_keys.key_blocks[-1]
    moved = np.array([a.co - b.co for a, b in zip(last.data, ob.data.shape_keys.key_blocks[0].data)])
    below = [v.co.z < -0.03 for v in ob.data.vertices]  # her eyes, which ride along, begin at -0.0234
    check("it holds what was pulled alone", np.abs(moved).max() > 0.05 and last.value == 0
          and not np.abs(moved[below]).any())


def draw_slowly(header, context):
    """What another add-on draws: meanwhile Blender 3.4 forbids any handler to write, those of a render too; 5.2.2
    only those of the drawing's own thread."""
    if not forbidden:
        writer = threading.Thread(target=lambda: forbidden.append(not may_write(context.scene)))
        writer.start()
        writer.join()
    time.sleep(0.03)  # lets the render's thread run


def may_write(scene):
    try:
        scene['written'] = 0
    except AttributeError:
        return False
    return True


def count_calls(scene, depsgraph):
    """A handler that writes: calls_begun has more than calls_ended where the drawing forbade it."""
    calls_begun.append(scene.frame_current)
    scene['written'] = scene.frame_current
    calls_ended.append(scene.frame_current)


calls_begun, calls_ended = [], []
forbidden = []  # once it was drawn, whether meanwhile other threads may not write


def redraw_header():
    for region in area('VIEW_3D').regions:
        region.tag_redraw()
    return 0.005


def rendering():
    """Renders from the window, where frames are evaluated in another thread, with and without a locked interface; while
    it isn't locked, beside a header that is nearly always being drawn."""
    scene = bpy.context.scene
    bpy.context.preferences.view.render_display_type = 'NONE'
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.location, camera.rotation_euler = (0, -7, 1), (1.45, 0, 0)
    scene.camera = camera
    scene.render.engine = 'BLENDER_WORKBENCH'
    scene.render.resolution_x, scene.render.resolution_y = 120, 90
    scene.frame_start, scene.frame_end = 1, 4
    ob, empty = surface()
    empty.keyframe_insert('location', frame=1)
    empty.location.z += 1
    empty.keyframe_insert('location', frame=4)
    pictures = {}
    from detail_deform.scene import render_thread
    counter = render_thread.repeated(count_calls)
    bpy.app.handlers.frame_change_post.insert(0, counter)  # the add-on's own waits until the window has drawn
    bpy.types.VIEW3D_HT_header.append(draw_slowly)
    bpy.app.timers.register(redraw_header)
    yield from settle()
    for lock in (False, True):
        scene.render.use_lock_interface = lock
        scene.render.filepath = str(OUT / f'lock_{lock}_')
        for _ in range(10):  # until one of them met a drawing, which is a matter of luck
            with in_view():
                bpy.ops.render.render('INVOKE_DEFAULT', animation=True)
            yield from settle()
            yield from wait_until(lambda: not bpy.app.is_job_running('RENDER'))
            if lock or not forbidden[0] or len(calls_begun) > len(calls_ended):
                break
        check("what an unlocked window risks is said", ("Lock Interface" in ob.detail_deform.status) == (not lock))
        pictures[lock] = [np.array(bpy.data.images.load(f'{scene.render.filepath}{frame:04d}.png').pixels[:])
                          for frame in range(1, 5)]
        if not lock:
            bpy.app.timers.unregister(redraw_header)
            bpy.types.VIEW3D_HT_header.remove(draw_slowly)
            bpy.app.handlers.frame_change_post.remove(counter)
            check("the drawing has forbidden a frame to write, which was repeated, where it can",
                  (len(calls_begun) > len(calls_ended)) == forbidden[0] and {*calls_ended} == {1, 2, 3, 4})
    changes = [np.abs(b - a).mean() for a, b in zip(pictures[False], pictures[False][1:])]
    check("every rendered frame shows its own pose", min(changes) > 1e-3)
    check("with the interface locked the same", all(
        np.abs(a - b).max() < 0.02 for a, b in zip(pictures[False], pictures[True])))
    eevee = []
    scene.render.engine, scene.eevee.taa_render_samples = EEVEE, 1
    scene.render.resolution_x, scene.render.resolution_y = 60, 45
    scene.render.film_transparent = True
    for frame in (1, 4):
        scene.frame_set(frame)
        scene.render.filepath = str(OUT / f'eevee_{frame}.png')
        with in_view():
            bpy.ops.render.render(write_still=True)
        yield from settle()
        eevee.append(np.array(bpy.data.images.load(scene.render.filepath).pixels[:]).reshape(-1, 4)[:, 3])
    check("EEVEE shows each frame's pose", min(a.sum() for a in eevee) > 100 and np.abs(eevee[1] - eevee[0]).sum() > 5)
    empty.animation_data_clear()


def baking():
    scene = bpy.context.scene
    activate(surface()[0])
    path = OUT / 'pulled.pc2'
    for key, last in (('Escape', 5000), (None, 40)):
        scene.frame_end = last
        point_at('VIEW_3D')
        yield from settle()
        with in_view():
            bpy.ops.object.detail_deform_bake('INVOKE_DEFAULT', filepath=str(path))
        yield from settle()
        screenshot('bake')
        xdotool('key', 'Return')
        yield 0.15
        if key:
            xdotool('key', key)
        else:
            yield from wait_until(path.exists)
        yield from settle()
        if not key:
            check("a bake in the window plays its cache", path.exists()
                  and 'Detail Deform Cache' in surface()[0].modifiers)
        else:
            check("Esc leaves nothing behind", not path.exists() and not Path(f'{path}.unfinished').exists())
    yield from settle()
    screenshot('baked')
