# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a handle is being dragged: updates come one after the other while the window goes on in between. A script
moves handles without letting it, and a frame that is played is no drag."""

import bpy

_TICK_SECONDS = 0.05
_PAUSE_TICKS = 10  # not a time: the window may take long to draw
# Of an update, from which on it keeps a drag from being fluent.
_LIMIT_MS = 50.0


class _Drag:
    def __init__(self):
        self.goes_on = False  # the window has, since the first update
        self.ticks = 0  # since the last one


_drag = _Drag()


def updated():
    """Something was moved, or changed otherwise."""
    _drag.ticks = 0
    if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=_TICK_SECONDS)


def _tick():
    _drag.ticks += 1
    _drag.goes_on = _drag.ticks < _PAUSE_TICKS
    return _TICK_SECONDS if _drag.goes_on else None


def share(full_ms):
    """Of the time that a whole update takes, how much there is now."""
    return min(1.0, _LIMIT_MS / full_ms) if _drag.goes_on and full_ms else 1.0


def ended():
    """A frame has come, or other data, or nothing more."""
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    _drag.goes_on = False
