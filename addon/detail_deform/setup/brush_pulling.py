# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull in Sculpt Mode: a handle of what is under the brush, with a reach of its own that leaves out what is masked."""

from typing import Any, NamedTuple

import numpy as np

from ..follow import lifecycle
from ..library import native
from ..scene import displayed, group_columns, handle_curves, mesh_data, sculpted, split, start
from ..scene.mesh_data import MeshProblem
from ..scene.subject import enabled_handles
from . import handle_setup, mirroring, region_setup
from .pulling import Pull, bind, earlier_handles, may_set_region, symmetric_axes, until_bound


class BrushedSurface:
    """The surface of an object as it is displayed before other modifiers when the brush takes hold of it."""

    def __init__(self, ob):
        self._ob, self._welded = ob, split.WeldedMesh(ob)
        self.local = start.deformed_positions(ob)
        self._positions = region_setup.from_origin(ob, self.local)
        self.triangles = mesh_data.triangles(ob.data)
        self._welded_triangles = self._welded.representatives(self.triangles)
        self.fixed = sculpted.are_fixed(ob.data)

    def within(self, source, limit):
        """(n,) bool: the vertices at a distance of at most limit, as for distances()."""
        return self.distances(source, limit) <= limit

    def distances(self, source, limit):
        """(n,) float32: the distances from the nearest of the source's vertices, (k,), along the surface, in world
        units; infinite or any larger value beyond the limit. The time is that of the surface within the limit, apart
        from a pass over all vertices and triangles."""
        source = np.unique(self._welded.representatives(np.asarray(source)))
        low, high = (end(self._positions[source], axis=0) for end in (np.min, np.max))
        # No shortest path up to the limit leaves this box.
        inside = ((self._positions >= low - limit) & (self._positions <= high + limit)).all(axis=1)
        near = self._welded_triangles[mesh_data.touching(self._welded_triangles, inside)]
        vertices, near = np.unique(near, return_inverse=True)
        distances = np.full(len(self.local), np.inf, np.float32)
        distances[vertices] = native.distances(self._positions[vertices], near.reshape(-1, 3).astype(np.int32),
                                               np.isin(vertices, source))
        distances[source] = 0
        distances = distances[self._welded.representatives(np.arange(len(distances)))]
        return region_setup.with_loose(self._ob, self._welded_triangles, distances)

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
    may_move: Any  # (n,) bool: all that are neither fixed nor beside a region of the user's
    of_face_set: bool
    size: float = 0.0  # distance from it up to which vertices are the handle's, in world units; not of a face set


def check_masked(surface, vertex):
    """Raises MeshProblem where a vertex is fixed."""
    if surface.fixed[vertex]:
        raise MeshProblem("What is under the brush is masked, and stays where it is: clear its mask, or pull beside.")


def grip(ob, surface, vertex, face, size, by_face_set):
    """The Grip of a brush at a vertex of a face: the vertices up to a distance of size from it, in world units, or
    those of the face's face set. surface: the BrushedSurface. Raises MeshProblem."""
    settings, may_move = ob.detail_deform, ~surface.fixed
    if settings.region and not may_set_region(ob):
        may_move &= _members(ob, settings.region)
        if not may_move[vertex]:
            raise MeshProblem(f"What is under the brush is not in the region, '{settings.region}', and stays where it "
                              "is: pull within it, or clear Region.")
    held = _members(ob, *(handle.vertex_group for handle in enabled_handles(settings)))
    if by_face_set:
        source = sculpted.vertices_of_face_set(ob.data, face) & may_move
        if (source & held).any():
            raise MeshProblem("The face set has vertices of another handle, which would stay: drag that one, or press "
                              "Apply first.")
        return Grip(surface, source, source, vertex, may_move, True)
    source = np.zeros(len(may_move), bool)
    source[vertex] = True
    # At most half of the distance to the next handle and to what stays: the surface between two that touch would tear.
    distances = surface.distances([vertex], 2 * size)
    size = min(size, 0.5 * float(distances[held | ~may_move].min(initial=np.inf)))
    return Grip(surface, source, (distances <= size) & may_move, vertex, may_move, False, size)


def _members(ob, *groups):
    """(n,) bool: the vertices in at least one of these groups; those that aren't there have none."""
    return mesh_data.members(ob, *filter(ob.vertex_groups.__contains__, groups), entries=group_columns.entries)


