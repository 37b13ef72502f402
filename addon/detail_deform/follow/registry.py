# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects that are bound or follow a source, known without going through the scene at every update.

Each of them has a modifier with our node group. So those who use that group tell when an object may have come or
gone by a way that isn't seen here, as by a copy or with another file: then, and after undo and loading, all objects
are looked at once. Objects are let go of before undo and loading, which replace them.
"""

import bpy

from ..scene import handle_matrices, mesh_data, node_group
from ..scene.mesh_data import MeshProblem
from . import shown

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
    known, uses = _members, node_group.uses()
    if known is None or uses != _uses or not all(map(_is_there, known)):
        known = [ob for ob in bpy.data.objects if _is_member(ob)]
        _members, _uses = known, uses
        shown.keep(ob.data for ob in known)  # one that was deleted may have left megabytes
    return [ob for ob in known if _is_member(ob)]


def of_scene(depsgraph):
    """Those in the scene that this depsgraph evaluates."""
    return [ob for ob in members() if handle_matrices.in_scene(ob, depsgraph)]


def check_mesh(ob):
    """As mesh_data.check_object, but for objects that have one mesh, as linked copies have: that which was bound, or
    began to follow, moves it for all. Raises MeshProblem."""
    if not (mesh_data.is_shared(ob.data) and _is_member(ob)):
        mesh_data.check_object(ob)
        return
    owner = _owner(ob)
    if owner != ob:
        raise MeshProblem(f"'{ob.name}' has the same mesh as '{owner.name}', which moves it for both: make it "
                          "single-user (Object > Relations > Make Single User > Object & Data) to move it alone.")
    mesh_data.check_editable(ob)
    mesh_data.check_left_edit_mode(ob)


def _owner(ob):
    """Of the objects with one mesh the one that began. A copy has the same settings, among them empties that are the
    first one's children, and its name."""
    of = ob.detail_deform
    parents = (handle.own_target.parent for handle in of.handles if handle.own_target)
    for first in (*parents, bpy.data.objects.get(of.begun_as)):
        if first and first.type == 'MESH' and first.data == ob.data and _is_member(first):
            return first
    return min((other for other in members() if other.data == ob.data), key=lambda other: other.name)


def forget():
    """They are to be looked for: one was bound or begins to follow, or all objects are about to be replaced or have
    been, by undo, redo or loading."""
    global _members
    _members = None
