# SPDX-License-Identifier: GPL-3.0-or-later
"""A cached list of the members: the objects that are bound or follow a source. Updates need not search the file.

Each member has a modifier with the add-on's node group. A changed user count of that group shows that a member may
have come or gone unnoticed, as by copying or appending: then, and after undo and loading, all objects are searched
once. The list is dropped before undo and loading, which replace the objects that it refers to.
"""

import bpy

from .. import session
from ..scene import deform_modifier, mesh_data, world_transforms
from ..scene.mesh_data import MeshProblem
from . import frame_results

# members: [object], None if unknown. uses: user count of the node group at the last search.
_known = session.Values(session.Until.REPLACED, members=None, uses=0)


def _is_member(ob):
    return ob.type == 'MESH' and bool(ob.detail_deform.signature or ob.detail_deform.transfer.live)


def _is_there(ob):
    try:
        return bool(ob.name)
    except ReferenceError:  # it was deleted
        return False


def members():
    """All objects of this file that are bound or follow a source."""
    known, uses = _known.members, deform_modifier.user_count()
    if known is None or uses != _known.uses or not all(map(_is_there, known)):
        known = [ob for ob in bpy.data.objects if _is_member(ob)]
        _known.members, _known.uses = known, uses
        frame_results.keep(ob.data for ob in known)  # the record of a deleted mesh may hold megabytes
    return [ob for ob in known if _is_member(ob)]


def of_scene(depsgraph):
    """The members in the scene that this depsgraph evaluates."""
    return [ob for ob in members() if world_transforms.in_scene(ob, depsgraph)]


def check_mesh(ob):
    """As mesh_data.check_object, but a member may share its mesh with other objects, as linked copies do, if it is the
    one that was bound or began to follow: it deforms the mesh for all. Raises MeshProblem."""
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
    """Of the objects that share a mesh, the one that was bound or began to follow. The settings of its copies tell:
    their empties are its children, and begun_as is its name. Else the first member by name."""
    of = ob.detail_deform
    parents = (handle.own_target.parent for handle in of.handles if handle.own_target)
    for first in (*parents, bpy.data.objects.get(of.begun_as)):
        if first and first.type == 'MESH' and first.data == ob.data and _is_member(first):
            return first
    return min((other for other in members() if other.data == ob.data), key=lambda other: other.name)


def forget():
    """Drops the list. To be called when an object is bound or begins to follow."""
    _known.clear()
