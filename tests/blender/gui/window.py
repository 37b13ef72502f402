# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on in Blender's own window, driven by real key and mouse events.

    xvfb-run -a -s "-screen 0 1280x800x24" blender --factory-startup --window-geometry 0 0 1280 800 \
        --python tests/blender/gui/window.py -- build/gui

Writes a screenshot of each state into the folder, which is emptied first, and one line a check; ends with 1
if one failed. Needs xdotool and ImageMagick's import.
"""

import os
import shutil
import subprocess
import sys
import traceback
from pathlib import Path

import bmesh
import bpy
import numpy as np
from mathutils import Vector

ROOT = Path(__file__).resolve().parents[3]
OUT = Path(sys.argv[sys.argv.index('--') + 1]).resolve()
HEADERS = (141, 166)  # of the two panels in the full window, pixels from its top, while the first is closed
# In the viewport's sidebar, pixels from the viewport's right upper corner.
SIDEBAR_TAB, SAVE_BUTTON = (13, 220), (117, 360)
failures = []


def check(what, holds):
    print(('ok    ' if holds else 'FAILED ') + what, flush=True)
    if not holds:
        failures.append(what)


def xdotool(*words):
    subprocess.run(['xdotool', *map(str, words)], check=True)


def screenshot(name):
    subprocess.run(['import', '-window', 'root', str(OUT / f'{name}.png')], check=True)


def surface():
    """The mesh with the handle, and its empty. Python references don't outlive undo and loading."""
    ob = next(o for o in bpy.data.objects if o.type == 'MESH' and o.detail_deform.handles)
    return ob, ob.detail_deform.handles[0].target


def coordinates(mesh):
    values = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get('co', values)
    return values.reshape(-1, 3).astype(float)


def evaluated(ob):
    return coordinates(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data)


def offsets():
    ob, _ = surface()
    return evaluated(ob) - coordinates(ob.data)


def held():
    """(n,) bool: the handle's vertices."""
    ob, _ = surface()
    index = ob.vertex_groups[ob.detail_deform.handles[0].vertex_group].index
    return np.array([any(g.group == index and g.weight > 0.5 for g in v.groups) for v in ob.data.vertices])


def area(kind):
    return next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == kind)


def point_at(kind):
    where = area(kind)
    window = bpy.context.window_manager.windows[0]
    xdotool('mousemove', where.x + where.width // 2, window.height - where.y - where.height // 2)


def show_sidebar():
    area('VIEW_3D').spaces.active.show_region_ui = True


def click_in_view(x, y):
    """x, y: pixels from the viewport's right upper corner."""
    where, window = area('VIEW_3D'), bpy.context.window_manager.windows[0]
    xdotool('mousemove', where.x + where.width - x, window.height - where.y - where.height + y)
    yield 0.3
    xdotool('click', 1)
    yield 0.5


def in_view():
    window, view = bpy.context.window_manager.windows[0], area('VIEW_3D')
    return bpy.context.temp_override(window=window, area=view,
                                     region=next(r for r in view.regions if r.type == 'WINDOW'))


def activate(ob):
    for other in bpy.context.view_layer.objects:
        other.select_set(other == ob)
    bpy.context.view_layer.objects.active = ob


def wait_until(condition, seconds=30):
    for _ in range(int(10 * seconds)):
        if condition():
            return
        yield 0.1


def checks():
    """Yields the seconds to wait before going on: in between Blender handles its events."""
    yield from opening()
    yield from selecting_problems()
    yield from binding()
    yield from dragging()
    yield from undoing()
    yield from reopening()
    yield from transferring()
    yield from transferring_to_many()
    yield from pulling()
    yield from by_hand()
    yield from expressing()
    yield from rendering()
    yield from baking()
    yield from drafting()
    yield from keeping_track()


def opening():
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'bumpy_plane.blend'), load_ui=False)
    yield 1.0
    ob, _ = surface()
    activate(ob)
    area('PROPERTIES').spaces[0].context = 'MODIFIER'
    area('OUTLINER').type = 'INFO'
    yield 0.5
    panel = area('PROPERTIES')
    # Its header, below the names and the menu.
    xdotool('mousemove', panel.x + 60, bpy.context.window_manager.windows[0].height - panel.y - panel.height + 118,
            'click', 1)
    yield 0.5
    screenshot('unbound')


