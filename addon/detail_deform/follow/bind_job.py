# SPDX-License-Identifier: GPL-3.0-or-later
"""A bind, then a first update, both in the background: the first update prepares the method, which takes long too."""

import threading


from ..library import native

# Fraction of the progress that is the bind's. By the ratios in native/bench/RESULTS.md it takes 0.6 to 0.7 of both
# times.
_SHARE_OF_BIND = 0.7
_STAGE = "preparing the first update"


class BindJob:
    """Has the interface of native's jobs. progress() starts the update once the bind has ended. finish() alone, as in a
    render, only binds."""

    def __init__(self, bind, handle_count, arguments):
        """bind: the native.Bind. arguments: those of the update, as for update_options() of library/deformer.py."""
        self._bind, self._update, self._deformer, self._error = bind, None, None, None
        self._rest = native.at_rest(handle_count)
        self._arguments = arguments
        self._lock = threading.Lock()  # a render may call finish() while the window polls progress()
        self.cancelled = False

    def progress(self):
        """(running, fraction, stage)"""
        with self._lock:
            if self._bind:
                running, fraction, stage = self._bind.progress()
                if running or self.cancelled or not self._prepare():
                    return running, _SHARE_OF_BIND * fraction, stage
            if self._update:
                running, fraction, _ = self._update.progress()
                return running, _SHARE_OF_BIND + (1 - _SHARE_OF_BIND) * fraction, _STAGE
            return False, 1.0, _STAGE

    def _prepare(self):
        """Finishes the bind and starts the update. Whether both succeeded."""
        bind, self._bind = self._bind, None
        try:
            self._deformer = bind.finish()
        except native.NativeError as error:
            self._error = error
            return False
        try:
            self._update = self._deformer.update(self._rest, **self._arguments)
        except native.NativeError:  # the next update raises it again
            return False
        return True

    def draft(self):
        """As native.Bind.draft()."""
        with self._lock:
            return self._bind.draft() if self._bind else None

    def cancel(self):
        with self._lock:
            self.cancelled = True
            for job in filter(None, (self._bind, self._update)):
                job.cancel()

    def finish(self):
        """Returns the native.Deformer, or raises native.NativeError."""
        with self._lock:
            if self._bind:
                bind, self._bind = self._bind, None
                self._deformer = bind.finish()
            if self._error:
                raise self._error
            if self._update:
                self._update.close()
            if self.cancelled:
                raise native.NativeError("It was cancelled.")
            return self._deformer

    def close(self):
        with self._lock:
            for job in filter(None, (self._bind, self._update)):
                job.close()
            self._bind = self._update = self._deformer = None
