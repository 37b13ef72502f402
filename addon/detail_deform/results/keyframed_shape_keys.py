# SPDX-License-Identifier: GPL-3.0-or-later
"""A range of frames as shape keys, with keyframes that play them."""

import contextlib

from ..scene import apply_result
from ..scene.mesh_data import MeshProblem

_NAME = "Detail Deform {}"


def check(ob):
    """Raises MeshProblem if keyed shape keys can't be added."""
    present = ob.data.shape_keys
    if present and not present.use_relative:
        raise MeshProblem("The mesh has absolute shape keys, which can't be added to: make them relative first.")
    if present and any(key.name.startswith(_NAME.format("")) for key in present.key_blocks):
        raise MeshProblem("There are baked shape keys already, and the new ones would add to them: remove those first.")


def add(ob, offsets, start, end):
    """Generator: adds a shape key for each frame from start to end, once all offsets are computed; yields the fraction
    done and returns the keys' names. offsets: a generator of (n, 3), one for each frame."""
    found, names = [], []
    with contextlib.closing(offsets):
        for of_frame in offsets:
            found.append(of_frame)
            yield len(found) / (end + 1 - start)
    for frame, of_frame in enumerate(found, start):
        key = apply_result.add_key(ob, _NAME.format(frame), of_frame)
        names.append(key.name)
        for at, value in ((frame - 1, 0.0), (frame, 1.0), (frame + 1, 0.0)):
            if start <= at <= end:
                key.value = value
                key.keyframe_insert('value', frame=at)
    return names
