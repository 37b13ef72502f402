# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull: without interaction from scripts; in the window with a choice of the radius, then Move on the new empty."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from .. import session
from ..follow import messages
from ..library.options import FALLOFFS
from ..scene import handle_owners, mesh_data, stack, view
from ..scene.selection import activate
from ..setup import pulling
from . import edit_again
from .operator_base import MeshOperator, Progress, UnderWay
from .reach_choice import ReachChoice


_under_way = session.kept(UnderWay(), session.Until.DISABLED)
# Events that navigate the view, which pass through while the radius is chosen and while the object is bound.
_NAVIGATION = ('MIDDLEMOUSE', 'TRACKPAD', 'MOUSEROTATE', 'MOUSESMARTZOOM', 'NDOF')

RADIUS = {
    'name': "Radius", 'min': 0.0, 'subtype': 'DISTANCE',
    'description': "Distance along the surface up to which it follows, where no region was chosen. 0: by the size of "
                   "the selection"}
FALLOFF = {
    'name': "Falloff", 'items': FALLOFFS,
    'description': "How the motion falls off from the handle to the border. What it shares with other handles falls "
                   "off as before"}


class PullOperator(MeshOperator):
    """Polls for a mesh in Edit Mode, and for a handle's empty: Pull leaves its empty active, and Adjust Last Operation
    polls there before it undoes Pull and repeats it."""

    @classmethod
    def poll(cls, context):
        return handle_owners.handle_of(context.active_object)[0] is not None or super().poll(context)

    @classmethod
    def poll_object(cls, ob):
        return cls.in_edit_mode(ob)

    def pull_at_once(self, context, ob, message, wait=True, **options):
        """Pulls without interaction. message: what to do next. wait: until it is bound. options: those of
        pulling.Pull."""
        _check_mode(ob)
        pull = pulling.Pull(context, ob, self.radius, falloff=self.falloff, **options)
        # A repeat binds in the background: a slider of Adjust Last Operation must not block the window.
        for _ in pull.stages(wait=bpy.app.background or wait and not self.options.is_repeat):
            pass
        self.finished(context, ob, pull, message)

    def finished(self, context, ob, pull, message):
        self.radius = pull.radius
        activate(context, pull.empty)
        for remark in pull.remarks:
            self.report({'WARNING'}, remark)
        behind = stack.names_kept_after(ob) if pull.made_modifier else ()
        self.report({'INFO'}, message + (f". Detail Deform stands before {', '.join(behind)}" if behind else ""))


