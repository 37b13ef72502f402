# SPDX-License-Identifier: GPL-3.0-or-later
"""The vertices with the problems that the status reports: all of them, where a sentence names one as an example."""

import numpy as np

from .. import session
from . import handle_follower, written_offsets

# Findings that native.Deformer.info counts, and of which the status names an example.
_FINDINGS = ('RESTING', 'LOOSE', 'FAR', 'TORN', 'DEGENERATE', 'UNREPRESENTED')
_IF_STAYING = {'RESTING': 'staying', 'LOOSE': 'loose'}  # those that may ride: the field of loose_parts.Counts
_HARMLESS = 'DEGENERATE'
_refused = session.Memo(8)  # {object's name: (problem, vertex count of the mesh, vertices with the problem)}


def note(ob, error):
    """Stores the vertices that an error is about, until the object's next one. error: a native.NativeError."""
    _refused.drop(ob.name)
    if len(error.vertices):
        _refused.put(ob.name, (ob.detail_deform.problem, len(ob.data.vertices), error.vertices))


def _of_refusal(ob):
    problem, count, vertices = _refused.get(ob.name, ("", 0, ()))
    # Undo, another mesh or renaming may have made the entry invalid.
    return vertices if problem and (problem, count) == (ob.detail_deform.problem, len(ob.data.vertices)) else ()


def _findings(ob):
    """(deformer, its findings that the status reports); (None, ()) if the status reports a problem instead."""
    settings = ob.detail_deform
    entry = handle_follower.cache.find(settings.signature)
    if entry is None or settings.stale or settings.problem or not handle_follower.is_for(ob, entry):
        return None, ()
    info = entry.made.info
    return entry.made, [finding for finding in _FINDINGS if getattr(info, f'{finding.lower()}_count')
                        and (finding not in _IF_STAYING or _some_stay(ob, finding))
                        and (finding != 'UNREPRESENTED' or settings.method == 'NORMAL')]


def _some_stay(ob, finding):
    riding = written_offsets.riding_if_known(ob)
    return riding is None or getattr(riding.counts, _IF_STAYING[finding]) > 0


def are_known(ob):
    """Whether there are any. Cheap enough for each drawing of a panel."""
    return len(_of_refusal(ob)) > 0 or len(_findings(ob)[1]) > 0


def need_a_look(ob):
    """Whether there are any besides those of harmless findings."""
    return len(_of_refusal(ob)) > 0 or any(finding != _HARMLESS for finding in _findings(ob)[1])


def of(ob):
    """(n,) bool: the vertices with any of the problems."""
    chosen = np.zeros(len(ob.data.vertices), bool)
    chosen[np.asarray(_of_refusal(ob), np.intp)] = True
    deformer, findings = _findings(ob)
    for finding in findings:
        found = deformer.vertices(finding)
        riding = written_offsets.riding_if_known(ob) if finding in _IF_STAYING else None
        chosen[found if riding is None else np.setdiff1d(found, riding.vertices)] = True
    return chosen
