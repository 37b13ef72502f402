# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares edited meshes with the content that was bound: at once, or in the window when editing pauses."""

import bpy

from .. import session, timers
from ..scene.window import redraw_panels
from . import handle_follower, lifecycle, registry

# Without a further edit, before meshes are compared in the window: a paint stroke tags the mesh at every dab, a dragged
# slider of a shape key at every step.
_PAUSE_SECONDS = 0.3
_to_compare = session.kept(set(), session.Until.DISABLED)  # addresses of objects; never dereferenced
_ALL = None  # an entry that stands for all members: undo may change the addresses of objects


def note(members, edited):
    """Compares the members that a change of geometry affects. edited: data-blocks with changed geometry."""
    for ob in members:
        others = lifecycle.kind_of(ob).others(ob)
        if not lifecycle.is_known(ob) and (ob.data in edited or any(other.data in edited for other in others)):
            _edited(ob)  # not the object's own tag: it is set by any change of what its modifiers depend on
        base = ob.detail_deform.base_object
        if base and base.data in edited:
            handle_follower.check_base(ob)


def _edited(ob):
    if bpy.app.background:
        lifecycle.compare(ob)
        return
    _to_compare.add(ob.as_pointer())
    _timer.restart()


def _compare():
    chosen = [ob for ob in registry.members() if _ALL in _to_compare or ob.as_pointer() in _to_compare]
    _to_compare.clear()
    for ob in chosen:
        lifecycle.compare(ob)
    lifecycle.refresh_all(chosen, bpy.context.evaluated_depsgraph_get())
    redraw_panels()


def _forget_addresses():
    if _to_compare:
        _to_compare.add(_ALL)


_timer = timers.Timer(_compare, _PAUSE_SECONDS)
session.at(session.Until.REPLACED, _forget_addresses)
