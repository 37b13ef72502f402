# SPDX-License-Identifier: GPL-3.0-or-later
"""Examples, each a shape key, made of poses that an armature or other modifiers give the mesh."""

import contextlib

import numpy as np

from ..scene import apply_result, examples, mesh_data, posers
from ..scene.mesh_data import MeshProblem
from . import pose_frames
from .pose_samples import Samples, size

MOST = 1000  # examples; the library's limit (kMostExamples)
_SAME = 1e-4  # fraction of the mesh's size: poses that differ less are the same


def add(context, ob, poses, count=0):
    """Generator: makes an example of each pose that differs from the rest and from all examples; yields the fraction
    done. Returns (names of the examples, names of shape keys whose values differ between the poses, as by drivers).
    count: takes only so many poses, those that differ most; 0: all. Raises MeshProblem; nothing is added then."""
    mesh_data.check_object(ob)
    keys = mesh_data.relative_keys(ob)
    posers.of(ob)
    begin = 0.0
    if count:
        poses = yield from _most_different(context, ob, poses, count)
        begin = 0.8
    if len(poses) + len(ob.detail_deform.examples) > MOST:
        raise MeshProblem(f"{len(poses):,} poses are more than there may be examples: take a larger step, or those "
                          "that differ most.")
    found, known, least = [], _known(ob), _SAME * size(ob)
    values = [set() for _ in keys]
    with contextlib.closing(pose_frames.walk(context, ob, poses)) as walk:
        for number, (pose, positions) in enumerate(zip(poses, walk), 1):
            if not any(_is_same(positions, other, least) for other in known):
                found.append(pose.name)
                known.append(positions)
            for key, of_key in zip(keys, values):
                of_key.add(round(key.value, 3))
            yield begin + (1 - begin) * number / len(poses)
    if not found:
        raise MeshProblem(f"None of these poses moves '{ob.name}' to where it isn't at rest or by an example already: "
                          "pose it in other frames, or look whether the armature is in its rest position.")
    changing = [key.name for key, of_key in zip(keys, values) if len(of_key) > 1]
    return [make(ob, name, positions) for name, positions in zip(found, known[-len(found):])], changing


def _is_same(positions, other, least):
    return np.abs(positions - other).max(initial=0) <= least


def _known(ob):
    """[(n, 3)] positions of the rest, and of the examples whose shape key or object exists."""
    result = [mesh_data.rest_positions(ob.data)]
    for example in ob.detail_deform.examples:
        with contextlib.suppress(MeshProblem):
            result.append(examples.positions_of(ob, example))
    return result


def make(ob, name, positions):
    """Adds an example with these positions, and returns its shape key's name. A key of that name that already holds the
    pose is used, as after an example was removed from the list; else a new one is made."""
    keys = ob.data.shape_keys
    key = keys and keys.key_blocks.get(name)
    if not key or not _is_same(mesh_data.key_shape(ob, key), positions, _SAME * size(ob)):
        key = apply_result.add_key(ob, name, positions - mesh_data.rest_positions(ob.data))
    ob.detail_deform.examples.add().name = key.name
    posers.remember(ob)
    return key.name


def _most_different(context, ob, poses, count):
    samples = Samples(ob, len(poses) + 1)
    samples.add(mesh_data.rest_positions(ob.data))
    with contextlib.closing(pose_frames.walk(context, ob, poses)) as walk:
        for positions in walk:
            samples.add(positions)
            yield 0.8 * (samples.count - 1) / len(poses)
    chosen = samples.farthest(count, _SAME * size(ob))
    return [poses[number - 1] for number in sorted(chosen)]