def handle_at(ob, vertex, count=None):
    """(number, axis) of the handle that holds a vertex: the axis, 0 to 2, where the vertex is one of its mirror image,
    else None. (None, None) where the vertex is in no handle. count: of the first handles, which alone are searched.
    Raises MeshProblem where the brush can't move that handle."""
    settings, groups = ob.detail_deform, ob.vertex_groups
    weights = {groups[entry.group].name: entry.weight for entry in ob.data.vertices[vertex].groups}
    found = [handle for handle in settings.handles[:count]
             if handle.enabled and weights.get(handle.vertex_group, 0) > mesh_data.MEMBER_WEIGHT]
    if not found:
        return None, None
    handle = max(found, key=lambda handle: weights[handle.vertex_group])
    number = settings.handles.find(handle.mirrors or handle.name)
    if number < 0 or settings.handles[number].target is None:
        raise MeshProblem(f"What is under the brush is in handle '{handle.name}', which has no empty to be moved: "
                          "press Bring Back Empties, or remove that handle.")
    if handle_curves.has_curve(settings.handles[number]):
        raise MeshProblem(f"What is under the brush is in handle '{handle.name}', which follows a curve or bones: move "
                          "these.")
    # What lies on the plane moves along it, as the handle and its image do.
    axis = 'XYZ'.index(handle.mirror_axis) if handle.mirrors and not handle.symmetric else None
    if axis is not None and displayed.has_movers(ob):
        raise MeshProblem(f"What is under the brush is the mirror image of handle '{handle.mirrors}', and modifiers "
                          "pose the mesh: drag that handle itself.")
    return number, axis


def check_unmasked(ob, surface, number):
    """Raises MeshProblem where a handle would move what is masked now: it can't be left out without losing the pose."""
    handle = ob.detail_deform.handles[number]
    if (surface.fixed & _members(ob, handle.vertex_group, handle.reach or ob.detail_deform.region)).any():
        raise MeshProblem(f"What is under the brush is in handle '{handle.name}', which moves what was masked or "
                          "hidden since: clear the mask, or press Apply first.")


def bound_again(context, ob, wait):
    """Generator: binds an object that isn't bound, or that was edited since, as by strokes. Yields the progress."""
    lifecycle.compare(ob)
    if ob.detail_deform.stale or not ob.detail_deform.signature:
        bind(context, ob, wait, keep_rest=bool(ob.detail_deform.signature))
        yield from until_bound(ob)


class BrushPull(Pull):
    """stages() as of Pull, in Sculpt Mode, which is not left. Then change_radius() may be called."""

    def __init__(self, context, ob, grip, radius, falloff, turns):
        """radius: of the reach, from the source of the Grip, in world units. falloff: as for Pull. turns: of the
        handle."""
        super().__init__(context, ob, radius, falloff=falloff)
        self._grip, self._turns, self._always_reach, self._may_move = grip, turns, True, grip.may_move
        self._earlier = None

    def _add_handle(self):
        handle_setup.add_handles(self._context, self._ob, chosen=self._grip.vertices).turns = self._turns
        yield 0.0

    def _set_moved_vertices(self):
        settings = self._ob.detail_deform
        if may_set_region(self._ob):
            settings.pulled_region = True
        if self._earlier is None:
            self._earlier = earlier_handles(self._ob, self._count)
        self._move(self._within_radius(), self._earlier)

    def _image(self, axis):
        """As of Pull: the exact image on a mesh that is symmetric vertex by vertex. On others it is so in space, as
        Blender's brushes are: around the vertex that is nearest to the mirrored place."""
        grip = self._grip
        if grip.of_face_set:
            image = mirroring.mirror_image(self._ob, grip.vertices, axis)[0]
        else:
            mirrored = self._mirrored(axis)
            if mirrored is None:
                raise MeshProblem("There is no surface at the mirrored place, so one side alone is pulled.")
            if handle_at(self._ob, mirrored, self._count)[0] is not None:
                raise MeshProblem("The other side is in a handle already, and isn't pulled along: drag that by itself, "
                                  "or press Apply first.")
            image = self._exact_image(grip.vertices, axis)
            if image is None:
                image = grip.surface.within([mirrored], grip.size)
        return image & grip.may_move

    def _exact_image(self, chosen, axis):
        """(n,) bool: the vertices at the mirrored places; None if one is missing."""
        image, missing = mirroring.mirror_image(self._ob, chosen, axis)
        return None if missing else image

    def _mirrored(self, axis):
        """The vertex under the brush's mirror image, or None."""
        return self._grip.surface.mirrored_vertex(self._grip.vertex, axis, self.radius)

    def _within_radius(self):
        """(n,) bool: the vertices within the radius of the source and its mirror images, and all that are beside the
        handles, so that something follows on a mesh that is coarser than the radius."""
        ob, grip = self._ob, self._grip
        of_source = grip.surface.within(np.flatnonzero(grip.source), self.radius)
        within = of_source.copy()
        for axis in symmetric_axes(ob):
            image = self._exact_image(of_source, axis)
            if image is None and grip.of_face_set:
                image = mirroring.mirror_image(ob, of_source, axis)[0]
            elif image is None:
                mirrored = self._mirrored(axis)
                image = False if mirrored is None else grip.surface.within([mirrored], self.radius)
            within |= image
        held = _members(ob, *(handle.vertex_group for handle in ob.detail_deform.handles[self._count:]))
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
