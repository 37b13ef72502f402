# SPDX-License-Identifier: GPL-3.0-or-later
"""Converts the offsets that the library computes to those that are written to a mesh: with a soft border, copied to
split vertices, continued to vertices in no face, relative to the mesh's own vertices, and with closed mirror seams."""

import numpy as np

from ..scene import loose, mesh_data, mirror_plane, proportions, soft_border, split, start
from . import content, look, registry

# Entries that each cache below keeps (LRU): at least _LEAST, and _EACH for each follower: its present content, and the
# previous one for undo.
_LEAST, _EACH = 8, 2

# Caches by the signature of the content:
_seams = {}  # mirror_plane.Seams
_ways = {}  # of soft_border.ways
_joined = {}  # split.Joined
_hanging = {}  # _Hanging
_closings = {}  # Closing, by the signature of the transfer


def offsets(ob, computed, has_faded):
    """(3 n,) float32: the offsets to write. computed: (3 n,), relative to the shape that was bound, in
    proportions.bound(). has_faded: whether the soft border has been applied to them."""
    width, signature = look.soft_border(ob.detail_deform), ob.detail_deform.signature
    if width and not has_faded:
        ways = _of(signature, _ways, lambda: soft_border.of(ob, content.roles(ob)))
        computed = computed * np.repeat(soft_border.shares(ways, width), 3)
    space = proportions.bound(ob.detail_deform)
    computed = _of(signature, _joined, lambda: split.Joined(ob)).copied(computed)
    computed = _of(signature, _hanging, lambda: _find_hanging(ob), lambda hanging: hanging.fits(ob)).placed(computed)
    computed = space.back(computed.reshape(-1, 3)).ravel()
    return _closed(ob, signature, start.with_kept(ob.data, computed))


def followed(ob, made_for, computed):
    """(3 n,) float32: the offsets to write, of a mesh that follows a source. made_for: signature of its transfer."""
    key = mirror_plane.key(ob)
    return _of(made_for, _closings, lambda: Closing(ob), lambda closing: closing.key == key).of(computed)


class Closing:
    """Keeps seams of a transfer's target closed: those of its Mirror modifiers, and those between split vertices."""

    def __init__(self, ob):
        self.key, self._joined = mirror_plane.key(ob), split.Joined(ob)
        self._seams = mirror_plane.Seams(ob) if self.key else None

    def of(self, offsets):
        """(3 n,) float32"""
        return self._joined.closed(self._seams.closed(offsets) if self._seams else offsets)


def _closed(ob, made_for, result):
    key = mirror_plane.key(ob)
    if not key:
        return result
    return _of(made_for, _seams, lambda: mirror_plane.Seams(ob, content.roles(ob)),
               lambda seams: seams.key == key).closed(result)


def _of(made_for, kept, make, fits=lambda found: True):
    found = kept.pop(made_for, None)
    if found is None or not fits(found):
        found = make()
    kept[made_for] = found  # at the end: the most recently used
    for old in list(kept)[:-max(_LEAST, _EACH * len(registry.members()))]:
        del kept[old]
    return found


def know(ob, signature, joined, triangles, hung):
    """Caches what a bind has read of the mesh, so that the first frame needn't. hung: (n,) bool, of content.hung."""
    _of(signature, _joined, lambda: joined)
    _of(signature, _hanging, lambda: _Hanging(ob, triangles, hung), lambda hanging: hanging.fits(ob))


def _find_hanging(ob):
    triangles = mesh_data.triangles(ob.data)
    return _Hanging(ob, triangles, content.hung(ob, content.roles(ob), triangles))


class _Hanging:
    """The vertices in no face that edges connect with the surface, and that follow it."""

    def __init__(self, ob, triangles, hung):
        self._edge_count = len(ob.data.edges)  # the signature doesn't contain loose edges
        self._shape = proportions.bound(ob.detail_deform).to(start.shape(ob)) if hung.any() else None
        self._loose = hung.any() and loose.Loose(self._shape, triangles, mesh_data.edges(ob.data), chosen=hung)

    def fits(self, ob):
        return len(ob.data.edges) == self._edge_count

    def placed(self, offsets):
        """(3 n,) float32: the given offsets, with those of these vertices filled in."""
        if not self._loose:
            return offsets
        return (self._loose.place(self._shape + offsets.reshape(-1, 3)) - self._shape).ravel()


def clear():
    _seams.clear()
    _ways.clear()
    _joined.clear()
    _hanging.clear()
    _closings.clear()
    split.forget()
