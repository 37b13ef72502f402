# SPDX-License-Identifier: GPL-3.0-or-later
"""The region made from a selection, or from what lies around the handles."""

import numpy as np

from ..library import native
from ..scene import handle_matrices, mesh_data, selection
from ..scene.mesh_data import MeshProblem
from ..scene.start import visible

_GROUP_NAME = "Region"
# Of the size of the mesh: how far the region reaches unless the user says otherwise.
_USUAL_RADIUS = 0.25


def set_region(ob, members):
    """Makes these vertices the region, in a group of its own. members: (n,) bool."""
    settings = ob.detail_deform
    may_change = all(h.vertex_group != settings.own_region for h in settings.handles)
    settings.own_region = selection.fill_own_group(ob, settings.own_region, may_change, _GROUP_NAME, members)
    settings.region = settings.own_region  # also where it was that: from now on it is not Pull's any more


def kept(ob):
    """What restore() brings back: the region's settings, and the vertices of its own group."""
    settings = ob.detail_deform
    group = ob.vertex_groups.get(settings.own_region)
    members = None
    if group:
        if ob.mode == 'EDIT':
            ob.update_from_editmode()
        members = mesh_data.members(ob, group.name)
    return settings.region, settings.own_region, settings.pulled_region, members


def restore(ob, present):
    settings = ob.detail_deform
    region, own, pulled, members = present
    if settings.own_region != own:
        remove_own(ob)
    elif members is not None:
        selection.fill_group(ob, ob.vertex_groups[own], members)
    settings.own_region, settings.region = own, region
    settings.pulled_region = pulled


def remove_own(ob):
    """Takes away the group that was made for the region."""
    group = ob.vertex_groups.get(ob.detail_deform.own_region)
    if group:
        ob.vertex_groups.remove(group)


def from_selection(ob):
    chosen = selection.selected(ob)
    if not chosen.any():
        raise MeshProblem("No vertex is selected: select those that may deform.")
    set_region(ob, chosen)


def sources(ob):
    """(n,) bool: the vertices selected in Edit Mode, or else those of all handles."""
    if ob.mode == 'EDIT':
        chosen = selection.selected(ob)
        if chosen.any():
            return chosen
    groups = [h.vertex_group for h in handle_matrices.enabled_handles(ob.detail_deform)
              if h.vertex_group in ob.vertex_groups]
    chosen = (mesh_data.group_weights(ob, groups) > mesh_data.MEMBER_WEIGHT).any(axis=0)
    if not chosen.any():
        raise MeshProblem("There is nothing to start from: add a handle, or select vertices in Edit Mode.")
    return chosen


def usual_radius(ob):
    """In the world's unit."""
    return _USUAL_RADIUS * float(np.linalg.norm(ob.dimensions))


def within(ob, start, radius):
    """(n,) bool: the vertices whose distance over the surface is at most radius, in the world's unit."""
    world = np.array(ob.matrix_world, np.float64)
    places = (visible(ob) @ world[:3, :3].T).astype(np.float32)
    return native.distances(places, mesh_data.triangles(ob.data), start) <= radius


def grown(ob, start, steps):
    """(n,) bool: the vertices that so many edges lead to."""
    a, b = mesh_data.edges(ob.data).T
    reached = start.copy()
    for _ in range(steps):
        before = reached.copy()
        reached[a] |= before[b]
        reached[b] |= before[a]
    return reached
