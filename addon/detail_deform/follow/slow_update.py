# SPDX-License-Identifier: GPL-3.0-or-later
"""The computation of a slow result, which replaces a quick one."""

from ..library import native
from ..scene import offset_attribute
from ..scene.subject import Subject
from ..scene.window import redraw_panels
from . import frame_results, messages, registry, slow_results, written_offsets

# For which the handles must rest before the work starts: for a slow result, and for refinement that a drag has left
# out. A drag moves the handles many times a second.
_PAUSE_SECONDS, _DRAG_PAUSE_SECONDS = 0.3, 0.15


class SlowUpdate:
    """Work for slow_results. Its result goes to each mesh that still shows the quick one when it is done."""

    def __init__(self, ob, deformer, motions, arguments, is_slow):
        """motions, arguments: those of the deformer's update(), the latter by name. is_slow: whether the method or its
        steps are slow; else a drag has left out refinement."""
        self.token = offset_attribute.token(ob.data)
        self.deformer = deformer
        self._motions, self._arguments, self._is_slow = motions, arguments, is_slow
        self.pause = _PAUSE_SECONDS if is_slow else _DRAG_PAUSE_SECONDS

    def is_wanted(self):
        return bool(self._owners())

    def can_be_shown(self):
        """Whether any of the objects is out of Edit Mode."""
        return any(ob.mode != 'EDIT' for ob in self._owners())

    def _owners(self):
        return [ob for ob in registry.members()
                if ob.detail_deform.signature and offset_attribute.token(ob.data) == self.token]

    def start(self, wait):
        """Starts and returns the native.Update. wait: until the deformer is free, where native.NativeError says else
        that it is in use. Raises native.NativeError."""
        return self.deformer.update(self._motions, wait=wait, **self._arguments)

    def deliver(self, offsets, info):
        # A copy of a mesh has the same token, so one result may go to several objects.
        quick = [(ob, frame_results.by(ob.data)) for ob in self._owners() if ob.mode != 'EDIT']
        for ob, record in quick:
            if record is not None:
                slow = written_offsets.offsets(Subject(ob), offsets, self.deformer.fades)
                frame_results.show_slow(ob, slow, record, info)
        redraw_panels()

    def refuse(self, error):
        """error: a native.NativeError."""
        for ob in self._owners():
            record, problem = frame_results.by(ob.data), messages.said(ob, error)
            if record is not None:
                record.problem = problem
            ob.detail_deform.problem = problem
        redraw_panels()

    def run(self, wait):
        """wait: computes the result at once; else when the handles pause."""
        if not wait:
            slow_results.request(self.token, self)
            return
        try:  # maybe in the thread of a render, which must not register timers
            self.deliver(*self.start(wait=True).finish())
        except native.NativeError as error:
            self.refuse(error)

    def tell(self):
        if self._is_slow:
            redraw_panels()
