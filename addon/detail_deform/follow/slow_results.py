# SPDX-License-Identifier: GPL-3.0-or-later
"""Slow results (in several steps, by a slow method, or with refinement that a drag has left out), computed in the
background once an object's handles rest.

Nothing here refers to Blender's objects: a request has a token, starts a native.Update and passes on its offsets.
"""

import time

from .. import session, timers
from ..library import native

_TICK_SECONDS = 0.1  # interval of the timer


class _Request:
    def __init__(self, work):
        self.work = work
        self.job = None
        self.fraction = 0.0  # of the job when it was last polled
        self.pause()

    def pause(self):
        self.due = time.monotonic() + self.work.pause

    def stop(self):
        if self.job:
            self.job.cancel()
            _requests.ending.append(self.job)
            self.job, self.fraction = None, 0.0


class _Requests(dict):
    """{token: _Request}"""

    def __init__(self):
        super().__init__()
        self.ending = []  # cancelled jobs; they are closed when they have ended, as closing waits for that

    def clear(self):
        for job in [*(pending.job for pending in self.values() if pending.job), *self.ending]:
            job.close()
        self.ending.clear()
        super().clear()


_requests = session.kept(_Requests(), session.Until.DISABLED)


def request(token, work):
    """Requests a slow result. After handles have paused for work.pause seconds, work.start(wait) must return a
    native.Update of work.deformer. While that runs, work.tell() is called. Its result is passed to
    work.deliver(offsets, info) once work.can_be_shown(), its error to work.refuse(error). The request ends when
    work.is_wanted() is false."""
    cancel(token)
    _requests[token] = _Request(work)
    _timer.start()


def cancel(token):
    pending = _requests.pop(token, None)
    if pending:
        pending.stop()


def make_way(deformer):
    """Stops requests that use a deformer which another object needs at once; they start again after a pause."""
    for pending in _requests.values():
        if pending.work.deformer is deformer:
            pending.stop()
            pending.pause()


def finish(token):
    """Waits for the result of a request, if there is one."""
    pending = _requests.pop(token, None)
    if pending:
        pending.job = pending.job or pending.work.start(wait=True)
        pending.work.deliver(*pending.job.finish())


def progress(token):
    """The finished fraction of a request when it was last polled (see job_cache.Cache.progress); None if there is
    none."""
    pending = _requests.get(token)
    return pending.fraction if pending else None


def _go_on(token, pending):
    if not pending.work.is_wanted():
        cancel(token)
        return
    if pending.job is None:
        if time.monotonic() >= pending.due:
            pending.job = pending.work.start(wait=False)
        return
    running, pending.fraction, _ = pending.job.progress()
    if running:
        pending.work.tell()
    elif pending.work.can_be_shown():
        del _requests[token]
        pending.work.deliver(*pending.job.finish())


def _tick():
    for token, pending in list(_requests.items()):
        try:
            _go_on(token, pending)
        except native.NativeError as error:
            if error.busy:  # another object's update is under way
                continue
            cancel(token)
            pending.work.refuse(error)
        except Exception:
            cancel(token)  # an error ends the timer, and nothing else would end the request
            raise
    _requests.ending = [job for job in _requests.ending if job.progress()[0]]
    return _TICK_SECONDS if _requests or _requests.ending else None


_timer = timers.Timer(_tick, _TICK_SECONDS, through_loading=True)
