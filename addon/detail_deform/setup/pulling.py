# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull: makes a handle of the selected vertices and a region around it, and binds, as a generator of short stages."""

from typing import Any, NamedTuple

import bpy
import numpy as np

from ..follow import binding, binding_state, handle_follower, lifecycle, registry
from ..library.options import FALLOFF_ORDERS
from ..scene import channel, deform_modifier, group_columns, mesh_data, mirror_plane, selection
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
    images = [mirroring.mirror_image(ob, chosen, axis)[0] for axis in symmetric_axes(ob)]
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
    members = mesh_data.members_of_each(ob, [*groups, *(reach or settings.region for reach in reaches)],
                                        group_columns.entries)
    for reach, moved in zip(reaches, members[len(groups):]):
        held = [vertices for handle, vertices in zip(handles, members) if handle.reach == reach]
        found.append(EarlierHandles(reach, np.concatenate(held), moved))
    return found


def symmetric_axes(ob):
    """[axis]: 0 to 2, those of the mesh's symmetry whose other side is no Mirror modifier's."""
    return [axis for axis, letter in enumerate('xyz')
            if getattr(ob.data, f'use_mirror_{letter}') and not mirror_plane.is_mirrored(ob, axis)]


def bind(context, ob, wait, keep_rest):
    """As binding.bind(). In the window Blender evaluates the changes meanwhile, so that they don't count as the user's
    edits."""
    depsgraph = context.evaluated_depsgraph_get()
    binding.bind(ob, depsgraph, wait, keep_rest)
    if not lifecycle.must_wait(depsgraph):  # else this would wait for the bind
        lifecycle.take_in(ob, context.view_layer)


def until_bound(ob):
    """Generator: yields the progress of the bind in the background until it ends. Raises MeshProblem."""
    settings = ob.detail_deform
    content = settings.signature
    while handle_follower.cache.under_way(content):
        yield handle_follower.cache.under_way(content).progress()[1]
    if settings.signature != content or handle_follower.cache.find(content) is None:
        raise MeshProblem(settings.problem)


