# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull in Sculpt Mode: a handle of what is under the brush, with a reach of its own that leaves out what is masked."""

from typing import Any, NamedTuple

import numpy as np

from ..follow import lifecycle
from ..library import native
from ..scene import group_columns, handle_curves, mesh_data, sculpted, split, start
from ..scene.mesh_data import MeshProblem
from . import handle_setup, mirroring, region_setup
from .pulling import Pull, bind, earlier_handles, symmetric_axes, until_bound


class BrushedSurface:
    """The surface of an object as it is displayed before other modifiers when the brush takes hold of it."""

    def __init__(self, ob):
        self._ob, self._welded = ob, split.WeldedMesh(ob)
        self.local = start.deformed_positions(ob)
        self._positions = region_setup.from_origin(ob, self.local)
        self.triangles = mesh_data.triangles(ob.data)
        self._welded_triangles = self._welded.representatives(self.triangles)
        self.fixed = sculpted.are_fixed(ob.data)

    def within(self, parts, limit):
        """(n,) bool: the vertices at a distance of at most limit from the nearest of the parts, arrays of vertices,
        along the surface, in world units. The time is that of the surface within the limit, apart from a pass over all
        vertices and triangles."""
        distances = np.full(len(self.local), np.inf, np.float32)
        for part in parts:
            source = np.unique(self._welded.representatives(np.asarray(part)))
            low, high = (end(self._positions[source], axis=0) for end in (np.min, np.max))
            # No shortest path up to the limit leaves this box.
            inside = ((self._positions >= low - limit) & (self._positions <= high + limit)).all(axis=1)
            near = self._welded_triangles[mesh_data.touching(self._welded_triangles, inside)]
            vertices, near = np.unique(near, return_inverse=True)
            found = native.distances(self._positions[vertices], near.reshape(-1, 3).astype(np.int32),
                                     np.isin(vertices, source))
            distances[vertices] = np.minimum(distances[vertices], found)
            distances[source] = 0
        distances = distances[self._welded.representatives(np.arange(len(distances)))]
        return region_setup.with_loose(self._ob, self._welded_triangles, distances) <= limit

    def around(self, vertex, size):
        """(n,) bool: the vertices that aren't fixed, at a distance of at most size from a vertex."""
        return self.within([[vertex]], size) & ~self.fixed

    def mirrored_vertex(self, vertex, axis, limit):
        """The vertex that is nearest to the mirrored place of another, both as the mesh itself has them; None if it is
        farther away than limit, in world units."""
        places = mesh_data.positions(self._ob.data)
        place = places[vertex].copy()
        place[axis] *= -1
        away = np.linalg.norm(region_setup.from_origin(self._ob, places - place), axis=1)
        found = int(away.argmin())
        return found if away[found] <= limit else None


class Grip(NamedTuple):
    """What the brush takes hold of."""
    surface: BrushedSurface
    source: Any  # (n,) bool: the vertices from which the reach is measured
    vertices: Any  # (n,) bool: those of the handle
    vertex: int  # the one under the brush
    of_face_set: bool
    size: float = 0.0  # distance from it up to which vertices are the handle's, in world units; not of a face set


def grip(ob, surface, vertex, face, radius, share, by_face_set):
    """The Grip of a brush with that radius, in world units, at a vertex of a face: the vertices within a share of the
    radius, or those of the face's face set. surface: the BrushedSurface. Raises MeshProblem."""
    if surface.fixed[vertex]:
        raise MeshProblem("What is under the brush is masked, and stays where it is: clear its mask, or pull beside.")
    if by_face_set:
        source = sculpted.vertices_of_face_set(ob.data, face) & ~surface.fixed
        return Grip(surface, source, source, vertex, True)
    source = np.zeros(len(surface.fixed), bool)
    source[vertex] = True
    return Grip(surface, source, surface.around(vertex, share * radius), vertex, False, share * radius)


