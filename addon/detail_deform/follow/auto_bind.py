# SPDX-License-Identifier: GPL-3.0-or-later
"""What is no longer as it was bound is bound again by itself, with its pose, where that takes next to no time. In the
window only: scripts say when."""

import bpy

from ..scene.window import redraw_panels
from . import binding, bound, registry, words

_LIMIT_SECONDS = 0.5
_SECONDS_A_VERTEX = 1e-5  # at most, for what Python reads of a mesh
# A dragged slider changes a setting many times a second.
_PAUSE_SECONDS = 0.2


def soon():
    """Something was found to be stale."""
    if bpy.app.background:
        return
    clear()
    bpy.app.timers.register(_bind_again, first_interval=_PAUSE_SECONDS)


def clear():
    if bpy.app.timers.is_registered(_bind_again):
        bpy.app.timers.unregister(_bind_again)


def _is_wanted(ob):
    settings = ob.detail_deform
    return bool(settings.signature and settings.stale and settings.auto_bind and settings.live and ob.mode != 'EDIT'
                and _seconds(ob) < _LIMIT_SECONDS)


def _seconds(ob):
    """How long it takes about, by the last time."""
    entry = bound.cache.find(ob.detail_deform.signature)
    if entry is None:
        return float('inf')
    info, count = entry.made.info, len(ob.data.vertices)
    return info.bind_seconds * count / max(info.vertex_count, 1) + _SECONDS_A_VERTEX * count


def _bind_again():
    """Timer."""
    for ob in filter(_is_wanted, registry.of_scene(bpy.context.evaluated_depsgraph_get())):
        try:
            binding.bind(ob, bpy.context.evaluated_depsgraph_get(), wait=False, keep_rest=True)
        except words.TOLD as problem:  # the user is in the midst of it
            ob.detail_deform.problem = words.sentence(problem)
    redraw_panels()
