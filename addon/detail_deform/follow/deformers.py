# SPDX-License-Identifier: GPL-3.0-or-later
"""The bound deformers of this Blender.

They are found by the signature of the content they were made for (positions, topology, roles,
options), which the object stores. So nothing here points into Blender's data: undo, redo, renaming
and reloading find the same deformer again, or none.
"""

import threading

from ..library import native

# Deformers that no object asks for any more are kept for undo, up to this many.
_SPARE = 3


class Bound:
    """A deformer and what is known about its use."""

    def __init__(self, deformer, bind_ms):
        self.deformer = deformer
        self.bind_ms = bind_ms
        self.update_ms = 0.0


_bound = {}
_binds = {}
_ending = []  # cancelled binds whose place was taken: they end when their stage does
_finishing = threading.Lock()  # a render may wait for the same bind as the window


def find(signature):
    return _bound.get(signature)


def bind_under_way(signature):
    return _binds.get(signature)


def binds_under_way():
    return list(_binds)


def start(signature, *arguments, **options):
    """Starts native.Bind(*arguments, **options) unless the deformer is there or on its way."""
    present = _binds.get(signature)
    if signature in _bound or (present and not present.cancelled):
        return
    if present:
        _ending.append(present)
    _binds[signature] = native.Bind(*arguments, **options)


def is_running(signature):
    """Whether the bind is still at work; also lets go of cancelled ones that are not."""
    _ending[:] = [bind for bind in _ending if bind.progress()[0]]
    bind = _binds.get(signature)
    return bind is not None and bind.progress()[0]


def finish(signature):
    """Waits for the bind and keeps its deformer. Raises native.NativeError."""
    with _finishing:
        if signature not in _bound:
            deformer = _binds.pop(signature).finish()
            _bound[signature] = Bound(deformer, 1e3 * deformer.info.bind_seconds)
        return _bound[signature]


def drop_unused(signatures):
    """Forgets the oldest deformers that none of the given signatures needs."""
    unused = [signature for signature in _bound if signature not in signatures]
    for signature in unused[:max(0, len(unused) - _SPARE)]:
        del _bound[signature]


def clear():
    for bind in [*_binds.values(), *_ending]:
        bind.close()
    _binds.clear()
    _ending.clear()
    _bound.clear()
