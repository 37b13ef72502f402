# SPDX-License-Identifier: GPL-3.0-or-later
"""What the meshes show: which result was written to each, known by the token that lies beside the offsets.

So a mesh that was copied, exchanged, undone or emptied is never taken for one that shows what its object asks for.
"""

import copy

import numpy as np

from ..scene import offset_attribute, start


class Shown:
    """A result that was written, and its facts."""

    def __init__(self, of):
        self.of = of  # whatever tells this result from all others: equal, the same
        self.moves = True  # anything, from where the mesh has it
        self.places = None  # of the empties of enabled handles, in the object's space
        self.only_moved = ()  # names of the handles that are moved without being turned or scaled
        self.example_weights = ()  # how much of each example the pose has
        self.is_final = True  # no slow result is to take its place
        self.is_hurried = False  # but one that only a drag has put off
        self.draft = None  # the Frame, where this is the draft of a bind that is under way
        self.slow_info = None  # facts of the slow result that this is
        self.problem = ""  # why the slow result did not come

    @property
    def is_draft(self):
        return self.draft is not None

    def will_do(self, wait, share):
        """Whether what is shown may stay. wait: only what is final; share: of the time, what a drag leaves now."""
        return self.is_final or not wait and (share < 1.0 or not self.is_hurried)


_shown = {}  # by token


def by(mesh):
    """What the mesh shows, or None where that is not known."""
    return _shown.get(offset_attribute.token(mesh))


def is_draft(mesh):
    """Whether it shows the draft of a bind."""
    record = by(mesh)
    return record is not None and record.is_draft


def show(mesh, offsets, of):
    """Writes a result, but one that is there: then Blender need not evaluate the mesh anew. Returns its Shown."""
    present = by(mesh)
    if present is not None and present.of == of and np.array_equal(offset_attribute.read(mesh).ravel(), offsets):
        return _note(offset_attribute.token(mesh), offsets, Shown(of))
    return _write(mesh, offsets, Shown(of))


def show_slow(mesh, offsets, quick, info):
    """Writes the slow result in place of the quick one, whose Shown is given."""
    slow = copy.copy(quick)
    slow.is_final, slow.is_hurried, slow.slow_info = True, False, info
    return _write(mesh, offsets, slow)


def show_rest(mesh):
    """Nothing that was computed."""
    forget(mesh)
    offset_attribute.remove(mesh)


def show_start(mesh):
    """The same, but for what an earlier binding has made of the mesh."""
    if start.is_deformed(mesh):
        show(mesh, start.with_kept(mesh, np.zeros(3 * len(mesh.vertices), np.float32)), None)
    else:
        show_rest(mesh)


def is_deformed(mesh):
    """Whether the mesh shows another shape than its own, as far as is known without looking at all vertices."""
    record = by(mesh)
    return offset_attribute.find(mesh) is not None and (record is None or record.moves)


def _write(mesh, offsets, shown):
    forget(mesh)
    return _note(offset_attribute.write(mesh, offsets), offsets, shown)


def _note(token, offsets, shown):
    shown.moves = bool(np.any(offsets))
    _shown[token] = shown
    return shown


def keep(meshes):
    """Forgets what was written to any others."""
    tokens = {offset_attribute.token(mesh) for mesh in meshes}
    for token in list(_shown):  # a render may write meanwhile
        if token not in tokens:
            _shown.pop(token, None)


def forget(mesh):
    """The next update writes to it again."""
    _shown.pop(offset_attribute.token(mesh), None)


def clear():
    _shown.clear()
