# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool Pull in Sculpt Mode's toolbar."""

import bpy
import numpy as np
from mathutils import Vector

from desk import check, coordinates, evaluated, expect, in_view, new_scene, screenshot, settle, xdotool
from pulls import drag, show_tool, suzanne


def _handles():
    return suzanne().detail_deform.handles


def _moved():
    """(n,): how far what is displayed is from the mesh itself."""
    return np.linalg.norm(evaluated(suzanne()) - coordinates(suzanne().data), axis=1)


def _is_bound_to(count):
    return lambda: len(_handles()) == count and suzanne().detail_deform.is_bound and _moved().max() > 0.05


def _brush_size(pixels):
    """The radius of the brush."""
    from detail_deform.scene import brush_size
    owner, name = brush_size.size_property(bpy.context)
    setattr(owner, name, round(pixels / brush_size._RADII_A_SIZE))


def _tip(axis, sign=1, within=lambda p: True):
    """The displayed vertex that is farthest along an axis."""
    points = evaluated(suzanne())
    return Vector(max((p for p in points if within(p)), key=lambda p: sign * p[axis]))


def sculpting_mode():
    """From Suzanne in a new scene, with a relief, to her Sculpt Mode with the tool Pull."""
    yield from new_scene()
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        bpy.context.active_object.modifiers.new("Subdivision", 'SUBSURF').levels = 3
        bpy.ops.object.modifier_apply(modifier="Subdivision")
        ob = bpy.context.active_object
        points, normals = coordinates(ob.data), np.array([vertex.normal for vertex in ob.data.vertices])
        bumps = 0.04 * np.prod(np.sin(30 * points), axis=1, keepdims=True) ** 2
        ob.data.vertices.foreach_set('co', (points + bumps * normals).astype(np.float32).ravel())
        ob.data.update()
        ob.data.polygons.foreach_set('use_smooth', [True] * len(ob.data.polygons))
        bpy.ops.view3d.view_axis(type='FRONT')
        bpy.ops.view3d.view_selected()
        bpy.ops.ed.undo_push(message="Relief")
        bpy.ops.object.mode_set('EXEC_DEFAULT', True, mode='SCULPT')
        bpy.ops.wm.tool_set_by_id(name='detail_deform.brush_pull')
    yield from settle()
    yield from show_tool('brush-tool')


def by_brush():
    """Drags, each of which is a step of undo; Esc, the wheel, and a drag beside the surface."""
    ear, rest = _tip(0), evaluated(suzanne())
    chin = _tip(2, -1) + Vector((0, 0, 0.1))
    _brush_size(60)
    yield from drag('brush-beside', ear + Vector((1, 0, 1.2)), 60, 0)
    check("a drag beside the surface does nothing", not _handles() and suzanne().mode == 'SCULPT')
    yield from drag('brush-pull', ear - Vector((0.1, 0, 0)), 80, -40)
    yield from expect("a drag of the brush pulls the ear in Sculpt Mode", _is_bound_to(1))
    yield from settle()
    check("which is not left", suzanne().mode == 'SCULPT' and bpy.context.active_object == suzanne())
    moved, first = _moved(), evaluated(suzanne())
    check("around the ear alone", not moved[rest[:, 0] < 0].any())
    yield from drag('brush-again', _handles()[0].target.location.copy(), 40, 0)
    yield from expect("a drag that begins on the handle moves it on",
                      lambda: _moved().max() > moved.max() + 0.1 and len(_handles()) == 1)
    yield from drag('brush-second', chin, 0, 60)
    yield from expect("another one makes a second handle", _is_bound_to(2))
    yield from settle()
    xdotool('key', 'ctrl+z')
    yield from expect("undo takes that back", lambda: len(_handles()) == 1 and _moved().max() > moved.max() + 0.1)
    yield from settle()
    xdotool('key', 'ctrl+z')
    yield from expect("then the motion", _shows(first))
    yield from settle()
    xdotool('key', 'ctrl+z')
    yield from expect("and then the first pull", lambda: not _handles() and suzanne().mode == 'SCULPT')
    check("and all that it made", not suzanne().vertex_groups and not suzanne().modifiers)
    yield from settle()
    xdotool('key', 'ctrl+shift+z')
    yield from expect("redo brings it again", lambda: len(_handles()) == 1 and _shows(first)())
    yield from _escape(chin, first)
    yield from _wheel(chin, first)


def _shows(positions):
    return lambda: np.abs(evaluated(suzanne()) - positions).max() < 1e-5


def _escape(chin, first):
    yield from drag('brush-escape', chin, 0, 60, [('Escape', 1)])
    yield from expect("Esc takes a pull back", _shows(first))
    check("and its handle", len(_handles()) == 1 and len(suzanne().vertex_groups) == 2)


def _wheel(chin, first):
    sizes = []
    for notches in (0, 8, 0):
        yield from drag(f'brush-wheel-{notches}', chin, 0, 60, [(4, notches)])
        yield from expect("the second handle is bound", _is_bound_to(2))
        yield from settle()
        sizes.append(int((np.linalg.norm(evaluated(suzanne()) - first, axis=1) > 1e-5).sum()))
        xdotool('key', 'ctrl+z')
        yield from expect("and undone by a step", lambda: len(_handles()) == 1)
        yield from settle()
    check(f"the wheel makes the reach larger, {sizes}", sizes[1] > 1.25 * sizes[0])
    check("of that drag alone", sizes[2] == sizes[0])


