# SPDX-License-Identifier: GPL-3.0-or-later
"""The slow result that is to take the place of a quick one."""

from ..library import native
from ..scene import offset_attribute
from ..scene.window import redraw_panels
from . import placed, registry, shown, slow_results, words

# A drag moves the handles many times a second: work starts when that has paused for so long.
_PAUSE_SECONDS, _DRAG_PAUSE_SECONDS = 0.3, 0.15


class SlowUpdate:
    """Work for slow_results: for whatever mesh still shows the quick result when this is done."""

    def __init__(self, ob, deformer, motions, asked, is_slow):
        """motions, asked: as the deformer's update() takes them. is_slow: not only put off by a drag."""
        self.token = offset_attribute.token(ob.data)
        self.deformer = deformer
        self._motions, self._asked, self._is_slow = motions, asked, is_slow
        self.pause = _PAUSE_SECONDS if is_slow else _DRAG_PAUSE_SECONDS

    def is_wanted(self):
        return bool(self._owners())

    def can_be_shown(self):
        """Not while all are edited."""
        return any(ob.mode != 'EDIT' for ob in self._owners())

    def _owners(self):
        return [ob for ob in registry.members()
                if ob.detail_deform.signature and offset_attribute.token(ob.data) == self.token]

    def start(self, wait):
        """The native.Update. wait: for another one that has the deformer in use. Raises native.NativeError."""
        return self.deformer.update(self._motions, wait=wait, **self._asked)

    def deliver(self, offsets, info):
        # Two meshes hold the same where one is a copy of the other.
        quick = [(ob, shown.by(ob.data)) for ob in self._owners() if ob.mode != 'EDIT']
        for ob, record in quick:
            if record is not None:
                shown.show_slow(ob.data, placed.offsets(ob, offsets, self.deformer.fades), record, info)
        redraw_panels()

    def refuse(self, error):
        """error: a native.NativeError."""
        for ob in self._owners():
            record, problem = shown.by(ob.data), words.said(ob, error)
            if record is not None:
                record.problem = problem
            ob.detail_deform.problem = problem
        redraw_panels()

    def run(self, wait):
        """wait: here and now, or when the handles pause."""
        if not wait:
            slow_results.request(self.token, self)
            return
        try:  # in a render another thread, which must not set up timers
            self.deliver(*self.start(wait=True).finish())
        except native.NativeError as error:
            self.refuse(error)

    def tell(self):
        if self._is_slow:
            redraw_panels()
