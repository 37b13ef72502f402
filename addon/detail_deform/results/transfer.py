# SPDX-License-Identifier: GPL-3.0-or-later
"""The deformation of one mesh carried over to another: its pose, its shape keys, its animation."""

import dataclasses
import time

from ..follow import prepared
from ..scene import correspondence, mesh_data, source_pose, transferred
from ..scene.mesh_data import MeshProblem
from ..setup import matching
from . import frames, keyed_keys, point_cache, transferred_keys

_SHARE_OF_SEARCH = 0.8


@dataclasses.dataclass
class Wanted:
    """What is carried over and how: the operator's properties, those of the panel where they are not given."""
    what: str
    correspondence: str
    filepath: str
    pairs_of: str
    rotation_only: bool
    anchor: str
    anchor_group: str
    formulation: str
    pattern: str
    replace: bool
    drivers: bool
    bake_as: str
    start: int
    end: int
    cache_path: str


def usual_path(ob):
    """Where an animation's cache goes unless the user says otherwise."""
    return point_cache.usual_path(ob, transferred.find_cache(ob))


def begin(context, source, target, wanted):
    """Generator of the work; yields the fraction done and returns sentences. What is wrong with the question is said
    here and now. Raises MeshProblem."""
    settings, keys = target.detail_deform.transfer, None
    if settings.live:
        raise MeshProblem(f"'{target.name}' follows '{settings.source.name if settings.source else ''}' already, "
                          "which would be doubled: press Follow to stop that first.")
    if wanted.what in {'ACTIVE_KEY', 'ALL_KEYS'}:
        keys = transferred_keys.chosen(source, wanted.what == 'ACTIVE_KEY', wanted.pattern)
    if wanted.what == 'ANIMATION':
        frames.check_range(wanted.start, wanted.end)
        if wanted.bake_as == 'SHAPE_KEYS':
            keyed_keys.check(target)
        else:
            wanted = dataclasses.replace(wanted, cache_path=wanted.cache_path or usual_path(target))
            point_cache.absolute(wanted.cache_path)
            point_cache.check_time(context)
    return _all(context, source, target, keys, wanted)


def _all(context, source, target, keys, wanted):
    share = _SHARE_OF_SEARCH if wanted.correspondence == 'MARKERS' else 0
    search = matching.find(wanted.correspondence, source, target, wanted.filepath, wanted.pairs_of)
    matched = yield from _share(search, 0, share)
    transfer = prepared.prepare(source, target, matched, wanted.anchor, wanted.anchor_group, wanted.formulation)
    yield share
    started = time.perf_counter()
    made = yield from _share(_carry(context, transfer, source, target, keys, wanted), share, 1)
    if matching.must_be_found(wanted.correspondence):
        correspondence.store(matched, source, target)
    return [f"{made} from '{source.name}' in {time.perf_counter() - started:.1f} s", *prepared.remarks(transfer)]


def _share(work, begin, end):
    """Of a longer work: its fractions as part of the whole; returns what it returns."""
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


def _carry(context, transfer, source, target, keys, wanted):
    """Generator of the fraction done; returns what was made, in words."""
    if wanted.what == 'ANIMATION':
        return (yield from _carry_animation(context, transfer, source, target, wanted))
    if keys is None:
        names = yield from transferred_keys.from_pose(context, transfer, source, target, wanted.rotation_only,
                                                      wanted.replace)
    else:
        names = yield from transferred_keys.from_keys(transfer, source, target, keys, wanted.rotation_only,
                                                      wanted.replace, wanted.drivers)
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"Shape {'key' if len(names) == 1 else 'keys'} {', '.join(map(repr, names[:3]))}{more}"


def _carry_animation(context, transfer, source, target, wanted):
    """As _carry()."""
    count = wanted.end + 1 - wanted.start
    poses = _poses(context, transfer, source, wanted)
    if wanted.bake_as == 'SHAPE_KEYS':
        rest = mesh_data.rest(target.data)
        yield from keyed_keys.add(target, (pose - rest for pose in poses), wanted.start, wanted.end)
        return f"{count:,} keyed shape keys"
    yield from point_cache.write(wanted.cache_path, poses, wanted.start, wanted.end)
    transferred.use_cache(target, wanted.cache_path, wanted.start)
    return f"{count:,} frames"


def _poses(context, transfer, source, wanted):
    """Generator of (n, 3): the target in each frame."""
    for _ in frames.walk(context, source, wanted.start, wanted.end):
        pose = source_pose.evaluated_pose(source, context.evaluated_depsgraph_get())
        yield transfer.apply(pose, wanted.rotation_only)
