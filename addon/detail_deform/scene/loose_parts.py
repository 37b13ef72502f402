# SPDX-License-Identifier: GPL-3.0-or-later
"""The connected parts of a mesh that no handle holds: which of them ride on what, and on which of its triangles
(riding.py places them)."""

from typing import Any, NamedTuple

import numpy as np
from mathutils.bvhtree import BVHTree

from ..library import native
from . import components

# A part rides if it is no farther from what it rides on than this fraction of its own size, or of the size of that.
# Safety: eyes, plates and cards are well within; a body of its own beside another one stays.
_NEAR_OF_PART, _NEAR_OF_SURFACE = 0.25, 0.02
# A part rides on what is larger: it has at most these fractions of its size or of its area. So a hair card that is
# pulled leaves those beside it, which are as large. A cap has 0.95 of a head's size and 0.6 of its area.
_OF_SIZE, _OF_AREA = 0.8, 0.7
# Parts larger than this fraction of the surface bend with it. A shirt has half of a body's size or more, a plate 0.4
# of a helmet's. They must lie along it with all of their points, so that a shirt doesn't take trousers along.
_BENDS_FROM = 0.5
# A rigid part touches the surface with what is hardly farther from it than its nearest point: by this fraction of its
# size. So a horn rides on what is around its root.
_CONTACT = 0.15
# A part rides on a larger rigid one, as a rivet on a plate, where that is nearer than the surface by this factor.
_NEARER = 0.5
_SAMPLES = 256  # vertices of a part whose distances are measured, at most; as many triangles where it has fewer
_SAME = 1e-5  # distances that are hardly farther apart are one, as the searches work in single precision
_LANDINGS = 4  # of them those from which larger parts are looked for


class Counts(NamedTuple):
    """Numbers of loose parts without a handle."""
    rigid: int = 0
    bending: int = 0
    # Those of the region that stay: parts, their vertices, and vertices in no face, with the first vertex of each.
    staying: int = 0
    staying_vertices: int = 0
    staying_example: int = -1
    loose: int = 0
    loose_example: int = -1


class Riders(NamedTuple):
    """Vertices that ride, in groups that move rigidly, and the triangles on which each group rides."""
    vertices: Any  # (k,)
    groups: Any  # (k,): the group of each
    contacts: Any  # (p, 2): group, triangle
    sizes: Any  # {group: size}, or None where each group rides on one place


class _Surface:
    """The triangles of some parts, to be searched."""

    def __init__(self, parts, chosen):
        """chosen: (parts,) bool"""
        self._triangles = np.flatnonzero(chosen[parts.of_triangle])
        used, corners = np.unique(parts.triangles[self._triangles], return_inverse=True)
        self._tree = BVHTree.FromPolygons(parts.points[used].tolist(), corners.reshape(-1, 3).tolist())

    def nearest(self, points):
        """(distances, triangles) of the nearest points of the surface."""
        found = [self._tree.find_nearest(point) for point in points.tolist()]
        return np.array([at[3] for at in found]), self._triangles[[at[2] for at in found]]

    def all_nearest(self, points, distances):
        """(k,): all triangles as near as the nearest ones, where these meet at a point or an edge."""
        found = [at for point, distance in zip(points.tolist(), distances.tolist())
                 for at in self.within(point, distance + _SAME)]
        return np.array([triangle for _, triangle in found])

    def within(self, point, distance):
        """[(distance, triangle)]"""
        return [(at[3], self._triangles[at[2]]) for at in self._tree.find_nearest_range(point, distance)]


