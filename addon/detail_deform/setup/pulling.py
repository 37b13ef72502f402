# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull: makes a handle of the selected vertices and a region around it, and binds, as a generator of short stages."""

from typing import Any, NamedTuple

import bpy
import numpy as np

from ..follow import binding, binding_state, handle_follower, registry
from ..library.options import FALLOFF_ORDERS
from ..scene import channel, deform_modifier, mesh_data, mirror_plane, selection
from ..scene.mesh_data import MeshProblem
from . import handle_setup, mirroring, region_setup


def may_set_region(ob):
    """Whether Pull may set the region: there is none, or Pull made it. One that the user chose is left unchanged."""
    return not ob.detail_deform.region or ob.detail_deform.pulled_region


def selected_distances(ob):
    """The region_setup.SurfaceDistances of the selected vertices and of their mirror images by Edit Mode's symmetry.
    Raises MeshProblem."""
    chosen = selection.selected(ob)
    if not chosen.any():
        raise MeshProblem(f"No vertex is selected: {handle_setup.SELECT_FOR_HANDLE}.")
    images = [mirroring.mirror_image(ob, chosen, axis)[0] for axis in _symmetric_axes(ob)]
    return region_setup.SurfaceDistances(ob, np.logical_or.reduce([chosen, *images]), chosen)


class EarlierHandles(NamedTuple):
    """Earlier handles with one reach. A Pull whose radius includes any of their vertices moves what they move, too."""
    reach: str  # name of the group; '': they move the region
    held: Any  # numbers of the handles' vertices
    moved: Any  # numbers of the vertices of the reach or region, with or without those of the handles


def earlier_handles(ob, count):
    """[EarlierHandles] of the first count handles, one for each reach; empty if the region was not made by Pull."""
    settings, found = ob.detail_deform, []
    handles = [h for h in list(settings.handles)[:count] if h.enabled and h.vertex_group in ob.vertex_groups]
    if not settings.pulled_region:
        return found
    there = set(ob.vertex_groups.keys())
    reaches = [r for r in dict.fromkeys(h.reach for h in handles) if (r or settings.region) in there]
    groups = [h.vertex_group for h in handles]
    members = mesh_data.members_of_each(ob, [*groups, *(reach or settings.region for reach in reaches)])
    for reach, moved in zip(reaches, members[len(groups):]):
        held = [vertices for handle, vertices in zip(handles, members) if handle.reach == reach]
        found.append(EarlierHandles(reach, np.concatenate(held), moved))
    return found


def _symmetric_axes(ob):
    return [axis for axis, letter in enumerate('xyz')
            if getattr(ob.data, f'use_mirror_{letter}') and not mirror_plane.is_mirrored(ob, axis)]


