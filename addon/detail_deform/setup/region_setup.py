# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets the region, or reaches of handles, from a selection or by the distance from handles."""

from typing import NamedTuple

import numpy as np

from ..scene import displayed, group_columns, loose, mesh_data, selection, split, users
from ..scene.subject import enabled_handles
from ..scene.mesh_data import MeshProblem
from ..scene.start import deformed_positions

_GROUP_NAME, _REACH_NAME = "Region", "Reach"
# Default radius of the region, as a fraction of the diagonal of the mesh's box.
_DEFAULT_RADIUS = 0.25
# First guess of the radius around a selection: _DISK_RADII times the radius of a disk of its area, and at most the
# default radius, which alone took half a head along with an ear. But at least _MIN_SIZE_FRACTION of the box's diagonal
# and _MIN_EDGES mean edge lengths, so that something follows a single vertex.
_DISK_RADII, _MIN_SIZE_FRACTION, _MIN_EDGES = 2.0, 0.04, 2.0


def set_region(ob, members):
    """Makes these vertices the region, in a group of its own. members: (n,) bool."""
    settings = ob.detail_deform
    may_change = all(h.vertex_group != settings.own_region for h in settings.handles)
    settings.own_region = selection.fill_own_group(ob, settings.own_region, may_change, _GROUP_NAME, members)
    settings.region = settings.own_region  # even if unchanged: the property's callback clears pulled_region


def set_reach(ob, handles, members):
    """Makes these vertices the reach of the given handles, in a group that was made for one of them and that no other
    handle uses, or in a new group. members: (n,) bool."""
    others = [h for h in ob.detail_deform.handles if h not in handles]
    own = next((h.own_reach for h in handles if h.own_reach and not any(
        h.own_reach in {other.reach, other.vertex_group} for other in others)), "")
    name = selection.fill_own_group(ob, own, bool(own), _REACH_NAME, members)
    replaced = {handle.own_reach for handle in handles} - {name, ""}
    for handle in handles:
        handle.own_reach = name
        handle.reach = name
    _remove_unused(ob, replaced)


def _remove_unused(ob, names):
    """Removes the vertex groups of these names, which were made for reaches, that nothing uses any more."""
    used = {name for handle in ob.detail_deform.handles
            for name in (handle.reach, handle.own_reach, handle.vertex_group)}
    for name in (names - used) & set(ob.vertex_groups.keys()):
        if not users.needed_groups(ob, [name]):
            ob.vertex_groups.remove(ob.vertex_groups[name])


class RegionState(NamedTuple):
    """The settings of the region and of reaches, the mesh's falloff, and the vertices of the groups that were made for
    them."""
    region: str
    own_region: str
    pulled_region: bool
    smoothness: int
    reaches: list  # (reach, own_reach) of each handle
    members: dict  # {group name: its vertices}


def snapshot(ob, count):
    """The present state, for restore(). count: of the first handles, to which reaches are restored."""
    settings = ob.detail_deform
    reaches = [(handle.reach, handle.own_reach) for handle in settings.handles[:count]]
    groups = [name for name in {settings.own_region, *(own for _, own in reaches)} if name in ob.vertex_groups]
    if groups and ob.mode == 'EDIT':
        ob.update_from_editmode()
    members = dict(zip(groups, mesh_data.members_of_each(ob, groups, group_columns.entries)))
    return RegionState(settings.region, settings.own_region, settings.pulled_region, settings.smoothness, reaches,
                       members)


def restore(ob, state):
    settings = ob.detail_deform
    if settings.own_region != state.own_region:
        remove_own(ob)
    settings.own_region, settings.region = state.own_region, state.region
    settings.pulled_region = state.pulled_region
    if settings.smoothness != state.smoothness:
        settings.smoothness = state.smoothness
    for name, vertices in state.members.items():
        members = np.zeros(len(ob.data.vertices), bool)
        members[vertices] = True
        selection.fill_group(ob, ob.vertex_groups.get(name) or ob.vertex_groups.new(name=name), members)
    replaced = set()
    for handle, (reach, own) in zip(settings.handles, state.reaches):
        replaced |= {handle.own_reach} - {own, ""}
        handle.own_reach = own
        if handle.reach != reach:
            handle.reach = reach
    _remove_unused(ob, replaced)