def selecting_problems():
    """From a sentence to the vertices that it is about, in view; and undo."""
    ob, _ = surface()
    for vertex in (7, 9):
        ob.data.vertices[vertex].co.z = float('nan')
    ob.data.update()
    with in_view():
        bpy.ops.object.detail_deform_bind()
    yield from wait_until(lambda: ob.detail_deform.problem)
    check("a refusal from the background is in the panel", "Vertex 7 " in ob.detail_deform.status)
    yield 0.5
    screenshot('refused')
    yield from select_problems()
    check("all that it is about is selected", selected() == [7, 9])
    xdotool('key', 'ctrl+z')
    yield 0.5
    check("undo leaves Edit Mode again", surface()[0].mode == 'OBJECT')
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
    yield 0.3
    screenshot('warned')
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'bumpy_plane.blend'), load_ui=False)
    yield 1.0
    activate(surface()[0])
    with in_view():
        bpy.ops.view3d.view_all()


def select_problems():
    point_at('VIEW_3D')
    with in_view():
        bpy.ops.ed.undo_push(message="Before")
        bpy.ops.object.detail_deform_select_problem('INVOKE_DEFAULT', True)
    yield 0.5


def selected():
    found = bmesh.from_edit_mesh(surface()[0].data)
    return [vertex.index for vertex in found.verts if vertex.select]


def binding():
    with in_view():
        bpy.ops.object.detail_deform_bind()
    yield from wait_until(lambda: surface()[0].detail_deform.is_bound)
    check("a bind in the background ends with the surface bound", surface()[0].detail_deform.is_bound)
    yield 0.5
    screenshot('bound')


def is_whole():
    """Whether no other result is to take the place of what is shown."""
    from detail_deform.follow import shown
    return shown.by(surface()[0].data).is_final


def dragging():
    _, empty = surface()
    activate(empty)
    height, followed = empty.location.z, []
    members = held()
    point_at('VIEW_3D')
    yield 0.3
    xdotool('key', 'g')
    yield 0.2
    xdotool('key', 'z')
    for _ in range(20):
        xdotool('mousemove_relative', '--', 0, -6)
        yield 0.02
        _, empty = surface()
        followed.append((empty.location.z - height, offsets()[members][0, 2]))
    xdotool('key', 'Return')
    yield 0.3
    moved, shown = np.array(followed).T
    check("a drag moves the empty in many steps", len(set(np.round(moved, 6))) > 10 and moved[-1] > 0.05)
    check("the surface follows at every step", np.abs(moved - shown).max() < 1e-5)
    _, empty = surface()
    yield from wait_until(is_whole)  # on a busy machine a drag shows the quick result
    check("and stays when the drag ends", np.allclose(offsets()[members], (0, 0, empty.location.z - height), atol=1e-5))
    surface()[0].detail_deform.preview = True
    activate(surface()[0])
    yield 0.5
    screenshot('dragged')
    surface()[0].detail_deform.preview = False


def undoing():
    before = offsets()
    point_at('VIEW_3D')
    yield 0.2
    activate(surface()[1])
    bpy.ops.ed.undo_push(message="Selected")
    yield 0.2
    for _ in range(2):  # the selection, then the drag
        xdotool('key', 'ctrl+z')
        yield 0.5
    check("undo takes a drag back", np.abs(offsets()).max() < 1e-6)
    for _ in range(2):
        xdotool('key', 'ctrl+shift+z')
        yield 0.5
    check("redo brings it again", np.abs(offsets() - before).max() < 1e-6)
    check("and it is bound", surface()[0].detail_deform.is_bound)