class Pull:
    """stages() does the work. If an exception or close() ends it early, it undoes all its changes."""

    def __init__(self, context, ob, radius=0.0, surface=None, falloff='MESH', curve_points=0):
        """radius: of the region, in world units; 0: guessed from the selection. surface: of selected_distances(), if
        known. falloff: one of options.FALLOFFS, unless the reach or region is shared with earlier handles.
        curve_points: as for handle_setup.add_handles()."""
        self.radius, self.remarks, self._falloff, self._curve_points = radius, [], falloff, curve_points
        self._context, self._ob, self._surface = context, ob, surface
        self._had_modifier = deform_modifier.find(ob) is not None
        self._count, self._index = len(ob.detail_deform.handles), ob.detail_deform.handle_index
        self._edited = list(context.objects_in_mode)

    def stages(self, wait, watch=False):
        """Generator: yields the fraction done. wait: block until the object is bound. watch: yield the progress of the
        bind in the background until it ends. Raises MeshProblem or native.NativeError."""
        ob, settings = self._ob, self._ob.detail_deform
        region = earlier = None
        try:
            handle_setup.add_handles(self._context, ob, curve_points=self._curve_points)
            yield 0.0
            bpy.ops.object.mode_set(mode='OBJECT')
            yield 0.0
            region, earlier = region_setup.snapshot(ob), binding_state.present(ob)
            registry.check_mesh(ob)
            self._mirror()
            yield 0.0
            if may_set_region(ob):
                self._set_moved_vertices()
                yield 0.0
            self._context.view_layer.update()  # evaluates the new empty's matrix
            binding.bind(ob, self._context.evaluated_depsgraph_get(), wait, keep_rest=bool(settings.signature))
            if watch:
                yield from self._until_bound()
        except BaseException:
            self._undo(region, earlier)
            raise
        settings.handle_index = self._count

    @property
    def made_modifier(self):
        return not self._had_modifier

    @property
    def empty(self):
        return self._ob.detail_deform.handles[self._count].target

    def _mirror(self):
        """Adds the symmetric handles for Edit Mode's symmetry."""
        axes = _symmetric_axes(self._ob)
        if axes and self._curve_points:
            self.remarks.append("Edit Mode's symmetry mirrors no curves: pull the other side by a curve of its own")
            return
        for axis in axes:
            handle = self._ob.detail_deform.handles[self._count]
            try:
                remark = mirroring.mirror(self._context, self._ob, handle, axis, symmetric=True, reaches=False)
            except mirroring.MirrorsItself:
                mirroring.keep_symmetric(self._ob, handle, axis)
                continue
            except MeshProblem as problem:  # the selected vertices are pulled without an image
                remark = str(problem)
            if remark:
                self.remarks.append(remark)

    def _set_moved_vertices(self):
        """Sets what the new handles move. Earlier handles with a vertex within the radius share it: all of them and the
        new ones then move the union of what they moved and the vertices within the radius. This is the region if there
        are no earlier handles, or if one of those within the radius moves the region; otherwise it is a reach."""
        ob, settings = self._ob, self._ob.detail_deform
        earlier = earlier_handles(ob, self._count)
        handles = settings.handles[self._count:]
        new = mesh_data.group_weights(ob, [h.vertex_group for h in handles]) > mesh_data.MEMBER_WEIGHT
        start = new.any(axis=0) if earlier or not self._count else region_setup.starting_vertices(ob)
        surface = self._surface
        if surface is None or not np.array_equal(surface.start, start):
            surface = region_setup.SurfaceDistances(ob, start, chosen=new[0])
        self.radius = self.radius or surface.suggested_radius()
        members = surface.within(self.radius)
        within_radius, moved = [other for other in earlier if members[other.held].any()], members.copy()
        for other in within_radius:
            moved[other.moved] = True
        sharing = [h for h in settings.handles if h.reach and h.reach in {other.reach for other in within_radius}]
        if earlier and not any(other.reach == "" for other in within_radius):
            region_setup.set_reach(ob, [*sharing, *handles], moved)
            for handle in handles:
                handle.falloff = sharing[0].falloff if sharing else self._falloff
            return
        for handle in sharing:
            handle.reach = ""
        region_setup.set_region(ob, moved)
        settings.pulled_region = True
        if not self._count and self._falloff != 'MESH':
            settings.smoothness = FALLOFF_ORDERS[self._falloff]

    def _until_bound(self):
        settings = self._ob.detail_deform
        content = settings.signature
        while handle_follower.cache.under_way(content):
            yield handle_follower.cache.under_way(content).progress()[1]
        if settings.signature != content or handle_follower.cache.find(content) is None:
            raise MeshProblem(settings.problem)

    def _undo(self, region, earlier):
        """Undoes the stages. region, earlier: the states to restore; None if they are unchanged."""
        try:
            self._undo_changes(region, earlier)
        except ReferenceError:
            pass  # the object was deleted meanwhile

    def _undo_changes(self, region, earlier):
        ob, settings = self._ob, self._ob.detail_deform
        if earlier:
            if settings.signature not in earlier.state:  # this Pull has begun to bind
                handle_follower.cache.let_go(settings.signature)
            settings.signature = ""  # so that nothing is compared with the lost binding
        handle_setup.remove_handles(ob, range(self._count, len(settings.handles)))
        if region:
            region_setup.restore(ob, region)
        if not self._had_modifier:
            channel.remove(ob)
        settings.handle_index = self._index
        if earlier:
            binding_state.restore(ob, earlier)
        self._context.view_layer.objects.active = ob
        unselected = [other for other in self._edited if not other.select_get()]
        for other in unselected:
            other.select_set(True)  # only selected objects enter Edit Mode
        bpy.ops.object.mode_set(mode='EDIT')
        for other in unselected:
            other.select_set(False)
