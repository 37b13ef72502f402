# SPDX-License-Identifier: GPL-3.0-or-later
"""Work under way in a thread of the library."""

import ctypes

from .loading import Owned, call, vertices
from .structs import JOB_STATES, NativeError, Progress


class Job(Owned):
    """finish() waits for what the work makes, or raises NativeError; the job is over either way."""

    free = 'dd_job_free'

    def __init__(self, start, *arguments, call=call):
        """start: the function that starts it."""
        self.cancelled = False
        handle = ctypes.c_void_p()
        call(start, *arguments, handle)
        self._handle = handle

    def progress(self):
        """(running, fraction, stage)"""
        progress = Progress()
        call('dd_job_poll', self._handle, progress)
        return progress.state == JOB_STATES['RUNNING'], progress.fraction, progress.stage.decode()

    def cancel(self):
        """Takes effect soon, but not at once."""
        self.cancelled = True
        call('dd_job_cancel', self._handle)

    def _take(self, function):
        """What the work made, by one of the functions that take it."""
        made = ctypes.c_void_p()
        try:
            call(function, self._handle, made)
        except NativeError as error:
            error.vertices = vertices('dd_job_get_vertices', self._handle)
            raise
        finally:
            self.close()
        return made
