# SPDX-License-Identifier: GPL-3.0-or-later
"""The handle that an empty moves. Panels, gizmos and polls ask at every redraw, so the answer is memoized: all objects
are searched once for an empty, and again only after a handle has got another empty or objects have come or gone."""

import bpy

from .. import session

TYPES = {'EMPTY', 'CURVE', 'ARMATURE'}  # of objects that may move a handle
# owners: {address of an empty: name of its handle's object, or None where it moves no handle}. object_count: when they
# were searched.
_known = session.Values(session.Until.REPLACED, owners={}, object_count=-1)


def handle_of(empty):
    """(ob, number): the mesh object and the number of the handle that this empty moves; (None, -1) if there is none."""
    if empty is None or empty.type not in TYPES:
        return None, -1
    index = _index(empty.parent, empty)  # the usual owner
    if index >= 0:
        return empty.parent, index
    if _known.object_count != len(bpy.data.objects):
        forget()
        _known.object_count = len(bpy.data.objects)
    key = empty.as_pointer()
    if key in _known.owners:
        if _known.owners[key] is None:
            return None, -1
        ob = bpy.data.objects.get(_known.owners[key])
        index = _index(ob, empty)
        if index >= 0:  # else it was renamed, or the handle is gone
            return ob, index
    found = _searched(empty)
    _known.owners[key] = found[0].name if found[0] else None
    return found


def forget():
    """To be called when a handle gets another empty."""
    _known.clear()


def _searched(empty):
    for ob in bpy.data.objects:
        index = _index(ob, empty)
        if index >= 0:
            return ob, index
    return None, -1


def _index(ob, empty):
    if ob is not None and ob.type == 'MESH':
        for index, handle in enumerate(ob.detail_deform.handles):
            if handle.target == empty:
                return index
    return -1
