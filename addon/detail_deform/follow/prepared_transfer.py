# SPDX-License-Identifier: GPL-3.0-or-later
"""A factored transfer between two objects, and the job that makes it."""

import bpy
import numpy as np

from ..library import native
from ..library.options import TRANSFER, arguments_of
from ..scene import mesh_data, mirrored_source, proportions
from ..scene.loose import LooseVertices
from ..scene.mesh_data import MeshProblem
from ..scene.unmatched_parts import UnmatchedParts


def _spaces(source, target, stance):
    """[proportions.ProportionalSpace] of source and target. With a stance, (4, 4) from the source's space to the
    target's, the source is placed relative to the target; else each space only has the object's proportions."""
    own = [proportions.ProportionalSpace(proportions.of(ob)) for ob in (source, target)]
    if stance is None:
        return own
    linear = own[1].linear
    return [proportions.ProportionalSpace(linear @ stance[:3, :3], linear @ stance[:3, 3]), own[1]]


class Prepared:
    """A factored transfer between two objects, computed in the proportions that they have in the scene."""

    def __init__(self, transfer, source, target, worn, parts, loose, wide, unfollowed):
        """source, target: the proportions.ProportionalSpace of each. worn: whether the correspondence is by nearest
        points. parts, loose: the target's UnmatchedParts and LooseVertices. wide: the source's
        mirrored_source.MirroredSource, or None. unfollowed: of mirrored_source.unfollowed()."""
        self.info, self.worn, self.wide, self.unfollowed = transfer.info, worn, wide, unfollowed
        self.parts, self._loose = parts, loose
        self._transfer, self._source, self._target = transfer, source, target

    def apply(self, pose, rotation_only):
        """(n, 3) float32: the target's positions for a pose of the source. pose: (k, 3), the positions of the source's
        own vertices, or of all those of wide."""
        gradients = 'ROTATIONS' if rotation_only else 'WHOLE'
        pose = self._source.to(pose if self.wide is None else self.wide.with_reflections(pose))
        placed = self.parts.placed(self._transfer.apply(pose, gradients))
        return self._target.back(self._loose.place(placed, pose))


class Preparation:
    """The job that factors a transfer between two objects, with the interface of native's. Only the constructor reads
    Blender's data."""

    def __init__(self, source, target, matched, settings, precision='DOUBLE'):
        """settings: an object with attributes of the names in TRANSFER_SETTINGS. Raises MeshProblem or
        native.NativeError."""
        self._spaces = _spaces(source, target, matched.relative_transform)
        self._worn = matched.relative_transform is not None
        shapes = [mesh_data.rest_positions(ob.data) for ob in (source, target)]
        sides = [matched.source_triangles, matched.target_triangles]
        self._wide, self._unfollowed = mirrored_source.find(source) if self._worn else None, ""
        if self._wide:
            shapes[0], sides[0] = self._wide.with_reflections(shapes[0]), self._wide.triangles
        if self._worn:
            self._unfollowed = _unfollowed(source, (shapes[0], sides[0]), shapes[1], matched.relative_transform)
        meshes = [[space.to(shape), triangles] for space, shape, triangles in zip(self._spaces, shapes, sides)]
        triangles, edges = mesh_data.triangles(target.data), mesh_data.edges(target.data)
        self._loose = LooseVertices(meshes[1][0], triangles, edges, meshes[0][0] if matched.is_by_topology else None)
        anchors = _anchors(target, settings)
        self._parts = UnmatchedParts(target, (meshes[1][0], triangles, edges), matched,
                                     anchors if settings.anchor == 'PINNED' else [],
                                     'RIGID' if settings.placing == 'PARTS' else 'AUTO')
        arguments = {**_arguments(settings, self._worn), 'pairs_of': matched.pairs_of}
        if self._worn and np.linalg.det(self._spaces[0].linear) < 0:
            meshes[0][1] = np.ascontiguousarray(sides[0][:, ::-1])  # a reflection turns triangles inside out: back
        if matched.points is not None:
            arguments['point_triangles'], arguments['point_weights'] = matched.points
        self._job = native.TransferJob(*meshes, matched.pairs, anchors=anchors, precision=precision,
                                       **arguments)
        self.progress, self.cancel, self.close = self._job.progress, self._job.cancel, self._job.close
        self.fractions = self._job.fractions

    @property
    def cancelled(self):
        return self._job.cancelled

    def draft(self):
        """None: there are no drafts of transfers."""

    def finish(self):
        """Returns the Prepared, or raises native.NativeError."""
        return Prepared(self._job.finish(), *self._spaces, self._worn, self._parts, self._loose, self._wide,
                        self._unfollowed)


