# SPDX-License-Identifier: GPL-3.0-or-later
"""Detects whether a handle is being dragged: updates follow one another, and the window's event loop runs in between.
During a script the loop doesn't run, and in playback each frame change calls ended()."""

from .. import session, timers

_TICK_SECONDS = 0.05
_PAUSE_TICKS = 10  # without an update, which end a drag: 0.5 s. Ticks, not time, as slow drawing delays them
_LIMIT_MS = 50.0  # longest time of an update during a drag: 20 frames a second


class _Drag:
    def __init__(self):
        self.goes_on = False  # whether the event loop has run since the first update
        self.ticks = 0  # since the last update


_drag = _Drag()


def updated():
    """To be called for each update of a scene."""
    _drag.ticks = 0
    _timer.start()


def _tick():
    _drag.ticks += 1
    _drag.goes_on = _drag.ticks < _PAUSE_TICKS
    return _TICK_SECONDS if _drag.goes_on else None


def share(full_ms):
    """The time that a drag leaves for an update, as a fraction of a full update's; 1 if nothing is being dragged.
    full_ms: the time of the last full update; 0 if unknown."""
    return min(1.0, _LIMIT_MS / full_ms) if _drag.goes_on and full_ms else 1.0


def ended():
    """To be called for frame changes."""
    _timer.stop()
    _drag.goes_on = False


_timer = timers.Timer(_tick, _TICK_SECONDS)
session.at(session.Until.REPLACED, ended)