class LooseParts:
    """The connected parts of a mesh, and how those without a handle ride. Lengths are fractions of the mesh's extent,
    as the searches work in single precision."""

    def __init__(self, rest, triangles, faces, edges, roles, copies):
        """As riding.RidingParts."""
        firsts = components.labels(len(rest), edges)  # which join the corners of all faces, too
        numbers = (np.cumsum(firsts == np.arange(len(firsts))) - 1)[firsts]
        count = numbers.max(initial=-1) + 1
        self.of_triangle = numbers[triangles[:, 0]]
        numbers[copies] = count  # in no part
        self._held, self._free = (np.bincount(numbers[chosen], minlength=count + 1)[:count] > 0
                                  for chosen in (roles >= 0, roles == native.ROLE_FREE))
        there = np.flatnonzero(np.bincount(numbers, minlength=count + 1)[:count])
        self._loose = there[~self._held[there]]
        self.counts, self.bending, self.rigid = Counts(), None, None
        if not len(self._loose) or not np.isfinite(rest).all():  # most meshes; those whose bind is refused
            self._loose = self._loose[:0]
            return
        self._of_vertex = numbers
        self._order = np.argsort(numbers, kind='stable')
        self._begin = np.searchsorted(numbers[self._order], np.arange(count + 1))
        self.triangles, self._faces = triangles, faces()
        self._by_face = np.argsort(self._faces, kind='stable')
        self._begin_of_face = np.searchsorted(self._faces[self._by_face], np.arange(self._faces.max(initial=-1) + 2))
        self.points = (rest - rest.min(axis=0)) / (np.ptp(rest, axis=0).max() or 1.0)
        self._of_parts = np.argsort(self.of_triangle, kind='stable')  # triangles
        self._first_triangle = np.searchsorted(self.of_triangle[self._of_parts], np.arange(count + 1))
        low, high = (by.reduceat(self.points[self._order[:self._begin[-1]]], self._begin[there], axis=0)
                     for by in (np.minimum, np.maximum))
        self._sizes = np.zeros(count)
        self._sizes[there] = np.linalg.norm(high - low, axis=1)
        a, b, c = np.moveaxis(self.points[triangles], 1, 0)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        self._areas = np.bincount(self.of_triangle, areas, minlength=count)

    def find(self, how):
        """Sets counts, bending and rigid, Riders or None. how: 'AUTO', 'RIGID' or 'BEND'. Rigid parts may ride on those
        that bend."""
        if not len(self._loose):
            return
        rides = bends = np.zeros(len(self._sizes), bool)
        if self._held[self.of_triangle].any():
            surface = held = _Surface(self, self._held)
            near = {}
            for part in self._loose:
                near[part] = held.nearest(self._samples(part))
            touches = self._touching(near)
            bends = self._that_bend(near, touches, how)
            touches &= ~self._are_large() | bends | (how == 'RIGID')
            if bends.any():
                vertices = self._vertices_of(bends)
                below = held.nearest(self.points[vertices])[1]
                self.bending = Riders(vertices, vertices, self._of_whole_faces(vertices, below), None)
                surface = _Surface(self, self._held | bends)
                near = {part: surface.nearest(self._samples(part)) for part in self._loose if not bends[part]}
                touches = self._touching(near)
            on = self._larger_neighbours(near, touches)
            rides = self._ride(surface, near, touches, on)
        self.counts = self._counted(rides, bends)

    def _of_whole_faces(self, groups, triangles):
        """(p, 2): pairs of a group and a triangle, with all triangles of each one's face, so that it makes no
        difference how faces are divided, as on the two sides of a symmetric mesh."""
        faces = self._faces[triangles]
        counts = self._begin_of_face[faces + 1] - self._begin_of_face[faces]
        places = np.arange(counts.sum()) + np.repeat(self._begin_of_face[faces] - (np.cumsum(counts) - counts), counts)
        return np.stack([np.repeat(groups, counts), self._by_face[places]], axis=1)

    def _vertices_of(self, chosen):
        """The vertices of parts. chosen: (parts,) bool"""
        return np.flatnonzero(np.append(chosen, False)[self._of_vertex])

    def _samples(self, part):
        """(k, 3): points of a part, vertices and, where it has few, centroids of its triangles."""
        found = self._order[self._begin[part]:self._begin[part + 1]]
        if len(found) > _SAMPLES:
            return self.points[found[np.linspace(0, len(found) - 1, _SAMPLES).astype(int)]]
        own = self._of_parts[self._first_triangle[part]:self._first_triangle[part + 1]][:_SAMPLES]
        return np.concatenate([self.points[found], self.points[self.triangles[own]].mean(axis=1)])

    def _reach(self, part, other):
        """How far one part may be from another one to ride on it."""
        return max(_NEAR_OF_PART * self._sizes[part], _NEAR_OF_SURFACE * self._sizes[other])

    def _touching(self, near):
        """(parts,) bool: near enough to a larger part with a handle, or that bends with one. near: {part: what
        _Surface.nearest() found from its samples}."""
        found = np.zeros(len(self._sizes), bool)
        for part, (distances, triangles) in near.items():
            least = distances.argmin()
            other = self.of_triangle[triangles[least]]
            found[part] = self._is_smaller(part, other) and distances[least] <= self._reach(part, other)
        return found

    def _is_smaller(self, part, other):
        return self._sizes[part] < self._sizes[other] and (self._sizes[part] <= _OF_SIZE * self._sizes[other]
                                                           or self._areas[part] <= _OF_AREA * self._areas[other])

    def _are_large(self):
        return self._sizes > _BENDS_FROM * self._sizes[self._held].max()

    def _that_bend(self, near, touches, how):
        """(parts,) bool"""
        found = np.zeros_like(touches)
        if how == 'RIGID':
            return found
        for part in np.flatnonzero(touches & (self._are_large() | (how == 'BEND'))):
            found[part] = how == 'BEND' or near[part][0].max() <= _NEAR_OF_PART * self._sizes[part]
        return found

    def _larger_neighbours(self, near, touches):
        """{part: the larger loose part on which it lies}. Of those that touch the surface only such that are much
        nearer to one another."""
        found = {}
        if len(near) < 2:
            return found
        chosen = np.zeros(len(self._sizes), bool)
        chosen[list(near)] = True
        if not chosen[self.of_triangle].any():
            return found
        surface, largest = _Surface(self, chosen), max(near, key=lambda part: self._sizes[part])
        for part, (distances, _) in near.items():
            best = _NEARER * distances.min() if touches[part] else self._reach(part, largest)
            samples = self._samples(part)
            for point in samples[np.argsort(distances, kind='stable')[:_LANDINGS]].tolist():
                for distance, triangle in surface.within(point, best) if best > 0 else ():
                    other = self.of_triangle[triangle]
                    if (self._sizes[other] > self._sizes[part] and distance <= best
                            and (touches[part] or distance <= self._reach(part, other))):
                        best, found[part] = distance, other
        return found

    def _ride(self, surface, near, touches, on):
        """(parts,) bool: those that ride rigidly. Sets rigid."""
        root, rides = np.arange(len(self._sizes)), np.zeros(len(self._sizes), bool)
        for part in sorted(near, key=lambda part: -self._sizes[part]):
            below = on.get(part)
            if below is not None and rides[below]:
                root[part], rides[part] = root[below], True
            else:
                rides[part] = touches[part]
        groups, contacts, sizes = [], [], {}
        for part in np.flatnonzero(rides & (root == np.arange(len(root)))):
            distances, _ = near[part]
            touching = np.flatnonzero(distances <= distances.min() + _CONTACT * self._sizes[part])
            touching = surface.all_nearest(self._samples(part)[touching], distances[touching])
            groups.append(np.full(len(touching), part))
            contacts.append(touching)
            sizes[part] = self._sizes[part]
        vertices = self._vertices_of(rides)
        if len(vertices):
            contacts = self._of_whole_faces(np.concatenate(groups), np.concatenate(contacts))
            self.rigid = Riders(vertices, root[self._of_vertex[vertices]], contacts, sizes)
        return rides

    def _counted(self, rides, bends):
        has_faces = np.zeros(len(self._sizes), bool)
        has_faces[self.of_triangle] = True
        stays = np.zeros(len(self._sizes), bool)
        stays[self._loose] = True
        stays &= self._free & ~rides & ~bends
        parts, loose = self._vertices_of(stays & has_faces), self._vertices_of(stays & ~has_faces)
        first = [int(vertices.min(initial=len(self.points))) for vertices in (parts, loose)]
        return Counts(int(rides.sum()), int(bends.sum()), int((stays & has_faces).sum()), len(parts), first[0],
                      len(loose), first[1])
