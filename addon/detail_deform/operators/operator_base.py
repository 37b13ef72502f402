# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes of the operators."""

import time

import bpy

from ..follow import messages
from ..scene import handle_owners, mesh_data

_TICK_SECONDS = 0.05  # interval of the timer, and the time for work in each call: 20 redraws a second
PATH_OPTIONS = {'SKIP_SAVE'} | ({'PATH_SUPPORTS_BLEND_RELATIVE'} if bpy.app.version >= (4, 5) else set())


def told(error):
    """What an operator has reported that was called from another one. error: the RuntimeError that this raised."""
    return str(error).replace("Error: ", "", 1).strip()


class MeshOperator:
    """Base of operators on a mesh object: undo, poll messages, and reports of errors. A subclass has run(context, ob),
    which returns the operator's result, or None for {'FINISHED'}."""
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def object_of(cls, context):
        """The object that the operator works on; poll() requires a mesh object."""
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
        except messages.TOLD as problem:
            self.report({'ERROR'}, messages.said(ob, problem))
            return {'CANCELLED'}
        if context.active_object and context.active_object.mode == 'EDIT':
            # An undo step in Edit Mode stores the mesh alone, unless data-blocks were added or removed. Undo must
            # restore the settings, too.
            bpy.data.texts.remove(bpy.data.texts.new("."))
        return result

    def check_usable(self, ob):
        """Raises MeshProblem if the operator must not change this object."""
        mesh_data.check_editable(ob)

    def value_or(self, name, otherwise):
        """The property's value if the caller has set it, else `otherwise`."""
        return getattr(self, name) if self.properties.is_property_set(name) else otherwise

    @classmethod
    def in_edit_mode(cls, ob):
        """poll_object() of operators on the vertices selected in Edit Mode."""
        if ob.mode != 'EDIT':
            cls.poll_message_set("Select vertices in Edit Mode")
            return False
        return True


class HandleEmptyOperator(MeshOperator):
    """Base of operators that also work while a handle's empty is active, on the mesh that it moves."""

    @classmethod
    def object_of(cls, context):
        return handle_owners.handle_of(context.active_object)[0] or context.active_object


class UnderWay(list):
    """The running modal operator, if there is one; clear() cancels it."""

    def clear(self):
        for operator in list(self):
            operator.cancel(bpy.context)


class Progress:
    """Progress of a modal operator in the cursor and the status bar, and the timer that wakes the operator."""

    def __init__(self, context):
        self._timer = context.window_manager.event_timer_add(_TICK_SECONDS, window=context.window)
        context.window_manager.progress_begin(0, 1)

    @staticmethod
    def show(context, task, done):
        """Shows the fraction done, and returns the status text."""
        text = f"{task}, {100 * done:.0f}%. Esc: cancel"
        context.window_manager.progress_update(done)
        context.workspace.status_text_set(text)
        return text

    def end(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)


class LongOperator(MeshOperator):
    """Base of operators whose work is a generator that yields the fraction done. If interactive, it runs modally, with
    progress and Esc; else it runs to its end at once."""
    task = ""  # text for the status bar
    interactive = False
    # Whether cancelling keeps a part of the work: then the operator finishes, with an undo step.
    keeps_partial_work = False
    _work = _progress = None

    def frame_range(self, context):
        """(first, last) frame: frame_start and frame_end of the operator where given, else of the scene."""
        return (self.value_or('frame_start', context.scene.frame_start),
                self.value_or('frame_end', context.scene.frame_end))

    def start(self, context, work):
        """Starts the work. Returns the result for run()."""
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
            self._progress.show(context, self.task, done)
        except StopIteration:
            return self._end(context, {'FINISHED'})
        except messages.TOLD as problem:
            self.report({'ERROR'}, messages.sentence(problem))
            return self._end(context)
        except Exception:
            self._end(context)
            raise
        return {'RUNNING_MODAL'}

    def cancel(self, context):
        """Called when Blender ends the operator, as when its window is closed."""
        if self._work:
            self._end(context)

    def _end(self, context, result=None):
        """Closes the work. Returns the result for modal(): the given one, or that of unfinished work."""
        try:
            self._work.close()
        finally:
            self._progress.end(context)
            self._work = self._progress = None
        self.interactive = False  # a repeat calls execute() without invoke()
        return result or ({'FINISHED'} if self.keeps_partial_work else {'CANCELLED'})
