# SPDX-License-Identifier: GPL-3.0-or-later
"""Converts the offsets that the library computes to those that are written to a mesh: with a soft border, with loose
parts that ride along, copied to split vertices, continued to vertices in no face, relative to the mesh's own vertices,
and with closed mirror seams."""

import numpy as np

from .. import session
from ..scene import loose, mesh_data, mirror_plane, riding, soft_border, split, start
from ..scene.mesh_data import MeshProblem
from ..scene.subject import Subject
from . import registry, roles, update_options

# Entries that each memo below keeps: at least _LEAST, and _EACH for each follower: its present content, and the
# previous one for undo.
_LEAST, _EACH = 8, 2


def _memo():
    return session.Memo(lambda: max(_LEAST, _EACH * len(registry.members())))


# By the signature of the content:
_seams = _memo()  # mirror_plane.Seams
_fractions = _memo()  # of soft_border.border_fractions
_welded = _memo()  # split.WeldedMesh
_hanging = _memo()  # _Hanging
_riding = _memo()  # riding.RidingParts, by the signature and the setting
_closings = _memo()  # Closing, by the signature of the transfer


def offsets(subject, computed, has_faded):
    """(3 n,) float32: the offsets to write. computed: (3 n,), relative to the shape that was bound, in the subject's
    space. has_faded: whether the soft border has been applied to them."""
    ob, signature = subject.ob, subject.settings.signature
    width = update_options.soft_border(subject.settings)
    if width and not has_faded:
        fractions = _fractions.of(signature, lambda: soft_border.border_fractions_of(ob, roles.of(subject).of_all))
        computed = computed * np.repeat(soft_border.fade_weights(fractions, width), 3)
    riding_parts = riding_of(subject)
    if riding_parts:
        computed = riding_parts.placed(computed)
    computed = _welded.of(signature, lambda: split.WeldedMesh(ob)).spread(computed)
    computed = _hanging.of(signature, lambda: _find_hanging(subject), lambda hanging: hanging.fits(ob)).placed(computed)
    computed = subject.space.back(computed.reshape(-1, 3)).ravel()
    return _closed(subject, start.with_previous_offsets(subject.mesh, computed))


def riding_of(subject):
    """The riding.RidingParts of a bound object; None if its loose parts stay."""
    how, signature = update_options.loose_parts(subject.settings), subject.settings.signature
    if how == 'STAY':
        return None
    return _riding.of((signature, how), lambda: _find_riding(subject, how))


def riding_if_known(ob):
    """The same; None, too, where a group is gone, as the next update says."""
    try:
        return riding_of(Subject(ob))
    except MeshProblem:
        return None


def _find_riding(subject, how):
    welded = _welded.of(subject.settings.signature, lambda: split.WeldedMesh(subject.ob))
    return _riding_parts(subject, welded, mesh_data.triangles(subject.mesh), roles.of(subject).of_all, how)


def _riding_parts(subject, welded, triangles, of_all, how):
    edges, everything = mesh_data.edges(subject.mesh), np.arange(len(of_all))
    return riding.RidingParts(subject.space.to(start.shape(subject.ob)), welded.representatives(triangles),
                              lambda: mesh_data.faces_of_triangles(subject.mesh), welded.representatives(edges), of_all,
                              welded.representatives(everything) != everything, how)


def followed(ob, made_for, computed):
    """(3 n,) float32: the offsets to write, of a mesh that follows a source. made_for: signature of its transfer."""
    key = mirror_plane.signature(ob)
    return _closings.of(made_for, lambda: Closing(ob), lambda closing: closing.key == key).of(computed)


class Closing:
    """Keeps seams of a transfer's target closed: those of its Mirror modifiers, and those between split vertices."""

    def __init__(self, ob):
        self.key, self._welded = mirror_plane.signature(ob), split.WeldedMesh(ob)
        self._seams = mirror_plane.Seams(ob) if self.key else None

    def of(self, offsets):
        """(3 n,) float32"""
        return self._welded.closed(self._seams.closed(offsets) if self._seams else offsets)


def _closed(subject, result):
    key = mirror_plane.signature(subject.ob)
    if not key:
        return result
    return _seams.of(subject.settings.signature, lambda: mirror_plane.Seams(subject.ob, roles.of(subject).of_all),
                     lambda seams: seams.signature == key).closed(result)


def know(subject, signature, welded, triangles, hung, of_all):
    """Caches what a bind has read of the mesh, so that the first frame needn't. hung: (n,) bool, of roles.hung. of_all:
    (n,), the roles."""
    _welded.of(signature, lambda: welded)
    how = update_options.loose_parts(subject.settings)
    if how != 'STAY':
        _riding.of((signature, how), lambda: _riding_parts(subject, welded, triangles, of_all, how))
    _hanging.of(signature, lambda: _Hanging(subject, triangles, hung), lambda hanging: hanging.fits(subject.ob))


def _find_hanging(subject):
    triangles = mesh_data.triangles(subject.mesh)
    return _Hanging(subject, triangles, roles.hung(subject.mesh, roles.of(subject).of_all, triangles))


class _Hanging:
    """The vertices in no face that edges connect with the surface, and that follow it."""

    def __init__(self, subject, triangles, hung):
        self._edge_count = len(subject.mesh.edges)  # the signature doesn't contain loose edges
        self._shape = subject.space.to(start.shape(subject.ob)) if hung.any() else None
        self._loose = hung.any() and loose.LooseVertices(
            self._shape, triangles, mesh_data.edges(subject.mesh), chosen=hung)

    def fits(self, ob):
        return len(ob.data.edges) == self._edge_count

    def placed(self, offsets):
        """(3 n,) float32: the given offsets, with those of these vertices filled in."""
        if not self._loose:
            return offsets
        return (self._loose.place(self._shape + offsets.reshape(-1, 3)) - self._shape).ravel()
