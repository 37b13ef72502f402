# SPDX-License-Identifier: GPL-3.0-or-later
"""The roles of vertices in a binding: of a handle, free, or fixed; for all of it, and for each reach."""

from typing import Any, NamedTuple

import numpy as np

from ..library import native
from ..library.options import FALLOFF_ORDERS
from ..scene import loose, mesh_data, split, start
from ..scene.mesh_data import MeshProblem


class Roles(NamedTuple):
    of_all: Any  # (n,) int32: index of a piece of a handle, ROLE_FREE if free in any part, or ROLE_FIXED
    parts: list  # of ReachRoles
    pieces: Any  # the handles' pieces.Pieces


class ReachRoles(NamedTuple):
    """The handles of one reach, and the roles of vertices for these."""
    numbers: Any  # (k,) indices of the handles' pieces among all
    vertices: Any  # (m,) those that aren't fixed, ascending; None: all vertices, if the handles have no reach
    roles: Any  # (m,) int32, or (n,): pieces are counted from 0
    smoothness: int = 0  # the order of the part's base energy; 0: the object's

    @property
    def is_whole(self):
        """Whether its handles have no reach, and so move the region."""
        return self.vertices is None


def of(subject, entries=None, welded=None):
    """The subject's Roles. entries: the function that reads groups, as for mesh_data.roles. welded: the object's
    split.WeldedMesh, if the caller has one. Raises MeshProblem naming the group or handle."""
    return in_pieces(of_handles(subject, entries, welded), subject)


def in_pieces(found, subject):
    """The Roles with the subject's pieces in place of handles. found: of of_handles()."""
    pieces = subject.pieces
    if not pieces.rests:
        return found._replace(pieces=pieces)
    positions, parts = subject.space.to(start.shape(subject.ob)), []
    for part in found.parts:
        numbers, held = pieces.of_handles(part.numbers), part.roles >= 0
        of_part = np.where(held, part.numbers[np.maximum(part.roles, 0)], part.roles).astype(part.roles.dtype)
        of_part = pieces.of_vertices(of_part, subject, positions if part.is_whole else positions[part.vertices])
        of_part[held] = np.searchsorted(numbers, of_part[held])
        parts.append(part._replace(numbers=numbers, roles=of_part))
    return Roles(pieces.of_vertices(found.of_all, subject, positions), parts, pieces)


def of_handles(subject, entries=None, welded=None):
    """As of(), of handles, which aren't divided into pieces."""
    welded = welded or split.WeldedMesh(subject.ob)
    subject.check_groups()
    names = subject.reaches
    of_all = mesh_data.roles(subject.ob, subject.region, subject.groups, subject.settings.base == 'COMPUTED', entries)
    if not any(names):
        of_all = welded.roles(of_all)
        return Roles(of_all, [ReachRoles(np.arange(len(names)), None, of_all)], None)
    reaches, inside = _in_order(subject, entries)
    part_of = np.array([reaches.index(name) for name in names])[np.maximum(of_all, 0)]
    parts, moves, edges = [], np.zeros(len(of_all), bool), welded.representatives(mesh_data.edges(subject.mesh))
    for rank, (name, free) in enumerate(zip(reaches, inside)):
        # The vertices of handles of later parts are free in earlier ones.
        free = free[(of_all[free] < 0) | (part_of[free] > rank)]
        numbers = np.flatnonzero([other == name for other in names])
        moves[free] = True
        held = (of_all >= 0) & (part_of == rank)
        of_part = np.full(len(of_all), native.ROLE_FIXED, np.int32)
        of_part[free] = native.ROLE_FREE
        of_part[held] = np.searchsorted(numbers, of_all[held])
        parts.append(_part(numbers, welded.roles(of_part), edges, name and subject.handles[numbers[0]]))
    of_all = np.where(of_all >= 0, of_all, np.where(moves, native.ROLE_FREE, native.ROLE_FIXED)).astype(np.int32)
    return Roles(welded.roles(of_all), parts, None)


def _in_order(subject, entries):
    """[group] of the reaches, and [vertices] of each. That of the region, '', comes first, then reaches by descending
    size, as small corrections are made on top of large motions."""
    reaches = [name for name in ("", *dict.fromkeys(filter(None, subject.reaches))) if name in subject.reaches]
    inside = mesh_data.members_of_each(subject.ob, [name or subject.settings.region for name in reaches], entries)
    order = sorted(range(len(reaches)), key=lambda number: (reaches[number] != "", -len(inside[number])))
    return [reaches[number] for number in order], [inside[number] for number in order]


def _part(numbers, of_part, edges, first):
    """A ReachRoles. of_part: (n,) roles of all vertices. first: the first of its handles if it has a reach, else ''."""
    ends = of_part[edges]
    if first and not ((ends == native.ROLE_FREE).any(axis=1) & (ends >= 0).any(axis=1)).any():
        raise MeshProblem(f"Handle '{first.name}': no vertex that is free to follow is beside it "
                          "within its reach. Give its Reach more vertices, or none.")
    if not first:
        return ReachRoles(numbers, None, of_part)
    vertices = np.flatnonzero(of_part != native.ROLE_FIXED)
    return ReachRoles(numbers, vertices, of_part[vertices], FALLOFF_ORDERS[first.falloff])


def hung(mesh, roles, triangles):
    """(n,) bool: vertices in no face that are connected with the surface by edges, and are free or in the same handle
    as the vertex of the surface where that connection ends. roles: (n,)."""
    on = loose.roots(len(roles), triangles, mesh_data.edges(mesh))
    is_hung = (on >= 0) & (on != np.arange(len(on)))
    return is_hung & ((roles == native.ROLE_FREE) | (roles >= 0) & (roles == roles[on]))
