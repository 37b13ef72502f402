# SPDX-License-Identifier: GPL-3.0-or-later
"""Caches of deformers and transfers, keyed by a signature of the content that they were made for.

The objects store the signature as a text, so nothing here refers to Blender's data: after undo, redo, renaming or
reloading the same entry is found again, or none.
"""

import threading

from .. import session
from ..library import native


class Entry:
    """A deformer or transfer, and figures of its use."""

    def __init__(self, made):
        self.made = made
        self.update_ms = 0.0
        self.full_ms = 0.0  # of the last update with all refinement
        self.owners = set()  # source_follower._owner() of each object whose content is known to be this one


class Cache:
    """The entries of one kind, and the jobs that make them. Jobs have the methods of native.Bind: progress(), cancel(),
    cancelled, finish(), close(), and draft(), which returns a rough deformer the first time that it is ready, else
    None."""

    def __init__(self, spare):
        """spare: the number of unused entries, the newest ones, that are kept so that undo finds them."""
        self._spare = spare
        self._entries = {}  # by signature, like the next three
        self._jobs = {}
        self._drafts = {}  # entries with the drafts of jobs
        self._progress = {}  # of jobs, as progress() returns it
        self._failed = {}  # native.NativeError of jobs that failed
        self._ending = []  # cancelled jobs; closing one waits until its thread has ended
        self._finishing = threading.Lock()  # a render and the window may wait for the same job
        session.at(session.Until.REPLACED, self._forget_owners)
        session.at(session.Until.DISABLED, self.clear)

    def find(self, content):
        return self._entries.get(content)

    def under_way(self, content):
        """The job, or None."""
        return self._jobs.get(content)

    def contents_under_way(self):
        return list(self._jobs)

    def poll(self, content):
        """Whether the job is still at work. Takes its progress."""
        job = self._jobs.get(content)
        if job is None:
            return False
        running, *self._progress[content] = job.progress()
        return running

    def progress(self, content):
        """(fraction, stage) of the job when it was last polled. Texts of properties are made of this, as Blender calls
        their getters twice, for the length and for the characters, and writes past the end if they have grown."""
        return self._progress.get(content, (1.0, 'DONE'))  # a render may have ended the job meanwhile

    def draft(self, content):
        """The entry with the draft of a job that is under way, or None."""
        job = self._jobs.get(content)
        if job is None or job.cancelled:
            return None
        made = job.draft()
        if made is not None:
            self._drafts[content] = Entry(made)
        return self._drafts.get(content)

    def has_draft(self, content):
        """Whether draft() has returned an entry."""
        return content in self._drafts

    def start(self, content, begin):
        """Starts the job that begin() returns, unless the entry exists or its job is under way. Raises
        native.NativeError."""
        present = self._jobs.get(content)
        if content in self._entries or (present and not present.cancelled):
            return
        self.let_go(content)
        self._jobs[content] = begin()
        self.poll(content)

    def finish(self, content):
        """Waits for the job and returns the new entry. If the job fails, raises native.NativeError, and again each time
        until forget_failure()."""
        with self._finishing:
            self.raise_failure(content)
            if content in self._entries:
                self.let_go(content)
                return self._entries[content]
            job = self._pop(content)
            if job is None:  # cancelled while this waited for another thread
                raise native.NativeError("It was cancelled.")
            try:
                entry = self._entries[content] = Entry(job.finish())
            except native.NativeError as error:
                self._failed[content] = error
                raise
            return entry

    def raise_failure(self, content):
        """Raises native.NativeError if the job has failed before."""
        if content in self._failed:
            failed = self._failed[content]
            raise failed.about(failed.index, failed.vertices)

    def forget_failure(self, content):
        """Lets the job be tried again."""
        self._failed.pop(content, None)

    def cancel(self, content):
        """Cancels the job. finish() raises once it has ended."""
        job = self._jobs.get(content)
        if job:
            job.cancel()

    def let_go(self, content):
        """Cancels a job whose result no object needs any more, without waiting for its end."""
        self._forget_ended()
        job = self._pop(content)
        if job:
            job.cancel()
            self._ending.append(job)

    def _pop(self, content):
        """Removes the job and what is kept of it, and returns it, or None."""
        self._drafts.pop(content, None)
        self._progress.pop(content, None)
        return self._jobs.pop(content, None)

    def _forget_ended(self):
        self._ending[:] = [job for job in self._ending if job.progress()[0]]

    def keep(self, contents, spares=True):
        """Drops entries, failures and jobs of all other contents. spares: keeps the newest unused entries."""
        for content in [content for content in self._jobs if content not in contents]:
            self.let_go(content)
        self._forget_ended()
        unused = [content for content in self._entries if content not in contents]
        for content in unused[:max(0, len(unused) - (self._spare if spares else 0))]:
            del self._entries[content]
        for content in [content for content in self._failed if content not in contents]:
            del self._failed[content]

    def _forget_owners(self):
        for entry in self._entries.values():
            entry.owners.clear()

    def clear(self):
        for job in [*self._jobs.values(), *self._ending]:
            job.close()
        for kept in (self._jobs, self._drafts, self._progress, self._ending, self._entries, self._failed):
            kept.clear()