def remove_own(ob):
    """Removes the vertex group that was made for the region, unless something else uses it now."""
    group = ob.vertex_groups.get(ob.detail_deform.own_region)
    if group and not users.needed_groups(ob, [group.name]):
        ob.vertex_groups.remove(group)


def from_selection(ob):
    chosen = selection.selected(ob)
    if not chosen.any():
        raise MeshProblem("No vertex is selected: select those that may deform.")
    set_region(ob, chosen)


def starting_vertices(ob):
    """(n,) bool: the vertices selected in Edit Mode, or else those of all enabled handles. Raises MeshProblem if there
    are none."""
    if ob.mode == 'EDIT':
        chosen = selection.selected(ob)
        if chosen.any():
            return chosen
    groups = [h.vertex_group for h in enabled_handles(ob.detail_deform)
              if h.vertex_group in ob.vertex_groups]
    chosen = mesh_data.members(ob, *groups)
    if not chosen.any():
        raise MeshProblem("There is nothing to start from: add a handle, or select vertices in Edit Mode.")
    return chosen


def default_radius(ob):
    """Default radius of the region, in world units."""
    return _DEFAULT_RADIUS * float(np.linalg.norm(ob.dimensions))


def from_origin(ob, positions):
    """(n, 3) float32: positions along the world's axes and in its unit, relative to the object's origin."""
    return (positions @ np.array(ob.matrix_world, np.float64)[:3, :3].T).astype(np.float32)


class SurfaceDistances:
    """Distances from some vertices along the surface as it is displayed before other modifiers, in world units."""

    def __init__(self, ob, start, chosen=None):
        """start: (n,) bool, the vertices at distance 0. chosen: (n,) bool, those whose area determines the first guess;
        all of the start if not given."""
        self.start, self.chosen = start, start if chosen is None else chosen
        self.origin = np.array(ob.matrix_world, np.float64)[:3, 3]
        self.positions = from_origin(ob, deformed_positions(ob))
        self.triangles = mesh_data.triangles(ob.data)
        self.distances = with_loose(
            ob, self.triangles, split.WeldedMesh(ob).distances(self.positions, self.triangles, start))

    def displayed_positions(self, ob, depsgraph):
        """(n, 3) float32: as positions, with the other modifiers applied where vertices can be followed through
        them."""
        posed = displayed.positions(ob, depsgraph)
        return self.positions if posed is None else from_origin(ob, posed)

    def within(self, radius):
        """(n,) bool: the vertices at a distance of at most radius."""
        return self.distances <= radius

    def suggested_radius(self):
        """Suggested radius of the region around the chosen vertices, by their area: see _DISK_RADII."""
        near = self.triangles[mesh_data.touching(self.triangles, self.chosen)]
        corners = self.positions[near].astype(np.float64)
        sides = corners - np.roll(corners, 1, axis=1)
        # Lumped: a vertex has a third of each triangle of its one-ring, so that a line of vertices has an area too.
        area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) @ self.chosen[near].mean(axis=1)
        size = float(np.linalg.norm(np.ptp(self.positions, axis=0)))
        edge = float(np.linalg.norm(sides, axis=2).mean()) if len(near) else 0.0
        by_area = min(_DISK_RADII * np.sqrt(area / np.pi), _DEFAULT_RADIUS * size)
        return float(max(by_area, _MIN_SIZE_FRACTION * size, _MIN_EDGES * edge))


def with_loose(ob, triangles, distances):
    """(n,) float32: the distances, but for vertices in no face at most that of the surface vertex to which edges
    connect them: distances along the surface are infinite there, and a whisker belongs to the region of its root."""
    root_of = loose.roots(len(distances), triangles, mesh_data.edges(ob.data))
    return np.where(root_of >= 0, np.minimum(distances, distances[root_of]), distances)


def within(ob, start, radius):
    """(n,) bool: the vertices whose distance over the surface is at most radius, in the world's unit."""
    return SurfaceDistances(ob, start).within(radius)


def grown(ob, start, steps):
    """(n,) bool: the start and the vertices within so many edges of it (that number of one-rings)."""
    a, b = split.WeldedMesh(ob).representatives(mesh_data.edges(ob.data)).T
    reached = start.copy()
    for _ in range(steps):
        before = reached.copy()
        reached[a] |= before[b]
        reached[b] |= before[a]
    return reached
