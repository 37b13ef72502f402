# SPDX-License-Identifier: GPL-3.0-or-later
"""Converts the offsets that the library computes to those that are written to a mesh: with a soft border, copied to
split vertices, continued to vertices in no face, relative to the mesh's own vertices, and with closed mirror seams."""

import numpy as np

from .. import session
from ..scene import loose, mesh_data, mirror_plane, proportions, soft_border, split, start
from . import content, look, registry

# Entries that each memo below keeps: at least _LEAST, and _EACH for each follower: its present content, and the
# previous one for undo.
_LEAST, _EACH = 8, 2


def _memo():
    return session.Memo(lambda: max(_LEAST, _EACH * len(registry.members())))


# By the signature of the content:
_seams = _memo()  # mirror_plane.Seams
_ways = _memo()  # of soft_border.border_fractions
_joined = _memo()  # split.WeldedMesh
_hanging = _memo()  # _Hanging
_closings = _memo()  # Closing, by the signature of the transfer


def offsets(ob, computed, has_faded):
    """(3 n,) float32: the offsets to write. computed: (3 n,), relative to the shape that was bound, in
    proportions.bound(). has_faded: whether the soft border has been applied to them."""
    width, signature = look.soft_border(ob.detail_deform), ob.detail_deform.signature
    if width and not has_faded:
        ways = _ways.of(signature, lambda: soft_border.border_fractions_of(ob, content.roles(ob)))
        computed = computed * np.repeat(soft_border.fade_weights(ways, width), 3)
    space = proportions.bound(ob.detail_deform)
    computed = _joined.of(signature, lambda: split.WeldedMesh(ob)).spread(computed)
    computed = _hanging.of(signature, lambda: _find_hanging(ob), lambda hanging: hanging.fits(ob)).placed(computed)
    computed = space.back(computed.reshape(-1, 3)).ravel()
    return _closed(ob, signature, start.with_previous_offsets(ob.data, computed))


def followed(ob, made_for, computed):
    """(3 n,) float32: the offsets to write, of a mesh that follows a source. made_for: signature of its transfer."""
    key = mirror_plane.signature(ob)
    return _closings.of(made_for, lambda: Closing(ob), lambda closing: closing.key == key).of(computed)


class Closing:
    """Keeps seams of a transfer's target closed: those of its Mirror modifiers, and those between split vertices."""

    def __init__(self, ob):
        self.key, self._joined = mirror_plane.signature(ob), split.WeldedMesh(ob)
        self._seams = mirror_plane.Seams(ob) if self.key else None

    def of(self, offsets):
        """(3 n,) float32"""
        return self._joined.closed(self._seams.closed(offsets) if self._seams else offsets)


def _closed(ob, made_for, result):
    key = mirror_plane.signature(ob)
    if not key:
        return result
    return _seams.of(made_for, lambda: mirror_plane.Seams(ob, content.roles(ob)),
               lambda seams: seams.signature == key).closed(result)


def know(ob, signature, joined, triangles, hung):
    """Caches what a bind has read of the mesh, so that the first frame needn't. hung: (n,) bool, of content.hung."""
    _joined.of(signature, lambda: joined)
    _hanging.of(signature, lambda: _Hanging(ob, triangles, hung), lambda hanging: hanging.fits(ob))


def _find_hanging(ob):
    triangles = mesh_data.triangles(ob.data)
    return _Hanging(ob, triangles, content.hung(ob, content.roles(ob), triangles))


class _Hanging:
    """The vertices in no face that edges connect with the surface, and that follow it."""

    def __init__(self, ob, triangles, hung):
        self._edge_count = len(ob.data.edges)  # the signature doesn't contain loose edges
        self._shape = proportions.bound(ob.detail_deform).to(start.shape(ob)) if hung.any() else None
        self._loose = hung.any() and loose.LooseVertices(self._shape, triangles, mesh_data.edges(ob.data), chosen=hung)

    def fits(self, ob):
        return len(ob.data.edges) == self._edge_count

    def placed(self, offsets):
        """(3 n,) float32: the given offsets, with those of these vertices filled in."""
        if not self._loose:
            return offsets
        return (self._loose.place(self._shape + offsets.reshape(-1, 3)) - self._shape).ravel()