def sculpting_what_was_pulled():
    """After Apply Blender's brushes work on what is seen; a pull between strokes is undone by itself; masked vertices
    stay, and the symmetry pulls both sides."""
    shown = evaluated(suzanne())
    with in_view():
        bpy.ops.object.detail_deform_apply('EXEC_DEFAULT', True, remove_handles=True)
    yield from settle()
    applied = coordinates(suzanne().data)
    check("Apply keeps the shape", np.abs(applied - shown).max() < 1e-6)
    check("and Sculpt Mode, and no handle", suzanne().mode == 'SCULPT' and not _handles())
    if bpy.context.tool_settings.sculpt.brush is not None:  # Debian's 4.3.2 comes without Blender's brushes
        yield from _stroking(shown, applied)
    yield from _masked()


def _stroking(shown, applied):
    yield from _stroke('brush-blender', _tip(0) - Vector((0.15, 0, 0.05)))
    brushed, there = coordinates(suzanne().data), np.linalg.norm(coordinates(suzanne().data) - applied, axis=1)
    check("a brush of Blender's works there", there.max() > 1e-3 and shown[there.argmax(), 0] > 1)
    yield from drag('brush-between', _tip(2, -1) + Vector((0, 0, 0.1)), 0, 60)
    yield from expect("then a pull", _is_bound_to(1))
    yield from settle()
    xdotool('key', 'ctrl+z')
    yield from expect("is undone alone", lambda: not _handles() and not _moved().any()
                      and np.array_equal(coordinates(suzanne().data), brushed))
    for _ in range(2):
        xdotool('key', 'ctrl+z')
        yield from settle()
    yield from expect("then the stroke", lambda: np.abs(coordinates(suzanne().data) - applied).max() < 1e-6)


def _stroke(name, place):
    """With Blender's brush Draw. Then the tool Pull is active again."""
    with in_view():
        bpy.ops.wm.tool_set_by_id(name='builtin_brush.Draw' if bpy.app.version < (4, 3) else 'builtin.brush')
    yield from drag(name, place, 24, 24)
    with in_view():
        bpy.ops.wm.tool_set_by_id(name='detail_deform.brush_pull')
    yield from settle()


def _fill_mask(value):
    bpy.ops.paint.mask_flood_fill(mode='VALUE', value=value)
    bpy.ops.ed.undo_push(message="Mask")  # the fill's own step, as of a script, waits for the next one, and replaces it


def _masked():
    ob = suzanne()
    _brush_size(90)
    ob.data.use_mirror_x = True
    rest = coordinates(ob.data)
    high = rest[:, 2] > 0.3
    with in_view():
        _fill_mask(1.0)
    layer = ob.data.attributes.get('.sculpt_mask') or ob.data.vertex_paint_masks[0]
    layer.data.foreach_set('value', high.astype(np.float32))
    yield from settle()
    yield from drag('brush-masked', _tip(0, -1, lambda p: p[2] < 0.2) + Vector((0.15, 0, -0.05)), -60, 0)
    yield from expect("the brush pulls on both sides", _is_bound_to(2))
    yield from settle()
    moved = _moved()
    check("the left", moved[rest[:, 0] < -0.5].max() > 0.1)
    check("and the right", moved[rest[:, 0] > 0.5].max() > 0.1)
    check("and leaves in place what is masked", not moved[high].any() and moved[~high].any())
    screenshot('brush-both')


def _tool():
    return bpy.context.workspace.tools.from_space_view3d_mode('SCULPT').operator_properties(
        'object.detail_deform_brush_pull')


def applying_at_once():
    """A click leaves nothing; with Apply on Release a drag changes the sculpt, and a face set is moved as one piece."""
    with in_view():
        bpy.ops.object.detail_deform_apply('EXEC_DEFAULT', True, remove_handles=True)
        _fill_mask(0.0)
    ob = suzanne()
    ob.data.use_mirror_x = False
    _tool().apply = True
    yield from settle()
    rest, nose = coordinates(ob.data), _tip(1, -1)
    yield from drag('brush-click', nose, 0, 0)
    check("a click changes nothing", not _handles() and np.array_equal(coordinates(suzanne().data), rest))
    yield from drag('brush-at-once', nose, 0, 60)
    yield from expect("a drag becomes part of the sculpt at once",
                      lambda: np.abs(coordinates(suzanne().data) - rest).max() > 0.2)
    check("and leaves no handle", not _handles() and not suzanne().modifiers and suzanne().mode == 'SCULPT')
    yield from settle()
    xdotool('key', 'ctrl+z')
    yield from expect("a step takes it back", lambda: np.array_equal(coordinates(suzanne().data), rest))
    yield from _by_face_set(rest)


def _by_face_set(rest):
    ob = suzanne()
    sets = np.ones(len(ob.data.polygons), np.int32)
    corners = [polygon.vertices[0] for polygon in ob.data.polygons]
    low = rest[corners, 2] < -0.55
    sets[low] = 2
    made = ob.data.attributes.get('.sculpt_face_set') or ob.data.attributes.new('.sculpt_face_set', 'INT', 'FACE')
    made.data.foreach_set('value', sets)
    _tool().apply, _tool().hold = False, 'FACE_SET'
    yield from settle()
    yield from drag('brush-face-set', _tip(2, -1) + Vector((0, 0, 0.1)), 0, 60)
    yield from expect("a face set is pulled", _is_bound_to(1))
    yield from settle()
    faces = [polygon for polygon, inside in zip(suzanne().data.polygons, low) if inside]
    held = _moved()[np.unique([vertex for face in faces for vertex in face.vertices])]
    check("as one piece", np.ptp(held) < 1e-4 and held.min() > 0.1 and _moved().max() < 1.1 * held.max())
    _tool().hold = 'BRUSH'
