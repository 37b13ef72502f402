# SPDX-License-Identifier: GPL-3.0-or-later
"""Work under way in a thread of the library."""

import time

from .loading import Owned, call, vertices
from .structs import JOB_STATES, NativeError, Progress, name_of

_POLL_SECONDS = 0.02


class Job(Owned):
    """finish() waits for what the work makes, or raises NativeError; the job is over either way."""

    free = 'dd_job_free'

    def __init__(self, start, *arguments, call=call):
        """start: the function that starts it."""
        self.cancelled = False
        self._make(start, *arguments, call=call)

    def progress(self):
        """(running, fraction, stage): a name of structs.STAGES."""
        progress = Progress()
        call('dd_job_poll', self, progress)
        return progress.state == JOB_STATES['RUNNING'], progress.fraction, name_of('dd_stage', progress.stage)

    def fractions(self):
        """Generator of the fraction done, until it is over."""
        running = True
        while running:
            running, fraction, _ = self.progress()
            yield fraction
            if running:
                time.sleep(_POLL_SECONDS)

    def cancel(self):
        """Takes effect soon, but not at once."""
        self.cancelled = True
        call('dd_job_cancel', self)


class JobResult(Owned):
    """What a job has made. Constructing it takes the object over from the job, which is over then."""

    take_function = None  # name of the library's function that takes it over

    def __init__(self, job):
        """Waits; the job is over, or raises NativeError."""
        try:
            self._make(self.take_function, job)
        except NativeError as error:
            error.vertices = vertices('dd_job_get_vertices', job)
            raise
        finally:
            job.close()
