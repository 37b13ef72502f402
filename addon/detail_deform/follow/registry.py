# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects that are bound or follow a source, known without going through the scene at every update.

Each of them has a modifier with our node group. So those who use that group tell when an object may have come or
gone by a way that isn't seen here, as by a copy or with another file: then, and after undo and loading, all objects
are looked at once. Objects are let go of before undo and loading, which replace them.
"""

import bpy

from ..scene import handle_matrices, node_group

_members = None  # None: to be looked for
_uses = 0  # of the node group, when they were


def _is_member(ob):
    return ob.type == 'MESH' and bool(ob.detail_deform.signature or ob.detail_deform.transfer.live)


def _is_there(ob):
    try:
        return bool(ob.name)
    except ReferenceError:  # it was deleted
        return False


def members():
    """All objects of this file that are bound or follow a source."""
    global _members, _uses
    uses = node_group.uses()
    if _members is None or uses != _uses or not all(map(_is_there, _members)):
        _members, _uses = [ob for ob in bpy.data.objects if _is_member(ob)], uses
    return [ob for ob in _members if _is_member(ob)]


def add(ob):
    """To be told when an object is bound or begins to follow."""
    if _members is not None and ob not in _members:
        _members.append(ob)


def of_scene(depsgraph):
    """Those in the scene that this depsgraph evaluates."""
    return [ob for ob in members() if handle_matrices.in_scene(ob, depsgraph)]


def forget():
    """Objects are about to be replaced, or have been: by undo, redo or loading."""
    global _members
    _members = None
