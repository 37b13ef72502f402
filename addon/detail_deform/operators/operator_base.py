# SPDX-License-Identifier: GPL-3.0-or-later
"""What all operators share."""

import time

import bpy

from ..follow import words
from ..scene import mesh_data
from ..setup import handle_setup

_TICK_SECONDS = 0.05
PATH_OPTIONS = {'SKIP_SAVE'} | ({'PATH_SUPPORTS_BLEND_RELATIVE'} if bpy.app.version >= (4, 5) else set())


class MeshOperator:
    """Undo, a poll message, and a report for every sentence the user should see."""
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def object_of(cls, context):
        """What it works on, a mesh object if it can be found."""
        return context.active_object

    @classmethod
    def poll(cls, context):
        ob = cls.object_of(context)
        if ob is None or ob.type != 'MESH':
            cls.poll_message_set("Select a mesh object")
            return False
        return cls.poll_object(ob)

    @classmethod
    def poll_object(cls, ob):
        return True

    def execute(self, context):
        ob = self.object_of(context)
        try:
            self.check_usable(ob)
            result = self.run(context, ob) or {'FINISHED'}
        except words.TOLD as problem:
            self.report({'ERROR'}, words.said(ob, problem))
            return {'CANCELLED'}
        if context.active_object and context.active_object.mode == 'EDIT':
            # A step of undo in Edit Mode holds the mesh alone, unless data-blocks have come or gone: the
            # settings must go back with it.
            bpy.data.texts.remove(bpy.data.texts.new("."))
        return result

    def check_usable(self, ob):
        """Raises MeshProblem where it may not work on this object."""
        mesh_data.check_editable(ob)

    def given(self, name, otherwise):
        """A property's value where the caller has set it."""
        return getattr(self, name) if self.properties.is_property_set(name) else otherwise

    @classmethod
    def in_edit_mode(cls, ob):
        """For poll_object of what takes the vertices selected in Edit Mode."""
        if ob.mode != 'EDIT':
            cls.poll_message_set("Select vertices in Edit Mode")
            return False
        return True


class HandOperator(MeshOperator):
    """Also while an empty is active, for the mesh that it pulls."""

    @classmethod
    def object_of(cls, context):
        return handle_setup.owner(context.active_object)[0] or context.active_object


class Progress:
    """What the window shows while an operator works: the cursor and the status bar, and the timer that wakes it."""

    def __init__(self, context):
        self._timer = context.window_manager.event_timer_add(_TICK_SECONDS, window=context.window)
        context.window_manager.progress_begin(0, 1)

    @staticmethod
    def tell(context, doing, done):
        """Returns the text."""
        text = f"{doing}, {100 * done:.0f}%. Esc: cancel"
        context.window_manager.progress_update(done)
        context.workspace.status_text_set(text)
        return text

    def end(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)


class LongOperator(MeshOperator):
    """Work that goes on for a while, as a generator that yields the fraction done: from the window (interactive)
    with progress and Esc, from scripts at once."""
    doing = ""  # as the status bar says it
    interactive = False
    keeps_part = False  # whether something was done that stays when the rest is cancelled: then undo takes it back
    _work = _progress = None

    def frame_range(self, context):
        """First and last frame, of those that work on frames: the scene's unless given."""
        return (self.given('frame_start', context.scene.frame_start),
                self.given('frame_end', context.scene.frame_end))

    def start(self, context, work):
        """What run() returns."""
        self._work = work
        if not self.interactive:
            for _ in work:
                pass
            return None
        self._progress = Progress(context)
        context.window_manager.modal_handler_add(self)
        return {'RUNNING_MODAL'}

    def modal(self, context, event):
        if event.type == 'ESC':
            return self._end(context)
        if event.type != 'TIMER':
            return {'RUNNING_MODAL'}
        until = time.monotonic() + _TICK_SECONDS
        try:
            while time.monotonic() < until:
                done = next(self._work)
            self._progress.tell(context, self.doing, done)
        except StopIteration:
            return self._end(context, {'FINISHED'})
        except words.TOLD as problem:
            self.report({'ERROR'}, words.sentence(problem))
            return self._end(context)
        except Exception:
            self._end(context)
            raise
        return {'RUNNING_MODAL'}

    def cancel(self, context):
        """Blender ends it by itself, as when its window is closed."""
        if self._work:
            self._end(context)

    def _end(self, context, result=None):
        """What modal() returns: result, or what is right for work that was cut short."""
        try:
            self._work.close()
        finally:
            self._progress.end(context)
            self._work = self._progress = None
        self.interactive = False  # it may be repeated without a dialog
        return result or ({'FINISHED'} if self.keeps_part else {'CANCELLED'})
