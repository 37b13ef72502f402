# SPDX-License-Identifier: GPL-3.0-or-later
"""The prepared transfers of this Blender, found by the content they were made for, as deformers are by theirs.

Nothing here knows Blender's objects: a job has progress(), cancel(), finish() and close(), as those of the library.
"""

import threading

from ..library import native

# Transfers that no object asks for any more are kept for undo, up to this many.
_SPARE = 2


class Prepared:
    """A factored transfer, and whom it is known to fit."""

    def __init__(self, transfer):
        self.transfer = transfer
        self.key = object()  # as this one alone has it
        self.owners = set()  # that were found to have the content


_prepared = {}  # by content
_jobs = {}
_failed = {}  # by content: why it can't be prepared
_finishing = threading.Lock()  # a render may wait for the same job as the window


def find(content):
    return _prepared.get(content)


def under_way(content):
    """The job, or None."""
    return _jobs.get(content)


def contents_under_way():
    return list(_jobs)


def start(content, job):
    """Of what is neither there nor under way."""
    _jobs[content] = job


def finish(content):
    """Waits for the job and keeps its transfer. Raises native.NativeError, here and when it is asked for again."""
    with _finishing:
        check(content)
        if content not in _prepared:
            try:
                _prepared[content] = Prepared(_jobs.pop(content).finish())
            except native.NativeError as error:
                _failed[content] = str(error)
                raise
        return _prepared[content]


def cancel(content):
    job = _jobs.pop(content, None)
    if job:
        job.cancel()
        job.close()


def check(content):
    """Raises native.NativeError where it could not be prepared before."""
    if content in _failed:
        raise native.NativeError(_failed[content])


def forget_failure(content):
    """It is tried again."""
    _failed.pop(content, None)


def drop_unused(contents):
    """Forgets the oldest that none of the given contents needs."""
    unused = [content for content in _prepared if content not in contents]
    for content in unused[:max(0, len(unused) - _SPARE)]:
        del _prepared[content]
    for content in [content for content in _failed if content not in contents]:
        del _failed[content]


def forget_owners():
    """After undo, redo and loading."""
    for prepared in _prepared.values():
        prepared.owners.clear()


def clear():
    for content in list(_jobs):
        cancel(content)
    _prepared.clear()
    _failed.clear()
