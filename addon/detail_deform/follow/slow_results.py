# SPDX-License-Identifier: GPL-3.0-or-later
"""Slow results (in several steps, or by a slow method), computed in the background once an object's
handles rest.

Nothing here knows Blender's objects: a request has a name, starts a native.Update and hands its offsets
over.
"""

import time

import bpy

from ..library import native

# A drag moves the handles many times a second: work starts when that has paused for so long.
_PAUSE_SECONDS = 0.3
_TICK_SECONDS = 0.1


class _Request:
    def __init__(self, deformer, start, deliver, refuse, tell):
        self.deformer = deformer
        self.start, self.deliver, self.refuse, self.tell = start, deliver, refuse, tell
        self.job = None
        self.pause()

    def pause(self):
        self.due = time.monotonic() + _PAUSE_SECONDS

    def stop(self):
        if self.job:
            self.job.cancel()
            _ending.append(self.job)
            self.job = None


_requests = {}
_ending = []  # cancelled jobs, until they have ended: closing one waits for that


def request(name, deformer, start, deliver, refuse, tell):
    """start(wait) gives the native.Update of the deformer, deliver(offsets, info) takes its result, refuse(sentence)
    its error; tell() is called while it is under way. An earlier request of that name is forgotten."""
    cancel(name)
    _requests[name] = _Request(deformer, start, deliver, refuse, tell)
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=_PAUSE_SECONDS, persistent=True)


def cancel(name):
    pending = _requests.pop(name, None)
    if pending:
        pending.stop()


def make_way(deformer):
    """Stops what works with a deformer that another object needs now; it starts again after a pause."""
    for pending in _requests.values():
        if pending.deformer is deformer:
            pending.stop()
            pending.pause()


def finish(name):
    """Waits for the request of that name, if there is one."""
    pending = _requests.pop(name, None)
    if pending:
        pending.job = pending.job or pending.start(wait=True)
        pending.deliver(*pending.job.finish())


def progress(name):
    """None without a request, else the fraction done."""
    pending = _requests.get(name)
    if pending is None:
        return None
    return pending.job.progress()[1] if pending.job else 0.0


def _tick():
    for name, pending in list(_requests.items()):
        try:
            if pending.job is None:
                if time.monotonic() >= pending.due:
                    pending.job = pending.start(wait=False)
            elif not pending.job.progress()[0]:
                del _requests[name]
                pending.deliver(*pending.job.finish())
            else:
                pending.tell()
        except native.NativeError as error:
            if error.busy:  # another object's update is under way
                continue
            _requests.pop(name, None)
            pending.refuse(str(error))
    _ending[:] = [job for job in _ending if job.progress()[0]]
    return _TICK_SECONDS if _requests or _ending else None


def clear():
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    for job in [*(pending.job for pending in _requests.values() if pending.job), *_ending]:
        job.close()
    _requests.clear()
    _ending.clear()