def reopening():
    from detail_deform.follow import auto_bind
    before, path = offsets(), str(OUT / 'posed.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    yield 1.0
    check("a reopened file shows what was saved", np.abs(offsets() - before).max() < 1e-6)
    _, empty = surface()
    empty.location.z += 0.1
    yield from wait_until(lambda: surface()[0].detail_deform.is_bound)
    yield 0.3
    check("binds by itself when a handle moves, and follows",
          np.allclose((offsets() - before)[held()], (0, 0, 0.1), atol=1e-5))
    ob, _ = surface()
    ob.detail_deform.auto_bind = False
    ob.data.vertices[0].co.z += 0.5
    ob.data.update()
    yield from wait_until(lambda: "were moved since Bind" in ob.detail_deform.status)
    check("an edit of the mesh is noticed", "were moved since Bind" in ob.detail_deform.status)
    activate(ob)
    yield 0.5
    screenshot('stale')
    ob.detail_deform.auto_bind = True
    auto_bind._LIMIT_SECONDS = 60  # however busy the machine is
    ob.data.vertices[0].co.z -= 0.1
    ob.data.update()
    bound_to = ob.detail_deform.signature
    yield from wait_until(lambda: ob.detail_deform.is_bound and ob.detail_deform.signature != bound_to)
    check("and it is bound again by itself", ob.detail_deform.is_bound and ob.detail_deform.signature != bound_to)
    yield 0.3
    check("with its pose", np.allclose((offsets() - before)[held()], (0, 0, 0.1), atol=1e-5))


def transferring():
    """A calf's motion onto a giraffe, by markers, with progress."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'creatures.blend'), load_ui=False)
    yield 1.0
    giraffe = bpy.data.objects["Giraffe"]
    activate(giraffe)
    with in_view():
        bpy.ops.view3d.view_selected()
    yield 0.5
    screenshot('markers')
    from detail_deform.ui import known_markers
    calf, pair = bpy.data.objects["Calf"], ("Calf", "Giraffe")
    yield from wait_until(lambda: pair in known_markers._doubts)
    check("good markers are in no doubt", known_markers.doubts(calf, giraffe) == ())
    groups = giraffe.vertex_groups
    for name, other in (("Marker 1", "."), ("Marker 16", "Marker 1"), (".", "Marker 16")):  # muzzle and tail
        groups[name].name = other
    activate(calf)
    yield from wait_until(lambda: known_markers.doubts(calf, giraffe))
    check("exchanged ones are named, also while the source is active", known_markers.doubts(calf, giraffe) == (1, 16))
    yield 0.3
    screenshot('doubts')
    for name, other in (("Marker 1", "."), ("Marker 16", "Marker 1"), (".", "Marker 16")):
        groups[name].name = other
    activate(giraffe)
    with in_view():
        bpy.ops.object.detail_deform_transfer_match('INVOKE_DEFAULT')
    yield 0.2
    screenshot('matching')
    settings = giraffe.detail_deform.transfer
    yield from wait_until(lambda: settings.correspondence == 'STORED', 60)
    check("correspondences are found in the background", settings.correspondence == 'STORED')
    settings.show_match = True
    with in_view():
        bpy.ops.view3d.view_camera()
    yield 0.5
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
    yield 0.3
    check("the giraffe follows the calf", np.abs(evaluated(giraffe) - rest).max() > 0.5 and not settings.problem)
    view = {'window': bpy.context.window_manager.windows[0], 'area': area('PROPERTIES')}
    with bpy.context.temp_override(**view):
        bpy.ops.screen.screen_full_area()
    yield 0.5
    for header in HEADERS:  # the first closed, the next opened
        xdotool('mousemove', 60, header, 'click', 1)
        yield 0.5
    screenshot('transfer_panel')
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area('PROPERTIES')):
        bpy.ops.screen.back_to_previous()
    yield 0.3
    screenshot('following')


def transferring_to_many():
    """Keys of one Suzanne onto eight others, of which one can't be done: cancelled, taken back, and done."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    yield 1.0
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        source = bpy.context.object
        source.modifiers.new("Dense", 'SUBSURF').levels = 3
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
    yield 0.5
    area('PROPERTIES').spaces[0].context = 'MODIFIER'
    point_at('VIEW_3D')
    yield 0.5

    def begin():
        with in_view():
            bpy.ops.object.detail_deform_transfer_many('INVOKE_DEFAULT', what='ALL_KEYS')
        yield 0.5
        screenshot('many_dialog')
        xdotool('key', 'Return')

    def done():
        return [ob.name for ob in bpy.data.objects if ob.name.startswith("Head") and ob.data.shape_keys]

    def failed():
        return [entry.name for entry in bpy.data.objects["Suzanne"].detail_deform.transfer.failed]

    yield from begin()
    yield from wait_until(lambda: len(done()) >= 3)
    screenshot('many_progress')
    xdotool('key', 'Escape')
    yield 1.0
    screenshot('many_cancelled')
    check(f"Esc leaves those that are done, {done()}", 3 <= len(done()) < 7 and failed() == ["Head 3"])
    check("which the table says", "cancelled and left as they were" in bpy.data.texts[0].as_string())
    xdotool('key', 'ctrl+z')
    yield 1.0
    check("one undo takes them back", not done() and not failed() and not bpy.data.texts)
    yield from begin()
    yield from wait_until(lambda: failed() and bpy.data.texts)
    yield 0.5
    check("then all are done but one", len(done()) == 7 and failed() == ["Head 3"])
    area('INFO').type = 'TEXT_EDITOR'
    area('TEXT_EDITOR').spaces.active.text = bpy.data.texts[0]
    view = {'window': bpy.context.window_manager.windows[0], 'area': area('PROPERTIES')}
    with bpy.context.temp_override(**view):
        bpy.ops.screen.screen_full_area()
    yield 0.5
    screenshot('many_panel')
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area('PROPERTIES')):
        bpy.ops.screen.back_to_previous()
    yield 0.5
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area('TEXT_EDITOR')):
        bpy.ops.screen.screen_full_area()
    yield 0.5
    screenshot('many_table')
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area('TEXT_EDITOR')):
        bpy.ops.screen.back_to_previous()
    yield 0.5
    area('TEXT_EDITOR').type = 'INFO'
    yield 0.3


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