def _unfollowed(source, followed, shape, stance):
    back = np.linalg.inv(stance)
    points = shape @ back[:3, :3].T + back[:3, 3]
    return mirrored_source.unfollowed(source, followed, points, bpy.context.evaluated_depsgraph_get())


def content(source, target, by, settings, worn):
    """A signature of all that a prepared transfer depends on: equal texts mean equal content. by: a signature of the
    correspondence. settings: as for Preparation. worn: whether the correspondence is by nearest points."""
    anchors = ""
    if settings.anchor_group in target.vertex_groups and settings.anchor in {'VERTICES', 'PINNED'}:
        anchors = mesh_data.signature(mesh_data.members(target, settings.anchor_group))
    meshes = [mesh_data.signature(mesh_data.rest_positions(side.data)) + mesh_data.topology_signature(side.data)
              for side in (source, target)]
    scales = [proportions.signature(side) for side in (source, target)]
    arguments = [f"{value:.5g}" if isinstance(value, float) else str(value)
                 for value in _arguments(settings, worn).values()]
    return '.'.join([*meshes, by, anchors, *arguments, *scales, mirrored_source.signature(source) if worn else "",
                     str(len(target.data.edges))])


def _arguments(settings, worn):
    """The arguments of native.TransferJob that are settings. worn: as for content(); else there is no gap."""
    return {name: value for name, value in arguments_of(TRANSFER, settings).items()
            if name != 'pairs_of' and (worn or name != 'gap')}


def _anchors(target, settings):
    anchors, anchor_group = (), settings.anchor_group
    if settings.anchor in {'VERTICES', 'PINNED'}:
        if anchor_group not in target.vertex_groups:
            raise MeshProblem(f"'{target.name}' has no vertex group '{anchor_group}': choose that of the vertices "
                              "that stay in place in Anchor Group.")
        anchors = np.flatnonzero(mesh_data.members(target, anchor_group))
        if not len(anchors):
            raise MeshProblem(f"The group '{anchor_group}' has no vertex with a weight over "
                              f"{mesh_data.MEMBER_WEIGHT}: assign those that stay in place.")
    return anchors


def remarks(transfer):
    """Generator of sentences: properties of these meshes that may surprise the user."""
    info = transfer.info
    if transfer.unfollowed:
        yield transfer.unfollowed
    counts = transfer.parts.counts
    if counts and counts.rigid + counts.bending:
        yield (f"{counts.rigid + counts.bending:,} loose part(s) of this mesh correspond to nothing and ride along "
               "with what is beneath.")
    if counts and counts.staying:
        yield (f"{counts.staying:,} loose part(s) of this mesh (such as that of vertex {counts.staying_example}) "
               "correspond to nothing and go with the rest.")
    elif info.unmatched_count and not counts:
        yield (f"{info.unmatched_count:,} triangles of this mesh correspond to nothing and go with the nearest "
               "that do.")
    if info.degenerate_count:
        yield f"{info.degenerate_count:,} triangles of this mesh have next to no area."
    if info.overstretched_count and not transfer.worn:
        yield (f"{info.overstretched_count:,} triangles of the source (such as {info.overstretched_example}) "
               "correspond to more than eight times their area, so what is around them is taken in their place: add "
               "a marker there if that looks wrong.")
    if info.through_count:
        yield (f"{info.through_count:,} vertices of this mesh (such as {info.through_example}) are through the source "
               "at rest, and are kept from going farther.")
    if info.mirrored:
        yield ("This mesh corresponds to the source's mirror image, so deformations are mirrored with it: if that is "
               "wrong, left and right are exchanged in what corresponds.")
