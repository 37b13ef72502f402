# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull in Sculpt Mode, by one drag on the surface: its start is the handle, its way the handle's motion."""

import time

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty
from mathutils import Matrix, Vector

from .. import session
from ..follow import lifecycle, messages
from ..library.options import HANDLE_TURNS
from ..scene import (brush_circle, brush_size, deform_modifier, displayed, mesh_data, picking, sculpted, stack,
                     view)
from ..scene.mesh_data import MeshProblem
from ..setup import brush_pulling, pulling
from .operator_base import MeshOperator, Progress, UnderWay, told
from .pull_operator import FALLOFF, RADIUS
from .reach_choice import length_text

_MOST_HELD = 0.9  # share of the radius that the handle may take, so that something is left to follow
_WHEEL, _FINE = 1.1, 0.1  # factor of the radius for a notch of the wheel; speed while Shift is held
_PAUSE_SECONDS = 0.15  # without a notch, after which the new radius is bound: about that between two notches
_KEYS = "    wheel: reach    Shift: finely    Esc, right click: cancel"

_under_way = session.kept(UnderWay(), session.Until.REPLACED)
# content: (name of the object, sculpted.signature()) at the last step of undo that this module has had made, if no undo
# has come since.
_last = session.Values(session.Until.REPLACED, content=None)


def _make_undoable(ob):
    """Pushes a step of undo that holds the whole scene, unless the last step is one. Blender's undo goes back from a
    step of the whole scene to one of Sculpt Mode, as those of strokes, without restoring what else has changed."""
    content = ob.name, sculpted.signature(ob)
    if None in content or content != _last.content:
        bpy.ops.ed.undo_push(message="Sculpt Mode")
        _last.content = content