def call_pull():
    with in_view():
        bpy.ops.object.detail_deform_pull('INVOKE_DEFAULT')
    yield 0.4


def in_hand():
    """Whether Pull has ended, with the empty going with the mouse."""
    ob = bpy.context.active_object
    return ob is not None and ob.type == 'EMPTY' and surface()[0].detail_deform.is_bound


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


def expressing():
    """From Suzanne to a symmetric expression as a shape key, and back at rest, each action of the hand counted."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    yield 1.0
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        bpy.ops.view3d.view_selected()
    ob = bpy.context.active_object
    ob.modifiers.new("Subdivision", 'SUBSURF').levels = 2
    chosen = np.array([v.co.x > 1.2 for v in ob.data.vertices])
    point_at('VIEW_3D')
    yield 0.5
    actions = 0

    def done(count=1):
        nonlocal actions
        actions += count
        return 0.5

    xdotool('key', 'Tab')
    yield done()
    ob.data.use_mirror_x = True  # X among the symmetry buttons in the header
    yield done()
    mesh = bmesh.from_edit_mesh(ob.data)
    for vertex in mesh.verts:
        vertex.select_set(bool(chosen[vertex.index]))
    bmesh.update_edit_mesh(ob.data)
    yield done()  # a click with the circle
    yield from call_pull()
    yield done(2)  # right click, and the entry
    xdotool('click', 1)  # the reach
    yield from wait_until(in_hand)
    yield done()
    for _ in range(2):
        xdotool('mousemove_relative', '--', 25, -35)
        yield 0.2
    xdotool('click', 1)
    yield done()
    ob, empty = surface()
    seen = {tuple(np.round(v.co, 4)): v.index for v in ob.data.vertices}
    image = [seen[tuple(np.round((-v.co.x, v.co.y, v.co.z), 4) + 0.0)] for v in ob.data.vertices]
    moved = np.array([v.vector for v in ob.data.attributes['detail_deform_offset'].data])
    check("both of her ears move", np.linalg.norm(moved[chosen], axis=1).min() > 0.05)
    check("as mirror images", np.abs(moved[image] * (-1, 1, 1) - moved).max() < 1e-4)
    check("before her subdivision", ob.modifiers[0].name == "Detail Deform")
    show_sidebar()
    yield 0.5
    yield from click_in_view(*SIDEBAR_TAB)
    yield done(2)  # N, and the tab
    screenshot('expression')
    yield from click_in_view(*SAVE_BUTTON)
    yield done()
    key = ob.data.shape_keys.key_blocks.get("Expression")
    check("the expression is a shape key", key is not None and key.value == 0)
    check("and the face is at rest, still bound", ob.detail_deform.is_bound and not np.abs(
        [v.vector for v in ob.data.attributes['detail_deform_offset'].data]).max() > 1e-6)
    check(f"in {actions} actions, at most 10", actions <= 10)
    key.value = 1
    xdotool('mousemove', 400, 400)
    yield 0.5
    screenshot('expression-saved')
    check("the empty is active", bpy.context.active_object == empty)
    xdotool('key', 'Tab')
    yield 0.5
    check("Tab goes from the empty to its mesh", bpy.context.active_object == ob and ob.mode == 'OBJECT')
    xdotool('key', 'Tab')
    yield 0.5
    check("and from there to Edit Mode", ob.mode == 'EDIT')
    xdotool('key', 'Tab')
    area('VIEW_3D').spaces.active.show_region_ui = False
    yield 0.5


def rendering():
    """From the window, which computes frames in another thread, whether it may be used meanwhile or not."""
    scene = bpy.context.scene
    bpy.context.preferences.view.render_display_type = 'NONE'
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.location, camera.rotation_euler = (0, -7, 1), (1.45, 0, 0)
    scene.camera = camera
    scene.render.engine = 'BLENDER_WORKBENCH'
    scene.render.resolution_x, scene.render.resolution_y = 120, 90
    scene.frame_start, scene.frame_end = 1, 4
    _, empty = surface()
    empty.keyframe_insert('location', frame=1)
    empty.location.z += 1
    empty.keyframe_insert('location', frame=4)
    pictures = {}
    for lock in (False, True):
        scene.render.use_lock_interface = lock
        scene.render.filepath = str(OUT / f'lock_{lock}_')
        with in_view():
            bpy.ops.render.render('INVOKE_DEFAULT', animation=True)
        yield 0.5
        yield from wait_until(lambda: not bpy.app.is_job_running('RENDER'), 60)
        pictures[lock] = [np.array(bpy.data.images.load(f'{scene.render.filepath}{frame:04d}.png').pixels[:])
                          for frame in range(1, 5)]
    changes = [np.abs(b - a).mean() for a, b in zip(pictures[False], pictures[False][1:])]
    check("every rendered frame shows its own pose", min(changes) > 1e-3)
    check("with the interface locked the same", all(
        np.abs(a - b).max() < 0.02 for a, b in zip(pictures[False], pictures[True])))
    eevee = []
    scene.render.engine, scene.eevee.taa_render_samples = 'BLENDER_EEVEE', 1
    scene.render.resolution_x, scene.render.resolution_y = 60, 45
    scene.render.film_transparent = True
    for frame in (1, 4):
        scene.frame_set(frame)
        scene.render.filepath = str(OUT / f'eevee_{frame}.png')
        with in_view():
            bpy.ops.render.render(write_still=True)
        yield 0.2
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
        yield 0.2
        with in_view():
            bpy.ops.object.detail_deform_bake('INVOKE_DEFAULT', filepath=str(path))
        yield 0.5
        screenshot('bake')
        xdotool('key', 'Return')
        yield 0.15
        if key:
            xdotool('key', key)
        else:
            yield from wait_until(path.exists, 20)
        yield 1.0
        if not key:
            check("a bake in the window plays its cache", path.exists()
                  and 'Detail Deform Cache' in surface()[0].modifiers)
        else:
            check("Esc leaves nothing behind", not path.exists() and not Path(f'{path}.unfinished').exists())
    yield 0.5
    screenshot('baked')


def heavy_plane(side=330):
    """A bumpy plane that is dense enough for a draft: its left edge is fixed, the right one has a handle."""
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
    """A drag while a heavy mesh is being bound, which isn't seen to end before that."""
    from detail_deform.follow import shown
    from detail_deform.library import native
    ob, empty = heavy_plane()
    progress = native.Bind.progress
    native.Bind.progress = lambda bind: (True, *progress(bind)[1:])
    yield 1.0
    with in_view():
        bpy.ops.view3d.view_selected()
        bpy.ops.object.detail_deform_bind()

    def shows_draft():
        record = shown.by(ob.data)
        return record is not None and record.is_draft

    yield from wait_until(shows_draft)
    check("a draft is there before a heavy mesh is bound", shows_draft() and not ob.detail_deform.is_bound)
    activate(empty)
    point_at('VIEW_3D')
    xdotool('key', 'g')
    yield 0.1
    xdotool('key', 'z')
    followed = []
    for _ in range(8):
        xdotool('mousemove_relative', '--', 0, -12)
        yield 0.02
        followed.append((empty.location.z, evaluated(ob)[-1, 2] - coordinates(ob.data)[-1, 2], shows_draft()))
    xdotool('key', 'Return')
    yield 0.3
    moved, seen, drafts = np.array(followed).T
    check("a drag is followed by the draft", drafts.all() and moved[-1] > 0.05 and np.abs(moved - seen).max() < 1e-5)
    draft = evaluated(ob)
    check("which is shown as one", "a draft follows" in ob.detail_deform.status)
    activate(ob)
    yield 0.5
    screenshot('draft')
    native.Bind.progress = progress
    yield from wait_until(lambda: ob.detail_deform.is_bound, 120)
    yield 0.5
    check("until the result takes its place", ob.detail_deform.is_bound and shown.by(ob.data).is_final)
    difference = np.abs(evaluated(ob) - draft).max()
    check(f"which is near ({difference:.5f})", 0 < difference < 0.02)
    screenshot('after_draft')


