# SPDX-License-Identifier: GPL-3.0-or-later
"""The vertices that the status speaks of: where a sentence names one, all of them."""

import numpy as np

from . import bound

# What a bound surface's facts count, and the status names one of.
_FINDINGS = ('RESTING', 'LOOSE', 'FAR', 'TORN', 'DEGENERATE', 'UNREPRESENTED')
_HARMLESS = 'DEGENERATE'
_MOST = 8
_refused = {}  # by the object's name: what was said, of how many vertices, and which


def note(ob, error):
    """Keeps what a refusal is about, until another one comes. error: a native.NativeError."""
    _refused.pop(ob.name, None)
    while len(_refused) >= _MOST:
        del _refused[next(iter(_refused))]
    if len(error.vertices):
        _refused[ob.name] = (ob.detail_deform.problem, len(ob.data.vertices), error.vertices)


def _of_refusal(ob):
    problem, count, vertices = _refused.get(ob.name, ("", 0, ()))
    # Undo, another mesh or another name may have come in between.
    return vertices if problem and (problem, count) == (ob.detail_deform.problem, len(ob.data.vertices)) else ()


def _findings(ob):
    """The deformer and what it found that the status speaks of, which is nothing where it has a problem to tell."""
    settings = ob.detail_deform
    entry = bound.cache.find(settings.signature)
    if entry is None or settings.stale or settings.problem or not bound.is_for(ob, entry):
        return None, ()
    info = entry.made.info
    return entry.made, [finding for finding in _FINDINGS if getattr(info, f'{finding.lower()}_count')
                        and (finding != 'UNREPRESENTED' or settings.method == 'NORMAL')]


def are_known(ob):
    """Cheap enough to be asked whenever a panel is drawn."""
    return len(_of_refusal(ob)) > 0 or len(_findings(ob)[1]) > 0


def need_a_look(ob):
    """Whether there are any of which the status says something urgent."""
    return len(_of_refusal(ob)) > 0 or any(finding != _HARMLESS for finding in _findings(ob)[1])


def of(ob):
    """(n,) bool"""
    chosen = np.zeros(len(ob.data.vertices), bool)
    chosen[np.asarray(_of_refusal(ob), np.intp)] = True
    deformer, findings = _findings(ob)
    for finding in findings:
        chosen[deformer.vertices(finding)] = True
    return chosen
