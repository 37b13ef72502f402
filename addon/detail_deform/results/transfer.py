# SPDX-License-Identifier: GPL-3.0-or-later
"""Carries the deformation of one mesh over to another: its pose, its shape keys, its animation."""

import dataclasses
import time
from types import SimpleNamespace

from ..follow import prepared_transfer, transfer_cache, written_offsets
from ..library.options import CORRESPONDENCES
from ..scene import correspondence, mesh_data, partial_evaluation, saved_match, source_pose, transferred
from ..scene.mesh_data import MeshProblem
from ..setup import matching
from . import frames, keyframed_shape_keys, point_cache, transferred_keys
from .outcome import Outcome

_SHARE_OF_SEARCH, _SHARE_OF_FACTOR = 0.8, 0.3  # fractions of the progress: of the whole, and of the rest
_TITLES = {name: title for name, title, _ in CORRESPONDENCES}


@dataclasses.dataclass
class TransferRequest:
    """What is carried over, and how: the operator's properties, or the panel's settings where these are not given."""
    what: str
    settings: SimpleNamespace  # by the names of TRANSFER_SETTINGS; correspondence may be 'AUTOMATIC', too
    pattern: str
    replace: bool
    drivers: bool
    names: dict  # of key_names.read()
    alike_names: bool
    bake_as: str
    start: int
    end: int
    cache_path: str
    lists: str = ""  # a folder of pair lists, each named as its target

    def with_settings(self, **changed):
        """A copy with some settings changed."""
        return dataclasses.replace(self, settings=SimpleNamespace(**{**vars(self.settings), **changed}))


def usual_path(ob):
    """The default path of an animation's cache."""
    return point_cache.usual_path(ob, transferred.find_cache(ob))


def check(source, request):
    """Raises MeshProblem for faults of the options that don't depend on the target."""
    if request.what == 'ANIMATION':
        frames.check_range(request.start, request.end)
    elif request.what != 'POSE':
        transferred_keys.chosen(source, request.what == 'ACTIVE_KEY', request.pattern)


def begin(context, source, target, request):
    """Checks the options at once, and returns a generator that does the work, yields the fraction done and returns the
    Outcome. It changes the target only after all results are computed. Both raise MeshProblem or native.NativeError.
    """
    mesh_data.check_object(target)
    correspondence.check_source(source, target)
    settings, keys = target.detail_deform.transfer, None
    if settings.live:
        raise MeshProblem(f"'{target.name}' follows '{settings.source.name if settings.source else ''}' already, "
                          "which would be doubled: press Follow to stop that first.")
    check(source, request)
    if request.what in {'ACTIVE_KEY', 'ALL_KEYS'}:
        keys = transferred_keys.chosen(source, request.what == 'ACTIVE_KEY', request.pattern)
    if request.what == 'ANIMATION':
        frames.check_time(context.scene)
        if request.bake_as == 'SHAPE_KEYS':
            keyframed_shape_keys.check(target)
        else:
            request = dataclasses.replace(request, cache_path=request.cache_path or usual_path(target))
            point_cache.absolute(request.cache_path)
    else:
        transferred_keys.check(target)
    if request.settings.correspondence == 'AUTOMATIC':
        how, path, pairs_of = matching.automatic(source, target, request.lists)
        request = request.with_settings(correspondence=how, filepath=path, pairs_of=pairs_of)
    elif request.settings.correspondence == 'LIST' and request.lists:
        path, pairs_of = matching.list_file(request.lists, target)
        request = request.with_settings(filepath=path, pairs_of=pairs_of)
    return _matched_and_carried(context, source, target, keys, request)


def _matched_and_carried(context, source, target, keys, request):
    started, settings = time.perf_counter(), request.settings
    searched = _SHARE_OF_SEARCH if settings.correspondence == 'MARKERS' else 0
    factored_at = searched + _SHARE_OF_FACTOR * (1 - searched)
    search = matching.find(settings.correspondence, source, target, settings.filepath, settings.pairs_of)
    matched = yield from subprogress(search, 0, searched)
    transfer = yield from subprogress(transfer_cache.prepare(source, target, matched, settings), searched, factored_at)
    outcome = yield from subprogress(
        _carry(context, _SeamClosingTransfer(transfer, target), source, target, keys, request), factored_at, 1)
    if matching.needs_search(settings.correspondence):
        saved_match.store(matched, source, target)
    outcome.matched_by = _TITLES[settings.correspondence]
    outcome.remarks += prepared_transfer.remarks(transfer)
    left_out = partial_evaluation.left_out(source, context.evaluated_depsgraph_get()) if keys is None else ""
    if left_out:
        outcome.remarks.append(left_out)
    outcome.seconds = time.perf_counter() - started
    return outcome


class _SeamClosingTransfer:
    """A prepared_transfer.Prepared whose results keep the target's seams closed (written_offsets.Closing)."""

    def __init__(self, transfer, target):
        self._transfer, self.wide, self._rest = transfer, transfer.wide, mesh_data.rest_positions(target.data)
        self._closing = written_offsets.Closing(target)

    def apply(self, pose, rotation_only):
        """As prepared_transfer.Prepared.apply()."""
        moved = self._transfer.apply(pose, rotation_only)
        offsets = (moved - self._rest).ravel()
        closed = self._closing.of(offsets)
        return moved if closed is offsets else self._rest + closed.reshape(-1, 3)


def subprogress(work, begin, end):
    """Generator: runs work, a generator of fractions, as the part from begin to end of a longer one; returns its
    result."""
    while True:
        try:
            done = next(work)
        except StopIteration as finished:
            return finished.value
        try:
            yield begin + (end - begin) * done
        except GeneratorExit:
            work.close()
            raise


def _carry(context, transfer, source, target, keys, request):
    """Generator of the fraction done; returns the Outcome."""
    if request.what == 'ANIMATION':
        return (yield from _carry_animation(context, transfer, source, target, request))
    if keys is None:
        return (yield from transferred_keys.from_pose(context, transfer, source, target, request))
    return (yield from transferred_keys.from_keys(transfer, source, target, keys, request))


def _carry_animation(context, transfer, source, target, request):
    """As _carry()."""
    outcome = Outcome(frames=request.end + 1 - request.start)
    poses = _poses(context, transfer, source, request)
    if request.bake_as == 'SHAPE_KEYS':
        rest = mesh_data.rest_positions(target.data)
        offsets = (pose - rest for pose in poses)
        outcome.names = yield from keyframed_shape_keys.add(target, offsets, request.start, request.end)
    else:
        yield from point_cache.write(request.cache_path, poses, request.start, request.end)
        transferred.use_cache(target, request.cache_path, request.start)
    return outcome


def _poses(context, transfer, source, request):
    """Generator of (n, 3): the target's positions in each frame."""
    for _ in frames.walk(context, source, request.start, request.end):
        pose = source_pose.evaluated_pose(source, context.evaluated_depsgraph_get(), transfer.wide)
        yield transfer.apply(pose, request.settings.rotation_only)
