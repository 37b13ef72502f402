# SPDX-License-Identifier: GPL-3.0-or-later
"""Which result was last written to each mesh, found by the token that is stored with the offsets.

Copies, undo and other add-ons change meshes without a notice. As the token goes along with the offsets, a mesh is never
mistaken for one that shows the present result of its object.
"""

import copy

import numpy as np

from .. import session
from ..scene import channel, offset_attribute, start


class FrameResult:
    """A result that was written to a mesh, and what panels say about it."""

    def __init__(self, key):
        self.key = key  # equal keys mean equal results
        self.moves = True  # whether any offset is non-zero
        self.transforms = None  # of the empties of enabled handles, in the object's space
        self.of_pieces = None  # (motions, turns) of the handles' pieces, as of Pieces.motions()
        self.only_moved = ()  # names of the handles that were translated without a rotation or scale
        self.example_weights = ()  # the weight of each example in the pose
        self.is_final = True  # no slower, better result of the same pose is to replace it
        self.is_hurried = False  # a drag left out refinement, which follows when it pauses
        self.draft = None  # the Frame, if this was computed by the draft of a bind that is under way
        self.slow_info = None  # the library's figures of the slow result, if this is one
        self.problem = ""  # why the slow result could not be computed

    @property
    def is_draft(self):
        return self.draft is not None

    def will_do(self, wait, share):
        """Whether the result may stay on the mesh. wait: only a final one may. share: the time that a drag leaves now,
        as a fraction of a full update's."""
        return self.is_final or not wait and (share < 1.0 or not self.is_hurried)


_shown = session.kept({}, session.Until.REPLACED)  # by token: after undo, meshes may hold any earlier result


def by(mesh):
    """The FrameResult of the mesh, or None if its offsets were not written here."""
    return _shown.get(offset_attribute.token(mesh))


def is_draft(mesh):
    """Whether the mesh shows the draft of a bind."""
    record = by(mesh)
    return record is not None and record.is_draft


def show(ob, offsets, key):
    """Writes a result, unless the mesh has the same offsets already, so that Blender needn't evaluate it again. Returns
    its FrameResult."""
    mesh, present = ob.data, by(ob.data)
    if present is not None and present.key == key and np.array_equal(offset_attribute.read(mesh).ravel(), offsets):
        return _note(offset_attribute.token(mesh), offsets, FrameResult(key))
    return _write(ob, offsets, FrameResult(key))


def show_slow(ob, offsets, quick, info):
    """Replaces the quick result, whose FrameResult is given, by the slow one."""
    slow = copy.copy(quick)
    slow.is_final, slow.is_hurried, slow.slow_info = True, False, info
    return _write(ob, offsets, slow)


def show_rest(ob):
    """Removes the offsets."""
    forget(ob.data)
    channel.show_rest(ob)


def show_start(ob):
    """Removes the offsets, except for the deformation that the binding started from."""
    mesh = ob.data
    if start.has_previous_offsets(mesh):
        show(ob, start.with_previous_offsets(mesh, np.zeros(3 * len(mesh.vertices), np.float32)), None)
    else:
        show_rest(ob)


def is_deformed(mesh):
    """Whether the mesh is displaced; true, too, if only reading all its offsets could tell."""
    record = by(mesh)
    return offset_attribute.find(mesh) is not None and (record is None or record.moves)


def _write(ob, offsets, shown):
    forget(ob.data)
    channel.write(ob, offsets)
    return _note(offset_attribute.token(ob.data), offsets, shown)


def _note(token, offsets, shown):
    shown.moves = bool(np.any(offsets))
    _shown[token] = shown
    return shown


def keep(meshes):
    """Drops the records of all other meshes."""
    tokens = {offset_attribute.token(mesh) for mesh in meshes}
    for token in list(_shown):  # a render may write meanwhile
        if token not in tokens:
            _shown.pop(token, None)


def forget(mesh):
    """Drops the record, so that the next update writes to the mesh again."""
    _shown.pop(offset_attribute.token(mesh), None)
