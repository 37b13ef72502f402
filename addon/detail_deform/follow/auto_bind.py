# SPDX-License-Identifier: GPL-3.0-or-later
"""Re-binds stale objects automatically, keeping their pose, if that is quick. In the window only: scripts bind
explicitly."""

import bpy

from .. import timers
from ..scene.window import redraw_panels
from . import binding, handle_follower, messages, registry

_LIMIT_SECONDS = 0.5  # estimated time up to which an object is bound automatically; stated in the manual
_SECONDS_A_VERTEX = 1e-5  # upper bound for the time in which Python reads a mesh and its groups
# Without a further change, before binding: a dragged slider changes a setting many times a second.
_PAUSE_SECONDS = 0.2


def soon():
    """To be called when an object was found stale: binds it after a pause."""
    _timer.restart()


def _is_wanted(ob):
    settings = ob.detail_deform
    return bool(settings.signature and settings.stale and settings.auto_bind and settings.live and ob.mode != 'EDIT'
                and _seconds(ob) < _LIMIT_SECONDS)


def _seconds(ob):
    """Estimated time of a re-bind, from that of the last bind; infinite if that is unknown."""
    entry = handle_follower.cache.find(ob.detail_deform.signature)
    if entry is None:
        return float('inf')
    info, count = entry.made.info, len(ob.data.vertices)
    return info.bind_seconds * count / max(info.vertex_count, 1) + _SECONDS_A_VERTEX * count


def _bind_again():
    """Timer callback."""
    for ob in filter(_is_wanted, registry.of_scene(bpy.context.evaluated_depsgraph_get())):
        try:
            binding.bind(ob, bpy.context.evaluated_depsgraph_get(), wait=False, keep_rest=True)
        except messages.TOLD as problem:  # no report: the user may be in the middle of an edit
            ob.detail_deform.problem = messages.sentence(problem)
    redraw_panels()


_timer = timers.Timer(_bind_again, _PAUSE_SECONDS)
