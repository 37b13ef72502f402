# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's timers, which stop when it is disabled."""

import bpy

from . import session

ALL = []  # every Timer that there is


class Timer:
    """A function that Blender's event loop calls, until it returns None instead of the seconds to the next call."""

    def __init__(self, function, seconds, through_loading=False):
        """seconds: to the first call. through_loading: goes on when another file is opened."""
        self._function, self._seconds, self._through_loading = function, seconds, through_loading
        session.at(session.Until.DISABLED, self.stop)
        ALL.append(self)

    def start(self):
        """Does nothing if it runs, or without a window: no event loop would call it."""
        if not bpy.app.background and not self.is_running():
            bpy.app.timers.register(self._function, first_interval=self._seconds, persistent=self._through_loading)

    def restart(self):
        """Waits the whole time again, if it runs."""
        self.stop()
        self.start()

    def is_running(self):
        return bpy.app.timers.is_registered(self._function)

    def stop(self):
        if self.is_running():
            bpy.app.timers.unregister(self._function)