class OBJECT_OT_detail_deform_brush_pull(MeshOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_brush_pull'
    bl_label = "Pull with the Brush"
    bl_description = ("In Sculpt Mode: what is under the brush becomes a handle with a reach of the brush's radius, "
                      "and is moved by the drag. A drag that begins on a handle moves that one")

    # None is kept for the next drag, whose settings are the tool's.
    hold: EnumProperty(
        name="Hold", default='BRUSH', options={'SKIP_SAVE'}, description="What becomes the handle",
        items=[('BRUSH', "Brush", "What lies in the middle of the brush: see Handle Size"),
               ('FACE_SET', "Face Set", "The whole face set under the brush; the reach is counted from its border")])
    handle_size: FloatProperty(
        name="Handle Size", default=0.25, min=0.0, max=_MOST_HELD, subtype='FACTOR', options={'SKIP_SAVE'},
        description="Share of the brush's radius in which the surface is moved as one piece")
    falloff: EnumProperty(**FALLOFF, options={'SKIP_SAVE'})
    turns: EnumProperty(name="Turns", items=HANDLE_TURNS, options={'SKIP_SAVE'},
                        description="What turns the vertices of the handle")
    apply: BoolProperty(
        name="Apply on Release", default=False, options={'SKIP_SAVE'},
        description="Make the pull part of the sculpt when the button is let go, and keep no handle")
    radius: FloatProperty(**{**RADIUS, 'description': "Distance along the surface up to which it follows. 0: the "
                                                      "radius of the brush"}, options={'SKIP_SAVE'})
    point: FloatVectorProperty(
        name="Point", subtype='TRANSLATION', options={'SKIP_SAVE'},
        description="World place on the displayed surface at which the pull begins")
    offset: FloatVectorProperty(
        name="Offset", subtype='TRANSLATION', options={'SKIP_SAVE'}, description="How far it is pulled, in the world")

    _view = _ob = _pull = _stages = _progress = _held = None
    _applies, _size = False, 0.0  # whether it ends with Apply; distance up to which vertices are the handle's

    @classmethod
    def poll_object(cls, ob):
        if ob.mode != 'SCULPT':
            cls.poll_message_set("The brush pulls in Sculpt Mode: enter it first")
            return False
        return True

    def run(self, context, ob):
        _check(ob)
        if not self.radius:
            raise MeshProblem("Without a window there is no brush: give the radius of the reach.")
        self._ob, surface = ob, brush_pulling.BrushedSurface(ob)
        for _ in self._take(context, surface, *_nearest(context, surface, ob, self.point)):
            pass
        self._held.move(Vector(self.offset))
        context.view_layer.update()
        lifecycle.wait(ob, context.evaluated_depsgraph_get())
        self._finish(context)

    def _take(self, context, surface, vertex, face):
        """Takes hold of the surface, a BrushedSurface, at a vertex of a face. Generator of the fraction done."""
        ob = self._ob
        brush_pulling.check_masked(surface, vertex)
        number, axis = brush_pulling.handle_at(ob, vertex)
        if number is not None:
            brush_pulling.check_unmasked(ob, surface, number)
            self._held = _Held(ob, ob.detail_deform.handles[number].target, axis)
            yield from brush_pulling.bound_again(context, ob, wait=not self._view)
            return
        self._size = self.handle_size * self.radius
        grip = brush_pulling.grip(ob, surface, vertex, face, self._size, self.hold == 'FACE_SET')
        self._applies = self.apply and not ob.detail_deform.handles
        self._pull = brush_pulling.BrushPull(context, ob, grip, self.radius, self.falloff, self.turns)
        for done in self._pull.stages(wait=not self._view, watch=True):
            if self._held is None and self._pull.is_binding:
                self._held = _Held(ob, self._pull.empty)
            yield done
        self._held = self._held or _Held(ob, self._pull.empty)

    # In the window

    def invoke(self, context, event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self._ob, self._view = context.active_object, view.chosen(context)
        try:
            _check(self._ob)
            if not self._begin(context, event):
                self.report({'WARNING'}, "There is nothing of this object under the brush: begin the drag on it")
                self._view = None
                return {'CANCELLED'}
        except messages.TOLD as problem:
            self.report({'ERROR'}, messages.said(self._ob, problem))
            return self._end(context, {'CANCELLED'})
        context.window_manager.modal_handler_add(self)
        _under_way.append(self)
        return {'RUNNING_MODAL'}

    def _begin(self, context, event):
        """Returns whether the surface is under the mouse."""
        ob, self._mouse = self._ob, self._view.mouse(event)
        surface = brush_pulling.BrushedSurface(ob)
        found = _hit(context, surface, ob, *self._view.ray(self._mouse))
        if found is None:
            return False
        vertex, face, point = found
        _make_undoable(ob)
        self.point, self._moved = point, Vector()
        self.radius = brush_size.radius(context, self._view.unit(point))
        self._is_released, self._changed = False, 0.0
        self._stages, self._progress = self._take(context, surface, vertex, face), Progress(context)
        # Up to the bind in the background, so that the handle is there when the mouse moves.
        while self._go_on(context) and self._held is None:
            pass
        self._show(context)
        return True

    def modal(self, context, event):
        if self not in _under_way:  # undo, or the add-on was disabled
            return {'CANCELLED'}
        try:
            return self._handle_event(context, event)
        except messages.TOLD as problem:
            self.report({'ERROR'}, messages.said(self._ob, problem))
            return self._take_back(context)
        except ReferenceError:  # a script has removed what is pulled
            return self._end(context, {'CANCELLED'})
        except Exception:
            self._take_back(context)
            raise

    def _handle_event(self, context, event):
        if event.type in {'ESC', 'RIGHTMOUSE'} and event.value == 'PRESS':
            return self._take_back(context)
        if event.type in {'MOUSEMOVE', 'INBETWEEN_MOUSEMOVE'} and not self._is_released:
            self._move(event)
        elif event.type in {'WHEELUPMOUSE', 'WHEELDOWNMOUSE'} and event.value == 'PRESS' and self._pull:
            step = _WHEEL ** (_FINE if event.shift else 1)
            self.radius *= step if event.type == 'WHEELUPMOUSE' else 1 / step
            self._changed = time.monotonic()
        elif event.type == 'LEFTMOUSE' and event.value == 'RELEASE':
            self._is_released = True
        self._show(context)
        is_waited_for = self._is_bound_again(context) if event.type == 'TIMER' or self._is_released else True
        if self._is_released and not is_waited_for:
            return self._finish(context) if self._moved.length else self._take_back(context)  # a click leaves nothing
        return {'RUNNING_MODAL'}

    def _is_bound_again(self, context):
        """Goes on with what is under way. Returns whether anything is."""
        if self._stages and self._go_on(context):
            return True
        if self._changed and (self._is_released or time.monotonic() - self._changed > _PAUSE_SECONDS):
            self._changed = 0.0
            self._pull.change_radius(self.radius)
            self._stages = pulling.until_bound(self._ob)
        return bool(self._stages)

    def _go_on(self, context):
        """Returns whether the stages are still to be gone on with."""
        try:
            self._progress.show(context, "Preparing", next(self._stages))
            return True
        except StopIteration:
            self._stages = None
            context.workspace.status_text_set(None)
            return False

    def _move(self, event):
        before, self._mouse = self._mouse, self._view.mouse(event)
        point = Vector(self.point) + self._moved
        step = self._view.at_depth(self._mouse, point) - self._view.at_depth(before, point)
        self._moved += step * (_FINE if event.shift else 1)
        self._held.move(self._moved)

    def _show(self, context):
        text = f"Reach: {length_text(context.scene.unit_settings, self.radius)}" if self._pull else "Moving a handle"
        self._view.area.header_text_set(text + _KEYS)
        brush_circle.show(self._view, Vector(self.point) + self._moved, self.radius)

    def _finish(self, context):
        """Ends with what was pulled."""
        ob, pull, moved = self._ob, self._pull, self._view and self._moved
        if moved is not None:  # for a repeat
            self.offset = moved
            if pull:
                self.handle_size = min(self._size / self.radius, _MOST_HELD)
        for remark in pull.remarks if pull else ():
            self.report({'WARNING'}, remark)
        if pull and pull.made_modifier and not self._applies and (behind := stack.names_kept_after(ob)):
            self.report({'INFO'}, f"Detail Deform stands before {', '.join(behind)}")
        result = self._end(context, {'FINISHED'})
        if pull and self._applies:
            try:
                bpy.ops.object.detail_deform_apply(remove_handles=True)
            except RuntimeError as problem:
                self.report({'ERROR'}, told(problem))
        _last.content = ob.name, sculpted.signature(ob)
        return result

    def _take_back(self, context):
        held, pull = self._held, self._pull
        result = self._end(context, {'CANCELLED'})
        if pull:
            pull.undo()
        elif held:
            held.move(Vector())
        return result

    def cancel(self, context):
        """Called when Blender ends the operator, as when its window is closed."""
        self._end(context, None)

    def _end(self, context, result):
        _under_way[:] = []
        brush_circle.end()
        if self._stages:
            self._stages.close()
        if self._progress:
            self._progress.end(context)
        if self._view:
            self._view.area.header_text_set(None)
            self._view.area.tag_redraw()
        self._view = self._ob = self._pull = self._stages = self._progress = self._held = None
        return result


class _Held:
    """The empty that is moved."""

    def __init__(self, ob, empty, axis=None):
        """axis: 0 to 2 where the drag is of its mirror image across the object's plane at right angles to it."""
        self._empty, self._at = empty, empty.matrix_world.copy()
        self._linear = Matrix.Identity(3)
        if axis is not None:
            flip = Matrix.Diagonal([-1.0 if k == axis else 1.0 for k in range(3)])
            self._linear = ob.matrix_world.to_3x3() @ flip @ ob.matrix_world.to_3x3().inverted_safe()

    def move(self, offset):
        """Moves it by an offset from where it was, in the world."""
        self._empty.matrix_world = Matrix.Translation(self._linear @ offset) @ self._at


def _check(ob):
    """Raises MeshProblem where a pull couldn't be computed or seen."""
    mesh_data.check_editable(ob)
    sculpted.check(ob)
    modifier = deform_modifier.find(ob)
    if modifier and not modifier.show_viewport:
        raise MeshProblem("The modifier of Detail Deform is hidden in the viewport, so no pull would be seen: show it "
                          "first.")


def _displayed(context, surface, ob):
    """(n, 3): what is seen of the mesh's own vertices, in local space."""
    found = displayed.positions(ob, context.evaluated_depsgraph_get())
    return surface.local if found is None else found


def _hit(context, surface, ob, origin, direction, is_line):
    """(vertex, face, world point) of the surface, as displayed, that a ray meets first; None if it meets none."""
    faces, to_local = mesh_data.faces_of_triangles(ob.data), ob.matrix_world.inverted_safe()
    hidden, shown = sculpted.hidden_faces(ob.data), slice(None)
    if hidden.any():
        shown = np.flatnonzero(~hidden[faces])
    found = picking.hit(_displayed(context, surface, ob), surface.triangles[shown], to_local @ origin,
                        to_local.to_3x3() @ direction, is_line)
    if found is None:
        return None
    return found.vertex, int(faces[shown][found.triangle]), ob.matrix_world @ Vector(found.point)


def _nearest(context, surface, ob, point):
    """(vertex, face) of the displayed surface that are nearest to a world point."""
    if not len(surface.triangles):
        raise MeshProblem(f"'{ob.name}' has no faces: there is no surface to pull.")
    point = np.float32(ob.matrix_world.inverted_safe() @ Vector(point))
    away = np.linalg.norm(_displayed(context, surface, ob) - point, axis=1)
    away[~np.isfinite(away)] = np.inf
    vertex = surface.triangles.ravel()[away[surface.triangles].argmin()]
    around = np.flatnonzero((surface.triangles == vertex).any(axis=1))
    triangle = around[away[surface.triangles[around]].sum(axis=1).argmin()]
    return int(vertex), int(mesh_data.faces_of_triangles(ob.data)[triangle])


register, unregister = bpy.utils.register_classes_factory([OBJECT_OT_detail_deform_brush_pull])
