# SPDX-License-Identifier: GPL-3.0-or-later
"""What the steps of a call ask of a mesh object, each read once."""

import functools

import numpy as np

from . import deform_modifier, handle_curves, handle_rests, mesh_data, proportions
from .mesh_data import MeshProblem
from .pieces import Pieces


def enabled_handles(settings):
    return [handle for handle in settings.handles if handle.enabled]


def with_empties(settings):
    """The enabled handles that don't mirror another one, and so have an empty."""
    return [handle for handle in enabled_handles(settings) if not handle.mirrors]


class Subject:
    """A mesh object, its settings and its enabled handles, as a call finds them. It is made where a call begins and
    handed on; never kept, as undo frees what it refers to, and made anew after the call has changed what was read."""

    def __init__(self, ob, depsgraph=None, poses=None):
        """poses: a dict that the subjects of a call share, for poses of sources that several of them follow."""
        self.ob, self.mesh, self.settings, self.depsgraph = ob, ob.data, ob.detail_deform, depsgraph
        self.poses = {} if poses is None else poses

    @functools.cached_property
    def modifier(self):
        """The modifier that displays the result, or None."""
        return deform_modifier.find(self.ob)

    @functools.cached_property
    def space(self):
        """The proportions.ProportionalSpace in which the surface is bound."""
        return proportions.bound(self.settings)

    @functools.cached_property
    def handles(self):
        """[handle]: those that are enabled. All that follows has a row for each of them."""
        return enabled_handles(self.settings)

    @functools.cached_property
    def own(self):
        """[number] of the handles with an empty of their own, which don't mirror another one."""
        return [number for number, handle in enumerate(self.handles) if not handle.mirrors]

    @functools.cached_property
    def mirror_sources(self):
        """{number: number of the handle that it mirrors}. Raises MeshProblem."""
        found = {}
        for number, handle in enumerate(self.handles):
            if not handle.mirrors:
                continue
            found[number] = next((k for k in self.own if self.handles[k].name == handle.mirrors), None)
            if found[number] is None:
                raise MeshProblem(f"Handle '{handle.name}' mirrors '{handle.mirrors}', which is not there, is not "
                                  "enabled or mirrors another one: choose one with an empty in Mirrors (Handles).")
            if handle_curves.has_curve(self.handles[found[number]]):
                raise MeshProblem(f"Handle '{handle.name}' mirrors '{handle.mirrors}', which follows a curve: give it "
                                  "a curve of its own, mirrored.")
        return found

    @functools.cached_property
    def symmetric(self):
        """[number] of the handles whose motion is kept its own mirror image. Raises MeshProblem."""
        # One by one: in Blender 3.4 foreach_get() reads no enumeration, and doesn't say so.
        found = [number for number, handle in enumerate(self.handles) if handle.symmetric]
        for number in found:
            if handle_curves.has_curve(self.handles[number]):
                raise MeshProblem(f"Handle '{self.handles[number].name}' follows a curve, which nothing keeps "
                                  "symmetric: clear Symmetric, and make the curve so.")
        return found

    @functools.cached_property
    def are_free(self):
        """(h,) bool: which handles are free, that is, only place. Those that mirror another one are as it is."""
        result = np.array([handle.turns == 'FREE' and not handle_curves.has_curve(handle) for handle in self.handles],
                          bool)
        for number, source in self.mirror_sources.items():
            result[number] = result[source]
        return result

    @functools.cached_property
    def pieces(self):
        """The handles' Pieces, which are the handles of the library."""
        return Pieces(self.handles)

    @functools.cached_property
    def rests(self):
        """(h, 4, 4) float64: handle_rests.rest_transform() of each, read in bulk."""
        rests = self.values('rest_matrix', 16)
        rests[~rests.any(axis=1)] = np.eye(4).ravel()
        return rests.reshape(-1, 4, 4)

    def values(self, name, size):
        """(h, size) float64: an array property of each handle."""
        values = np.empty(size * len(self.settings.handles), np.float32)
        self.settings.handles.foreach_get(name, values)
        enabled = [number for number, handle in enumerate(self.settings.handles) if handle.enabled]
        return values.reshape(-1, size)[enabled].astype(np.float64)

    @functools.cached_property
    def reaches(self):
        """[group] of each handle's reach; '' if it has none and moves the region."""
        return [handle.reach if self.settings.base == 'COMPUTED' else "" for handle in self.handles]

    @property
    def region(self):
        """The region's group; '' for the whole mesh, and if all handles have reaches of their own."""
        return self.settings.region if not self.reaches or "" in self.reaches else ""

    @property
    def groups(self):
        """[(name, group)] of the handles."""
        return [(handle.name, handle.vertex_group) for handle in self.handles]

    @property
    def has_new_handle(self):
        """Whether a handle, or a handle's curve, was added since the last Bind."""
        return any(map(self.is_new, self.own))

    def is_new(self, number):
        """Whether the handle, or its curve, was added since the last Bind."""
        handle = self.handles[number]
        return not handle_rests.has_rest(handle) or handle_curves.is_new(handle)

    def check_groups(self):
        """Raises MeshProblem if the region or a handle refers to a missing vertex group. Cheap enough for every
        frame."""
        mesh_data.check_groups(self.ob, self.region, self.groups)
        there = set(self.ob.vertex_groups.keys()) if any(self.reaches) else ()
        for handle, reach in zip(self.handles, self.reaches):
            if reach and reach not in there:
                raise MeshProblem(f"Handle '{handle.name}': its reach refers to the vertex group '{reach}', which "
                                  f"'{self.ob.name}' does not have: choose another group, or none.")
