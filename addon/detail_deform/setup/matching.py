# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds the correspondence of two meshes: by topology, shape and markers, a list, nearest points, or a saved match."""

import itertools
import os

import bpy
import numpy as np

from .. import session
from ..library import native
from ..library.options import NEAREST
from ..scene import correspondence, files, mesh_data, proportions, saved_match
from ..scene.mesh_data import MeshProblem
from . import marker_check, markers, pair_lists

# The last match, so that a transfer with other settings needs no second search. {key of the two shapes and their
# markers: (_placement_key(), Correspondence)}
_last = session.Memo(1)
# Mean confidence above which a match is reused though an object moved: saves a search, may miss a better fit.
_REUSE_CONFIDENCE = 0.5

_WHERE_IT_IS_RIGHT = "If it is right, press Find Match, which takes it as it is."
_WHERE_THEY_ARE_RIGHT = "If they are right, press Find Match, which takes them as they are."


def _placement_key(shapes, stance):
    """Key of the source's placement: the corners of its box in the target's space, in units of the diagonal of the
    target's box, rounded to 4 digits. stance: of proportions.relative_transform(). b'' where that is None."""
    if stance is None:
        return b''
    (low, high), (least, most) = ((each.min(0, initial=0), each.max(0, initial=0)) for each in shapes)
    corners = np.array(list(itertools.product(*zip(low, high)))) @ stance[:, :3].T + stance[:, 3]
    return (np.round(corners / max(np.linalg.norm(most - least), 1e-30), 4) + 0.0).tobytes()  # −0 + 0 = +0


def search(source, target):
    """Generator: yields the fraction done and returns the Correspondence, found by the shapes of both objects and the
    markers that they have in common. Raises MeshProblem or native.NativeError."""
    sides, pairs = (source, target), markers.pairs(source, target)
    shapes, stance = [proportions.shape(ob) for ob in sides], proportions.relative_transform(source, target)
    searched_for = (*map(mesh_data.signature, shapes), *(mesh_data.topology_signature(ob.data) for ob in sides),
                    pairs.tobytes())
    placement = _placement_key(shapes, stance)
    if searched_for in _last:
        before, matched = _last.get(searched_for)
        if before == placement or matched.confidence.mean() > _REUSE_CONFIDENCE:
            return matched
    matched = correspondence.Correspondence(
        mesh_data.triangles(source.data), mesh_data.triangles(target.data), None, None)
    match = native.Match((shapes[0], matched.source_triangles), (shapes[1], matched.target_triangles), pairs,
                         stance=stance)
    try:
        yield from match.fractions()
        matched.pairs, matched.confidence, _ = match.finish()
        matched.points = match.points
        matched.ambiguous, matched.mirrored = bool(match.info.ambiguous), bool(match.info.mirrored)
    finally:
        match.close()
    return _last.put(searched_for, (placement, matched))[1]


def ambiguity(source, target):
    """The sentence for an ambiguous correspondence: what is in doubt, and what to do."""
    return (f"'{source.name}' fits '{target.name}' about as well turned another way: mark one or two places on both "
            "(Add Transfer Marker, in Edit Mode), where front and back or left and right differ.")


def needs_search(how):
    """Whether this way searches or reads the correspondence, rather than deriving it from equal topology or taking the
    match saved with the target."""
    return how in {'MARKERS', 'LIST', NEAREST}


def automatic(source, target, folder):
    """(how, path, pairs_of) for find(): the first way for which these two objects have the data. folder: of list files
    that are named after their targets; '' for none. Raises MeshProblem if no way applies."""
    settings = target.detail_deform.transfer
    for ob in (source, target):
        if not ob.data.polygons:
            raise MeshProblem(f"'{ob.name}' has no faces, and only surfaces can be matched: add faces, or leave it "
                              "out.")
    if settings.correspondence == NEAREST:
        return NEAREST, "", settings.pairs_of
    if mesh_data.is_copy(source.data, target.data):
        return 'TOPOLOGY', "", settings.pairs_of
    if settings.correspondence == 'LIST' and settings.filepath:
        return 'LIST', *list_file("", target)
    if saved_match.fits(source, target):
        return 'STORED', "", settings.pairs_of
    if markers.are_enough(source, target):
        return 'MARKERS', "", settings.pairs_of
    path, pairs_of = list_file(folder, target)
    if path and os.path.exists(path):
        return 'LIST', path, pairs_of
    stored_source = saved_match.stored_for(target)
    match = f"a Saved Match for '{stored_source}' as it was" if stored_source else "no Saved Match"
    raise MeshProblem(f"'{target.name}' has other vertices or faces than '{source.name}', {match}, fewer than "
                      f"{markers.MIN_COMMON} markers with the same numbers, and no list: set markers on both, or press "
                      "Find Match there.")


def list_file(folder, target):
    """(path, pairs_of) of a target's list file: in the folder, or the one in its panel if there is no folder. Raises
    MeshProblem if the file is another object's."""
    settings = target.detail_deform.transfer
    if not folder:
        return settings.filepath, settings.pairs_of
    path = os.path.join(bpy.path.abspath(folder), files.name_for(target.name) + ".txt")
    owner = bpy.data.objects.get(os.path.splitext(files.name_on_disk(path))[0])
    if owner not in {None, target} and owner.type == 'MESH':  # file systems may ignore case, Blender doesn't
        raise MeshProblem(f"'{path}' is the list of '{owner.name}', and that of '{target.name}' would be called alike: "
                          "rename one of these objects.")
    return path, pair_lists.pairs_of_file(path, settings.pairs_of)


def find(how, source, target, path, pairs_of):
    """Generator: yields the fraction done and returns the Correspondence of two objects. how: a value of the setting
    correspondence. path, pairs_of: of a list file. Raises MeshProblem or native.NativeError."""
    if how == 'MARKERS':
        doubts = yield from marker_check.search(source, target)
        if doubts:
            raise MeshProblem(marker_check.sentence(doubts, source, target) + " " + _WHERE_THEY_ARE_RIGHT)
        matched = yield from search(source, target)
        if matched.ambiguous:
            raise MeshProblem(ambiguity(source, target) + " " + _WHERE_IT_IS_RIGHT)
        return matched
    if how == 'LIST':
        return pair_lists.by_list(source, target, bpy.path.abspath(path), pairs_of)
    if how == NEAREST:
        return correspondence.by_nearest(source, target)
    if how == 'STORED':
        return saved_match.stored(source, target)
    return correspondence.by_topology(source, target)