class Pull:
    """stages() does the work. If an exception or close() ends it early, it undoes all its changes."""

    def __init__(self, context, ob, radius=0.0, surface=None, falloff='MESH', curve_points=0):
        """radius: of the region, in world units; 0: guessed from the selection. surface: of selected_distances(), if
        known. falloff: one of options.FALLOFFS, unless the reach or region is shared with earlier handles.
        curve_points: as for handle_setup.add_handles()."""
        self.radius, self.remarks, self._falloff, self._curve_points = radius, [], falloff, curve_points
        self._context, self._ob, self._surface = context, ob, surface
        self.is_binding = self._is_undone = False
        self._may_move, self._always_reach = True, False  # which vertices may follow; whether to leave the region alone
        self._region = self._binding = None  # the states before, once they may change
        self._had_modifier = deform_modifier.find(ob) is not None
        self._count, self._index = len(ob.detail_deform.handles), ob.detail_deform.handle_index
        self._edited = list(context.objects_in_mode)

    def stages(self, wait, watch=False):
        """Generator: yields the fraction done. wait: block until the object is bound. watch: yield the progress of the
        bind in the background until it ends. Raises MeshProblem or native.NativeError."""
        ob, settings = self._ob, self._ob.detail_deform
        try:
            with lifecycle.to_be_bound(ob):
                yield from self._change()
            bind(self._context, ob, wait, keep_rest=bool(settings.signature))
            self.is_binding = True
            if watch:
                yield from until_bound(ob)
        except BaseException:
            self.undo()
            raise
        settings.handle_index = self._count

    def _change(self):
        """Generator: makes the handles and sets what they move."""
        yield from self._add_handle()
        self._region, self._binding = region_setup.snapshot(self._ob, self._count), binding_state.present(self._ob)
        registry.check_mesh(self._ob)
        self._mirror()
        yield 0.0
        self._set_moved_vertices()
        yield 0.0
        self._context.view_layer.update()  # evaluates the new empty's matrix

    def _add_handle(self):
        handle_setup.add_handles(self._context, self._ob, curve_points=self._curve_points)
        yield 0.0
        bpy.ops.object.mode_set(mode='OBJECT')
        yield 0.0

    @property
    def made_modifier(self):
        return not self._had_modifier

    @property
    def empty(self):
        return self._ob.detail_deform.handles[self._count].target

    def _mirror(self):
        """Adds the symmetric handles for Edit Mode's symmetry."""
        axes = symmetric_axes(self._ob)
        if len(axes) > 1:
            self.remarks.append("With the symmetry of several axes each pulls its own other side; what lies across two "
                                "of them is not pulled along: pull that by itself")
        if axes and self._curve_points:
            self.remarks.append("Edit Mode's symmetry mirrors no curves: pull the other side by a curve of its own")
            return
        for axis in axes:
            handle, image = self._ob.detail_deform.handles[self._count], None
            try:
                image = self._image(axis)
                remark = mirroring.mirror(self._context, self._ob, handle, axis, symmetric=True, reaches=False,
                                          image=image)
            except mirroring.MirrorsItself:
                mirroring.keep_symmetric(self._ob, handle, axis, image)
                continue
            except MeshProblem as problem:  # the selected vertices are pulled without an image
                remark = str(problem)
            if remark:
                self.remarks.append(remark)

    def _image(self, axis):
        """(n,) bool: the vertices of the new handle's mirror image; None: those at the mirrored places. Raises
        MeshProblem where nothing is to be mirrored."""

    def _set_moved_vertices(self):
        """Sets what the new handles move, unless the user has set the region."""
        ob = self._ob
        if not may_set_region(ob):
            return
        earlier = earlier_handles(ob, self._count)
        groups = [handle.vertex_group for handle in ob.detail_deform.handles[self._count:]]
        new = mesh_data.group_weights(ob, groups) > mesh_data.MEMBER_WEIGHT
        start = new.any(axis=0) if earlier or not self._count else region_setup.starting_vertices(ob)
        surface = self._surface
        if surface is None or not np.array_equal(surface.start, start):
            surface = region_setup.SurfaceDistances(ob, start, chosen=new[0])
        self.radius = self.radius or surface.suggested_radius()
        self._move(surface.within(self.radius), earlier)

    def _move(self, members, earlier):
        """Has the new handles move these vertices. Earlier handles with a vertex among them share them: all of these
        and the new ones then move the union of what they moved and the members. This is the region if there are no
        earlier handles, or if one of those that share moves the region; otherwise it is a reach. members: (n,) bool.
        earlier: of earlier_handles()."""
        ob, settings = self._ob, self._ob.detail_deform
        handles = settings.handles[self._count:]
        within_radius, moved = [other for other in earlier if members[other.held].any()], members.copy()
        for other in within_radius:
            moved[other.moved] = True
        sharing = [h for h in settings.handles if h.reach and h.reach in {other.reach for other in within_radius}]
        moved &= self._may_move
        if (earlier or self._always_reach) and not any(other.reach == "" for other in within_radius):
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

    def undo(self):
        """Undoes the stages. Does nothing the second time."""
        if self._is_undone:
            return
        self._is_undone = True
        try:
            self._undo_changes()
        except ReferenceError:
            pass  # the object was deleted meanwhile

    def _undo_changes(self):
        ob, settings, earlier = self._ob, self._ob.detail_deform, self._binding
        if earlier:
            if settings.signature not in earlier.state:  # this Pull has begun to bind
                handle_follower.cache.let_go(settings.signature)
            settings.signature = ""  # so that nothing is compared with the lost binding
        handle_setup.remove_handles(ob, range(self._count, len(settings.handles)))
        if self._region:
            region_setup.restore(ob, self._region)
        if not self._had_modifier:
            channel.remove(ob)
        settings.handle_index = self._index
        if earlier:
            binding_state.restore(ob, earlier)
        self._context.view_layer.objects.active = ob
        self._return_to_mode()

    def _return_to_mode(self):
        unselected = [other for other in self._edited if not other.select_get()]
        for other in unselected:
            other.select_set(True)  # only selected objects enter Edit Mode
        bpy.ops.object.mode_set(mode='EDIT')
        for other in unselected:
            other.select_set(False)
