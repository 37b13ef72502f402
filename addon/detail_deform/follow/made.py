# SPDX-License-Identifier: GPL-3.0-or-later
"""What was made for objects to be followed: deformers, and transfers.

They are found by the content they were made for, a text that the objects keep. So nothing here points into Blender's
data: undo, redo, renaming and reloading find the same one again, or none.
"""

import threading

from ..library import native


class Entry:
    """What was made, and what is known about its use."""

    def __init__(self, made):
        self.made = made
        self.update_ms = 0.0
        self.full_ms = 0.0  # of the last update that was not hurried by a drag
        self.owners = set()  # whoever was found to have the content


class Cache:
    """Of one kind. It is made by jobs like those of native: with progress(), cancel(), cancelled, finish(), close(),
    and draft(), which gives what can stand in for it meanwhile, once, or None."""

    def __init__(self, spare):
        """spare: as many that no object asks for any more are kept for undo."""
        self._spare = spare
        self._entries = {}  # by content, as are the others
        self._jobs = {}
        self._drafts = {}  # of jobs, as entries
        self._failed = {}  # why it can't be made
        self._ending = []  # jobs that nobody asks for: closing one waits until it has ended
        self._finishing = threading.Lock()  # a render may wait for the same job as the window

    def find(self, content):
        return self._entries.get(content)

    def under_way(self, content):
        """The job, or None."""
        return self._jobs.get(content)

    def contents_under_way(self):
        return list(self._jobs)

    def is_running(self, content):
        """Whether the job is still at work."""
        job = self._jobs.get(content)
        return job is not None and job.progress()[0]

    def draft(self, content):
        """The entry of what stands in for what is being made; None where there is nothing."""
        job = self._jobs.get(content)
        if job is None or job.cancelled:
            return None
        made = job.draft()
        if made is not None:
            self._drafts[content] = Entry(made)
        return self._drafts.get(content)

    def start(self, content, begin):
        """begin() gives the job, unless what it makes is there or on its way. Raises native.NativeError."""
        present = self._jobs.get(content)
        if content in self._entries or (present and not present.cancelled):
            return
        self.let_go(content)
        self._jobs[content] = begin()

    def finish(self, content):
        """Waits for the job and keeps what it makes. Raises native.NativeError, here and when it is asked for again."""
        with self._finishing:
            self.check(content)
            if content in self._entries:
                self.let_go(content)
                return self._entries[content]
            job = self._pop(content)
            if job is None:  # let go of while this waited for another thread
                raise native.NativeError("It was cancelled.")
            try:
                entry = self._entries[content] = Entry(job.finish())
            except native.NativeError as error:
                self._failed[content] = error
                raise
            return entry

    def check(self, content):
        """Raises native.NativeError where it could not be made before."""
        if content in self._failed:
            failed = self._failed[content]
            raise native.NativeError(str(failed), failed.status, failed.vertices)

    def forget_failure(self, content):
        """It is tried again."""
        self._failed.pop(content, None)

    def cancel(self, content):
        """Who asks for it will be told when the job has ended."""
        job = self._jobs.get(content)
        if job:
            job.cancel()

    def let_go(self, content):
        """Cancels what nobody asks for any more."""
        self._forget_ended()
        job = self._pop(content)
        if job:
            job.cancel()
            self._ending.append(job)

    def _pop(self, content):
        """The job, which is under way no more."""
        self._drafts.pop(content, None)
        return self._jobs.pop(content, None)

    def _forget_ended(self):
        self._ending[:] = [job for job in self._ending if job.progress()[0]]

    def keep(self, contents, spares=True):
        """Forgets what none of these contents needs, but the newest as spares, and cancels what is being made for
        none of them."""
        for content in [content for content in self._jobs if content not in contents]:
            self.let_go(content)
        self._forget_ended()
        unused = [content for content in self._entries if content not in contents]
        for content in unused[:max(0, len(unused) - (self._spare if spares else 0))]:
            del self._entries[content]
        for content in [content for content in self._failed if content not in contents]:
            del self._failed[content]

    def forget_owners(self):
        """After undo, redo and loading they are others."""
        for entry in self._entries.values():
            entry.owners.clear()

    def clear(self):
        for job in [*self._jobs.values(), *self._ending]:
            job.close()
        for kept in (self._jobs, self._drafts, self._ending, self._entries, self._failed):
            kept.clear()
