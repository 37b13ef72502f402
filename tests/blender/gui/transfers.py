# SPDX-License-Identifier: GPL-3.0-or-later
"""Live transfer by markers, and transfer of shape keys to many targets."""

import bpy
import numpy as np

from desk import (ROOT, activate, area, check, coordinates, evaluated, expect, in_view, is_drawn, new_scene,
                  point_at, screenshot, settle, show_modifiers, wait_until, xdotool)

# Both panels' headers in the maximized editor while the first panel is closed: pixels from the window's top.
HEADERS = (141, 166)


def transferring():
    """A calf's motion onto a giraffe, by markers, with progress."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'creatures.blend'), load_ui=False)
    yield from settle()
    giraffe = bpy.data.objects["Giraffe"]
    show_modifiers(giraffe)
    with in_view():
        bpy.ops.view3d.view_selected()
    yield from settle()
    screenshot('markers')
    from detail_deform.ui import marker_cache
    calf, pair = bpy.data.objects["Calf"], ("Calf", "Giraffe")
    yield from wait_until(lambda: pair in marker_cache._doubts)
    check("good markers are in no doubt", marker_cache.doubts(calf, giraffe) == ())
    groups = giraffe.vertex_groups
    for name, other in (("Marker 1", "."), ("Marker 16", "Marker 1"), (".", "Marker 16")):  # muzzle and tail
        groups[name].name = other
    activate(calf)
    yield from wait_until(lambda: marker_cache.doubts(calf, giraffe))
    check("exchanged ones are named, also while the source is active", marker_cache.doubts(calf, giraffe) == (1, 16))
    yield from settle()
    screenshot('doubts')
    for name, other in (("Marker 1", "."), ("Marker 16", "Marker 1"), (".", "Marker 16")):
        groups[name].name = other
    activate(giraffe)
    with in_view():
        bpy.ops.object.detail_deform_transfer_match('INVOKE_DEFAULT')
    yield from settle()
    screenshot('matching')
    settings = giraffe.detail_deform.transfer
    yield from expect("correspondences are found in the background", lambda: settings.correspondence == 'STORED')
    settings.show_match = True
    with in_view():
        bpy.ops.view3d.view_camera()
    yield from settle()
    screenshot('matched')
    settings.show_match = False
    with in_view():
        bpy.ops.object.detail_deform_transfer_live('INVOKE_DEFAULT')
    rest = evaluated(giraffe)
    with in_view():
        bpy.ops.screen.animation_play()
    yield 1.5
    with in_view():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    bpy.context.scene.frame_set(17)
    yield from settle()
    check("the giraffe follows the calf", np.abs(evaluated(giraffe) - rest).max() > 0.5 and not settings.problem)
    view = {'window': bpy.context.window_manager.windows[0], 'area': area('PROPERTIES')}
    with bpy.context.temp_override(**view):
        bpy.ops.screen.screen_full_area()
    yield from settle()
    if (yield from is_drawn('OBJECT_PT_detail_deform')):
        xdotool('mousemove', 60, HEADERS[0], 'click', 1)
        yield from settle()
    xdotool('mousemove', 60, HEADERS[1], 'click', 1)
    yield from settle()
    check("with the first panel closed, a click opens the second", not (yield from is_drawn('OBJECT_PT_detail_deform'))
          and (yield from is_drawn('OBJECT_PT_detail_deform_transfer')))
    screenshot('transfer_panel')
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area('PROPERTIES')):
        bpy.ops.screen.back_to_previous()
    yield from settle()
    screenshot('following')


def seen_alone(kind, name):
    """Takes a screenshot of one editor, maximized."""
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window, area=area(kind)):
        bpy.ops.screen.screen_full_area()
    yield from settle()
    screenshot(name)
    with bpy.context.temp_override(window=window, area=area(kind)):
        bpy.ops.screen.back_to_previous()
    yield from settle()


def transferring_to_many():
    """Transfers keys of one Suzanne to eight others, of which one fails: cancelled, undone, then completed."""
    yield from new_scene()
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        source = bpy.context.object
        source.modifiers.new("Dense", 'SUBSURF').levels = 2
        bpy.ops.object.modifier_apply(modifier="Dense")
    targets = []
    for number in range(8):
        targets.append(bpy.data.objects.new(f"Head {number + 1}", source.data.copy()))
        bpy.context.scene.collection.objects.link(targets[-1])
        targets[-1].location = (2.5 * (number % 3 - 1), 2.0 * (number // 3 + 1), 0)
        points = coordinates(targets[-1].data) * (1 + 0.05 * number, 1, 1)
        targets[-1].data.vertices.foreach_set('co', points.astype(np.float32).ravel())
    targets[2].detail_deform.transfer.anchor = 'PINNED'
    targets[2].detail_deform.transfer.anchor_group = "Neck"
    rest = coordinates(source.data)
    source.shape_key_add(name="Basis", from_mix=False)
    for number in range(12):
        key = source.shape_key_add(name=f"Key {number + 1}", from_mix=False)
        key.data.foreach_set('co', (rest + np.sin(rest * number)[:, [1, 2, 0]] / 20).astype(np.float32).ravel())
        key.value = 0
    activate(source)
    for target in targets:
        target.select_set(True)
    with in_view():
        bpy.ops.view3d.view_all()
        bpy.ops.ed.undo_push(message="Made")
    yield from settle()
    show_modifiers(source)
    for target in targets:
        target.select_set(True)
    point_at('VIEW_3D')
    yield from settle()

    def begin():
        with in_view():
            bpy.ops.object.detail_deform_transfer_many('INVOKE_DEFAULT', what='ALL_KEYS')
        yield from settle()
        screenshot('many_dialog')
        xdotool('key', 'Return')

    def done():
        return [ob.name for ob in bpy.data.objects if ob.name.startswith("Head") and ob.data.shape_keys]

    def failed():
        return [entry.name for entry in bpy.data.objects["Suzanne"].detail_deform.transfer.failed]

    yield from begin()
    yield from wait_until(lambda: len(done()) >= 1)
    screenshot('many_progress')
    yield from wait_until(lambda: len(done()) >= 3)
    xdotool('key', 'Escape')
    yield from wait_until(lambda: bpy.data.texts)
    yield from settle()
    screenshot('many_cancelled')
    check(f"Esc leaves those that are done, {done()}", 3 <= len(done()) < 7 and failed() == ["Head 3"])
    check("which the table says", "cancelled and left as they were" in bpy.data.texts[0].as_string())
    xdotool('key', 'ctrl+z')
    yield from expect("one undo takes them back", lambda: not done() and not failed() and not bpy.data.texts)
    yield from settle()
    yield from begin()
    yield from wait_until(lambda: failed() and bpy.data.texts)
    yield from settle()
    check("then all are done but one", len(done()) == 7 and failed() == ["Head 3"])
    area('INFO').type = 'TEXT_EDITOR'
    area('TEXT_EDITOR').spaces.active.text = bpy.data.texts[0]
    yield from seen_alone('PROPERTIES', 'many_panel')
    yield from seen_alone('TEXT_EDITOR', 'many_table')
    area('TEXT_EDITOR').type = 'INFO'
    yield from settle()
