# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfers that were factored, kept for when they are asked for again, as after an edit of the source's shape keys.

They are found by content, as in made: meshes that are alike share one. Where they are more than may be kept, those that
are kept stay, if the present run has used them: a run over the same meshes in the same order finds them again, where
keeping the newest would find none.
"""

from ..scene import correspondence
from . import prepared

_MOST_BYTES = 1 << 30
_BYTES_A_ROW = 1400  # measured: of the system's rows and the source's vertices alike

_kept = {}  # by content: (Prepared, bytes)
_used = set()  # contents, in this run


def begin_run():
    _used.clear()


def clear():
    _kept.clear()
    _used.clear()


def prepare(source, target, matched, how):
    """Generator of the fraction done; gives the Prepared of these objects. Raises MeshProblem or native.NativeError."""
    by = 'TOPOLOGY' if matched.is_by_topology else correspondence.digest_of(matched)
    content = prepared.content(source, target, by, how, matched.stance is not None)
    if content not in _kept:
        job = prepared.Preparation(source, target, matched, how)
        try:
            yield from job.fractions()
            found = job.finish()
        finally:
            job.close()
        if not _keep(content, found, _BYTES_A_ROW * (found.info.unknowns + len(source.data.vertices))):
            return found
    _used.add(content)
    return _kept[content][0]


def _keep(content, found, size):
    """Whether there was room."""
    if size > _MOST_BYTES:
        return False
    for other in [other for other in _kept if other not in _used]:
        if size + sum(each for _, each in _kept.values()) <= _MOST_BYTES:
            break
        del _kept[other]
    if size + sum(each for _, each in _kept.values()) > _MOST_BYTES:
        return False
    _kept[content] = found, size
    return True
