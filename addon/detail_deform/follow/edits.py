# SPDX-License-Identifier: GPL-3.0-or-later
"""Edited meshes, compared with what was made for them: at once, or in the window when editing pauses."""

import bpy

from ..scene.window import redraw_panels
from . import bound, life, registry

# A paint stroke tags the mesh at every dab, a dragged slider of a shape key at every step: in the
# window comparing waits until that has paused for so long.
_PAUSE_SECONDS = 0.3
_to_compare = set()  # addresses of objects, which are only compared
_ALL = None  # among them: after undo objects may have other addresses


def note(members, edited):
    """edited: data-blocks whose geometry was changed."""
    for ob in members:
        others = life.kind_of(ob).others(ob)
        if not life.is_known(ob) and (ob.data in edited or any(other.data in edited for other in others)):
            _edited(ob)  # the object alone is tagged by whatever its modifiers depend on
        base = ob.detail_deform.base_object
        if base and base.data in edited:
            bound.check_base(ob)


def _edited(ob):
    if bpy.app.background:
        life.check(ob)
        return
    _to_compare.add(ob.as_pointer())
    _forget_to_compare()
    bpy.app.timers.register(_compare, first_interval=_PAUSE_SECONDS)


def _compare():
    chosen = [ob for ob in registry.members() if _ALL in _to_compare or ob.as_pointer() in _to_compare]
    _to_compare.clear()
    for ob in chosen:
        life.check(ob)
    life.refresh_all(chosen, bpy.context.evaluated_depsgraph_get())
    redraw_panels()


def _forget_to_compare():
    if bpy.app.timers.is_registered(_compare):
        bpy.app.timers.unregister(_compare)


def forget_addresses():
    """Before undo, redo and loading."""
    if _to_compare:
        _to_compare.add(_ALL)


def clear():
    _forget_to_compare()
    _to_compare.clear()