class OBJECT_OT_detail_deform_pull(PullOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_pull'
    bl_label = "Pull with Detail Deform"
    bl_description = ("All in one: a handle for the selected vertices, a region around it, and Bind. Choose how far it "
                      "reaches, then move the handle's empty: the surface follows")

    radius: FloatProperty(**RADIUS, options={'SKIP_SAVE'})
    stay: BoolProperty(
        name="Stay in Edit Mode",
        description="Once the empty was moved in the window go on in Edit Mode, for the next pull, not with the empty")
    falloff: EnumProperty(**FALLOFF)

    _ob = _choice = _pull = _stages = _progress = _view = None

    def run(self, context, ob):
        self.pull_at_once(context, ob, "Move the empty (G); F9 changes how far the region reaches")

    # In the window

    def invoke(self, context, event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        ob = self._ob = context.active_object
        self._view = view.chosen(context)
        edit_again.remember_edit_mode(context)
        try:
            mesh_data.check_editable(ob)
            _check_mode(ob)
            if self._view and not self.radius and pulling.may_set_region(ob):
                self._choice = ReachChoice(
                    context, self._view, ob, pulling.selected_distances(ob),
                    pulling.earlier_handles(ob, len(ob.detail_deform.handles)), event, self.stay, self.falloff)
            else:
                self._begin(context, ob)
        except messages.TOLD as problem:
            self.report({'ERROR'}, messages.sentence(problem))
            return {'CANCELLED'}
        context.window_manager.modal_handler_add(self)
        _under_way.append(self)
        return {'RUNNING_MODAL'}

    def _begin(self, context, ob):
        surface = self._choice.surface if self._choice else None
        self._pull = pulling.Pull(context, ob, self.radius, surface, self.falloff)
        self._stages = self._pull.stages(wait=False, watch=True)
        self._progress = Progress(context)
        self._tell(context, 0.0)

    def _tell(self, context, done):
        text = self._progress.show(context, "Preparing", done)
        if self._view:
            self._view.area.header_text_set(text)

    def modal(self, context, event):
        if self not in _under_way:  # the add-on was disabled meanwhile
            return {'CANCELLED'}
        if event.type.startswith(_NAVIGATION):
            return {'PASS_THROUGH'}
        try:
            return self._work(context, event) if self._stages else self._choose(context, event)
        except messages.TOLD as problem:
            self.report({'ERROR'}, messages.sentence(problem))
            return self._end(context, {'CANCELLED'})
        except Exception:
            self._end(context, None)
            raise

    def _choose(self, context, event):
        answer = self._choice.handle_event(context, event)
        if answer == 'CANCEL':
            return self._end(context, {'CANCELLED'})
        if answer == 'CONFIRM':
            self.radius, self.stay, self.falloff = self._choice.radius, self._choice.stay, self._choice.falloff
            self._choice.close(context)
            self._begin(context, self._ob)
        return {'RUNNING_MODAL'}

    def _work(self, context, event):
        if event.type == 'ESC':
            return self._end(context, {'CANCELLED'})
        if event.type != 'TIMER':
            return {'RUNNING_MODAL'}
        try:
            done = next(self._stages)
        except StopIteration:
            return self._hand_over(context)
        self._tell(context, done)
        return {'RUNNING_MODAL'}

    def _hand_over(self, context):
        """Ends, and starts Move: the new empty follows the mouse."""
        ob, pull, seen_in = self._ob, self._pull, self._view
        self._end(context, None)
        self.finished(context, ob, pull, "Move the empty, and click")
        if seen_in:
            with context.temp_override(area=seen_in.area, region=seen_in.region):
                move = bpy.ops.object.detail_deform_move_pulled if self.stay else bpy.ops.transform.translate
                move('INVOKE_DEFAULT')
        return {'FINISHED'}

    def cancel(self, context):
        """Called when Blender ends the operator, as when its window is closed."""
        self._end(context, None)

    def _end(self, context, result):
        _under_way[:] = []
        try:
            if self._choice:
                self._choice.close(context)
            if self._stages:
                self._stages.close()
        finally:
            if self._progress:
                self._progress.end(context)
            if self._view:
                self._view.area.header_text_set(None)
            self._ob = self._choice = self._pull = self._stages = self._progress = self._view = None
        return result


class OBJECT_OT_detail_deform_pull_curve(PullOperator, bpy.types.Operator):
    bl_idname = 'object.detail_deform_pull_curve'
    bl_label = "Pull by Curve with Detail Deform"
    bl_description = ("A curve along the selected vertices, such as an edge loop, a strip or a whole limb, becomes "
                      "their handle, with a region around it: move, tilt and scale its points, and the surface follows")

    points: IntProperty(
        name="Points", min=2, soft_max=16, max=64, default=5, description="Control points of the curve")
    radius: FloatProperty(**RADIUS, options={'SKIP_SAVE'})
    falloff: EnumProperty(**FALLOFF)

    _is_invoked = False

    def invoke(self, context, event):
        self._is_invoked = True
        return self.execute(context)

    def run(self, context, ob):
        # Edit Mode is left to the user: what is undone there goes back to the last step that was taken outside of it.
        message = "Press Tab, then move the curve's points (G), tilt (Ctrl+T) or scale (Alt+S) them"
        # Called by a person, it binds in the background, as Bind does.
        self.pull_at_once(context, ob, message, wait=not self._is_invoked, curve_points=self.points)


def _check_mode(ob):
    if ob.mode != 'EDIT':
        raise mesh_data.MeshProblem("Select vertices in Edit Mode to pull them.")


CLASSES = (OBJECT_OT_detail_deform_pull, OBJECT_OT_detail_deform_pull_curve)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