def handle_at(ob, vertex):
    """(number, axis) of the handle with an empty that holds a vertex: the axis, 0 to 2, where the vertex is one of its
    mirror image, else None. (None, None) where the vertex is in no such handle of a bound object."""
    settings, groups = ob.detail_deform, ob.vertex_groups
    if not settings.signature:
        return None, None
    weights = {groups[entry.group].name: entry.weight for entry in ob.data.vertices[vertex].groups}
    found = [handle for handle in settings.handles
             if handle.enabled and weights.get(handle.vertex_group, 0) > mesh_data.MEMBER_WEIGHT]
    if not found:
        return None, None
    handle = max(found, key=lambda handle: weights[handle.vertex_group])
    axis = 'XYZ'.index(handle.mirror_axis) if handle.mirrors else None
    number = settings.handles.find(handle.mirrors or handle.name)
    if number < 0 or settings.handles[number].target is None or handle_curves.has_curve(settings.handles[number]):
        return None, None
    return number, axis


def bound_again(context, ob, wait):
    """Generator: binds an object anew that was edited since it was bound, as by strokes. Yields the progress."""
    lifecycle.compare(ob)
    if ob.detail_deform.stale:
        bind(context, ob, wait, keep_rest=True)
        yield from until_bound(ob)


class BrushPull(Pull):
    """stages() as of Pull, in Sculpt Mode, which is not left. Then change_radius() may be called."""

    def __init__(self, context, ob, grip, radius, falloff, turns):
        """radius: of the reach, from the source of the Grip, in world units. falloff: as for Pull. turns: of the
        handle."""
        super().__init__(context, ob, radius, falloff=falloff)
        self._grip, self._turns, self._always_reach, self._may_move = grip, turns, True, ~grip.surface.fixed
        self._earlier = None

    def _add_handle(self):
        handle_setup.add_handles(self._context, self._ob, chosen=self._grip.vertices).turns = self._turns
        yield 0.0

    def _set_moved_vertices(self):
        settings = self._ob.detail_deform
        if settings.region and not settings.pulled_region:  # the user's: nothing beside it moves
            self._may_move = self._may_move & mesh_data.members(self._ob, settings.region)
            if not self._may_move[self._grip.vertex]:
                raise MeshProblem(f"What is under the brush is not in the region, '{settings.region}', and stays where "
                                  "it is: pull within it, or clear Region.")
        else:
            settings.pulled_region = True
        if self._earlier is None:
            self._earlier = earlier_handles(self._ob, self._count)
        self._move(self._within_radius(), self._earlier)

    def _image(self, axis):
        """As of Pull. Blender's brushes are mirrored in space, and so is this one: the image is around the vertex that
        is nearest to the mirrored place, on a mesh that is not symmetric vertex by vertex, too."""
        grip = self._grip
        if grip.of_face_set:
            return None
        mirrored = self._mirrored(axis)
        if mirrored is None:
            raise MeshProblem("There is no surface at the mirrored place, so one side alone is pulled.")
        if handle_at(self._ob, mirrored)[0] is not None:
            raise MeshProblem("The other side is in a handle already, and isn't pulled along: drag that by itself, or "
                              "press Apply first.")
        return grip.surface.around(mirrored, grip.size)

    def _mirrored(self, axis):
        """The vertex under the brush's mirror image, or None."""
        return self._grip.surface.mirrored_vertex(self._grip.vertex, axis, self.radius)

    def _within_radius(self):
        """(n,) bool: the vertices within the radius of the source and its mirror images, and all that are beside the
        handles, so that something follows on a mesh that is coarser than the radius."""
        ob, grip = self._ob, self._grip
        sources = [np.flatnonzero(grip.source)]
        for axis in symmetric_axes(ob):
            if grip.of_face_set:
                sources.append(np.flatnonzero(mirroring.mirror_image(ob, grip.source, axis)[0]))
            elif self._mirrored(axis) is not None:
                sources.append([self._mirrored(axis)])
        within = grip.surface.within(list(filter(len, sources)), self.radius)
        groups = [handle.vertex_group for handle in ob.detail_deform.handles[self._count:]]
        held = np.zeros(len(within), bool)
        held[np.concatenate(mesh_data.members_of_each(ob, groups, group_columns.entries))] = True
        return within | region_setup.grown(ob, held, 1)

    def change_radius(self, radius):
        """Has the handle move what is within another radius. Raises MeshProblem or native.NativeError."""
        self.radius = radius
        with lifecycle.to_be_bound(self._ob):
            region_setup.restore(self._ob, self._region)
            self._set_moved_vertices()
        bind(self._context, self._ob, wait=False, keep_rest=True)

    def _return_to_mode(self):
        pass  # it was not left
