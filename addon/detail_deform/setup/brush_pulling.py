# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull in Sculpt Mode: a handle of what is under the brush, with a reach of its own that leaves out what is masked."""

from typing import Any, NamedTuple

import numpy as np

from ..follow import binding
from ..scene import handle_curves, mesh_data, sculpted, start
from ..scene.mesh_data import MeshProblem
from . import handle_setup, mirroring, region_setup
from .pulling import Pull, earlier_handles, symmetric_axes


class Grip(NamedTuple):
    """What the brush takes hold of."""
    source: Any  # (n,) bool: the vertices from which the reach is measured
    vertices: Any  # (n,) bool: those of the handle
    fixed: Any  # (n,) bool: those that stay in place
    vertex: int  # the one under the brush
    size: float  # distance from it up to which vertices are the handle's, in world units; 0 for a face set


def check(ob):
    """Raises MeshProblem where the brush can't pull the object."""
    mesh_data.check_editable(ob)
    if ob.mode != 'SCULPT':
        raise MeshProblem("The brush pulls in Sculpt Mode: enter it first.")
    sculpted.check(ob)


def grip(ob, vertex, face, radius, share, by_face_set):
    """The Grip of a brush with that radius, in world units, at a vertex of a face: the vertices within a share of the
    radius, or those of the face's face set. Raises MeshProblem."""
    fixed = sculpted.are_fixed(ob.data)
    if fixed[vertex]:
        raise MeshProblem("What is under the brush is masked, and stays where it is: clear its mask, or pull beside.")
    if by_face_set:
        source = sculpted.vertices_of_face_set(ob.data, face) & ~fixed
        return Grip(source, source, fixed, vertex, 0.0)
    source = np.zeros(len(fixed), bool)
    source[vertex] = True
    return Grip(source, _around(ob, vertex, share * radius, fixed), fixed, vertex, share * radius)


def _around(ob, vertex, size, fixed):
    """(n,) bool: the vertices that aren't fixed, at a distance of at most size from a vertex."""
    return (region_setup.distances_up_to(ob, [[vertex]], size) <= size) & ~fixed


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


class BrushPull(Pull):
    """stages() as of Pull, in Sculpt Mode, which is not left. Then change_radius() may be called."""

    def __init__(self, context, ob, grip, radius, falloff, turns):
        """radius: of the reach, from the source of the Grip, in world units. falloff: as for Pull. turns: of the
        handle."""
        super().__init__(context, ob, radius, falloff=falloff)
        self._grip, self._turns, self._always_reach, self._may_move = grip, turns, True, ~grip.fixed
        self._earlier = None

    def _add_handle(self):
        handle_setup.add_handles(self._context, self._ob, chosen=self._grip.vertices).turns = self._turns
        yield 0.0

    def _set_moved_vertices(self):
        settings = self._ob.detail_deform
        if settings.region and not settings.pulled_region:  # the user's: nothing beside it moves
            self._may_move = self._may_move & mesh_data.members(self._ob, settings.region)
        else:
            settings.pulled_region = True
        if self._earlier is None:
            self._earlier = earlier_handles(self._ob, self._count)
        self._move(self._within_radius(), self._earlier)

    def _image(self, axis):
        """As of Pull. Blender's brushes are mirrored in space, and so is this one: the image is around the vertex that
        is nearest to the mirrored place, on a mesh that is not symmetric vertex by vertex, too."""
        if not self._grip.size:
            return None
        return _around(self._ob, self._mirrored_vertex(axis), self._grip.size, self._grip.fixed)

    def _mirrored_vertex(self, axis):
        places = start.deformed_positions(self._ob)
        place = places[self._grip.vertex].copy()
        place[axis] *= -1
        return int(np.linalg.norm(places - place, axis=1).argmin())

    def _within_radius(self):
        """(n,) bool: the vertices within the radius of the source and its mirror images, and all that are beside the
        handles, so that something follows on a mesh that is coarser than the radius."""
        ob, grip = self._ob, self._grip
        sources = [np.flatnonzero(grip.source)]
        for axis in symmetric_axes(ob):
            sources.append([self._mirrored_vertex(axis)] if grip.size else
                           np.flatnonzero(mirroring.mirror_image(ob, grip.source, axis)[0]))
        within = region_setup.distances_up_to(ob, list(filter(len, sources)), self.radius) <= self.radius
        groups = [handle.vertex_group for handle in ob.detail_deform.handles[self._count:]]
        return within | region_setup.grown(ob, mesh_data.members(ob, *groups), 1)

    def change_radius(self, radius):
        """Has the handle move what is within another radius. Raises MeshProblem or native.NativeError."""
        region_setup.restore(self._ob, self._region)
        self.radius = radius
        self._set_moved_vertices()
        binding.bind(self._ob, self._context.evaluated_depsgraph_get(), wait=False, keep_rest=True)

    def _return_to_mode(self):
        pass  # it was not left
