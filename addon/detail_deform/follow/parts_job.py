# SPDX-License-Identifier: GPL-3.0-or-later
"""The binds of several parts (reaches.py), as one job with the interface of native's."""

import threading

from ..library import native
from .composed_deformer import Deformer


class PartsJob:
    def __init__(self, parts, jobs, vertex_count):
        self._parts, self._jobs, self._vertex_count = parts, jobs, vertex_count
        self._made = [None] * len(parts)
        self._drafts = [None] * len(parts)
        self._lock = threading.Lock()  # a render may call finish() while the window polls progress()
        self.cancelled = self._was_drafted = False
        self._failed = None

    def progress(self):
        """(running, fraction, stage)"""
        with self._lock:
            states = [(False, 1.0, 'DONE') if made else job.progress() for job, made in zip(self._jobs, self._made)]
        sizes = [len(part.positions) for part in self._parts]
        fraction = sum(size * state[1] for size, state in zip(sizes, states)) / sum(sizes)
        running = [state for state in states if state[0]]
        return bool(running), fraction, (running or states)[0][2]

    def draft(self):
        """As native.Bind.draft(): ready once each part has a draft or is bound."""
        with self._lock:
            if self._was_drafted or self._failed:
                return None
            for number, job in enumerate(self._jobs):
                if self._made[number] or self._drafts[number]:
                    continue
                self._drafts[number] = job.draft()
                if self._drafts[number] is None:
                    if job.progress()[0]:
                        return None
                    try:
                        self._finish(number)
                    except native.NativeError as error:
                        self._failed = error  # finish() raises it
                        self._cancel()
                        return None
            made = [draft or made for draft, made in zip(self._drafts, self._made)]
            self._was_drafted, self._drafts = True, [None] * len(made)
            return Deformer(self._parts, made, self._vertex_count)

    def _finish(self, number):
        with self._parts[number].in_numbers_of_all():
            self._made[number] = self._made[number] or self._jobs[number].finish()

    def cancel(self):
        with self._lock:
            self.cancelled = True
            self._cancel()

    def _cancel(self):
        for job in self._jobs:
            job.cancel()

    def finish(self):
        """Returns the composed Deformer, or raises native.NativeError."""
        with self._lock:
            try:
                if self._failed:
                    raise self._failed
                for number in range(len(self._parts)):
                    self._finish(number)
            except native.NativeError:
                self._close()
                raise
            return Deformer(self._parts, self._made, self._vertex_count)

    def close(self):
        with self._lock:
            self._close()

    def _close(self):
        for job in self._jobs:
            job.close()