def keeping_track():
    """Copied, renamed, deleted, taken back and appended among ten thousand others, whatever is bound follows."""
    ob, empty = heavy_plane(60)
    pebble = bpy.data.meshes.new("Pebble")
    pebble.from_pydata([(0, 0, 0), (0.02, 0, 0), (0, 0.02, 0)], [], [(0, 1, 2)])
    for number in range(10000):
        other = bpy.data.objects.new(f"Pebble {number}", pebble)
        other.location = (number % 100 / 20 - 2.5, number // 100 / 20 - 2.5, -0.5)
        bpy.context.scene.collection.objects.link(other)
    yield 1.0
    with in_view():
        bpy.ops.view3d.view_all()
        bpy.ops.object.detail_deform_bind()
    yield from wait_until(lambda: ob.detail_deform.is_bound)
    bpy.ops.ed.undo_push(message="Bound")

    def bound():
        return [o for o in bpy.data.objects if o.type == 'MESH' and o.detail_deform.handles]

    def follow(count):
        """Whether so many meshes, and no fewer, go with a handle of theirs."""
        meshes = bound()
        before = [evaluated(ob)[-1, 2] for ob in meshes]
        for ob in meshes:
            ob.detail_deform.handles[0].target.location.z += 0.1

        def moved():
            return [abs(evaluated(ob)[-1, 2] - height - 0.1) < 1e-5 for ob, height in zip(meshes, before)]

        yield from wait_until(lambda: all(moved()), 5)
        return moved() == count * [True]

    def press(*keys):
        point_at('VIEW_3D')
        for key in keys:
            xdotool('key', key)
            yield 0.5

    check("among ten thousand objects it follows", (yield from follow(1)))
    screenshot('among_many')
    ob, empty = surface()
    activate(ob)
    empty.select_set(True)
    bpy.ops.ed.undo_push(message="Selected")
    yield 0.5
    yield from press('shift+d', 'Return')
    check("so does a copy with a handle of its own", (yield from follow(2)) and
          len({o.detail_deform.handles[0].target.name for o in bound()}) == 2)
    screenshot('copied')
    bound()[1].name = "Another name"
    bpy.ops.ed.undo_push(message="Renamed")
    yield 0.5
    check("and under another name", (yield from follow(2)))
    activate(bound()[0])
    bpy.ops.ed.undo_push(message="Selected")
    yield 0.5
    yield from press('x', 'Return')
    yield from wait_until(lambda: len(bound()) == 1, 5)
    check("one is deleted, the other follows", (yield from follow(1)))
    yield from press('ctrl+z')
    yield from wait_until(lambda: len(bound()) == 2, 5)
    check("undo brings it back, and both follow", (yield from follow(2)))
    path = str(OUT / 'pair.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / 'bumpy_plane.blend'), load_ui=False)
    yield 0.5
    for name in [o.name for o in bound()]:
        bpy.data.objects.remove(bpy.data.objects[name])
    bpy.ops.wm.append(directory=path + '/Object/', filename="Another name")
    yield 0.5
    check("appended to another file, it follows", (yield from follow(1)))
    activate(bound()[0])
    yield 0.5
    screenshot('appended')


def main():
    sys.path.insert(0, str(ROOT / 'addon'))
    import detail_deform
    detail_deform.register()
    bpy.context.preferences.view.show_splash = False
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    steps = checks()

    def go_on():
        try:
            return next(steps)
        except StopIteration:
            pass
        except Exception:
            traceback.print_exc()
            failures.append("an exception")
            screenshot('exception')
        print(f"window: {len(failures)} failed", flush=True)
        os._exit(1 if failures else 0)

    bpy.app.timers.register(go_on, first_interval=1.0, persistent=True)


main()
