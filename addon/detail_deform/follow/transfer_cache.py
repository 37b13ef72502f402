# SPDX-License-Identifier: GPL-3.0-or-later
"""A cache of factored transfers, for repeated runs, as after an edit of the source's shape keys.

Keys are signatures of content, as in job_cache: equal meshes share an entry. When the cache is full, only entries that
the present run has not used are evicted: a repeated run over the same meshes in the same order then finds the others,
where LRU would find none.
"""

from .. import session
from ..scene import correspondence
from . import prepared_transfer

_MOST_BYTES = 1 << 30  # of all entries: trades memory for repeated factorizations; stated in the manual
_BYTES_A_ROW = 1400  # measured, for each row of the system and each vertex of the source

_kept = session.kept({}, session.Until.LOADED)  # {content: (Prepared, bytes)}
_used = session.kept(set(), session.Until.LOADED)  # contents that the present run has used


def begin_run():
    _used.clear()


def prepare(source, target, matched, settings):
    """Generator: yields the fraction done and returns the Prepared of these objects, from the cache if it is there.
    Raises MeshProblem or native.NativeError."""
    by = 'TOPOLOGY' if matched.is_by_topology else correspondence.digest_of(matched)
    content = prepared_transfer.content(source, target, by, settings, matched.relative_transform is not None)
    if content not in _kept:
        job = prepared_transfer.Preparation(source, target, matched, settings)
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
    """Adds an entry, evicting the oldest unused ones. Whether there was room."""
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
