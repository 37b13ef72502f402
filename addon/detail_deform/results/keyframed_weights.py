# SPDX-License-Identifier: GPL-3.0-or-later
"""Keyframes of the example weights that fit the handles over a range of frames: for the sliders or the shape keys."""

import contextlib

import numpy as np

from ..follow import status
from ..scene import actions, examples, mesh_data, offset_attribute
from ..scene.mesh_data import MeshProblem
from . import bake, frames, pose_samples

_SAMPLES = 1000  # vertices, at most, at which frames are compared
_NOTABLE_ERROR = 0.01  # error above which the user is told, as a fraction of the mesh's size, its box's diagonal


def check(ob, of_keys=False):
    """Raises MeshProblem if the weights can't be keyed. of_keys: as values of shape keys, not of the sliders."""
    settings = ob.detail_deform
    bake.modifier_of(ob)
    if settings.method != 'EXAMPLES' or settings.weights_by != 'HANDLES' or not examples.enabled(settings):
        raise MeshProblem("Only weights that handles ask for can be baked: set Method to Examples, with examples, and "
                          "Weights by to Handles.")
    for example in examples.enabled(settings):
        if of_keys and example.object:
            raise MeshProblem(f"Example '{examples.title(example)}' is an object and has no shape key that could be "
                              "keyed: bake the sliders, or make examples of shape keys.")
        if of_keys:
            examples.positions_of(ob, example)  # raises if the key is missing
        owner, names = example, ['weight']
        if of_keys:
            owner, names = ob.data.shape_keys.key_blocks[example.name], ['value', 'mute']
        for name in names:
            if actions.is_driven(owner, name):
                raise MeshProblem(f"A driver sets the {name} of '{examples.title(example)}', which so can't be keyed: "
                                  "delete that driver first.")


def to_sliders(context, ob, start, end, tell):
    """Generator: keys the examples' sliders with the weights, and takes the weights from these from now on; yields the
    fraction done. tell: called with a sentence if the result differs from that of the handles."""
    check(ob)
    frames.check_time(context.scene)
    found, shapes = [], []
    for weights, shape in _over_frames(context, ob, start, end):
        found.append(weights)
        shapes.append(shape)
        yield len(found) / (2 * (end + 1 - start))
    chosen = examples.enabled(ob.detail_deform)
    ob.detail_deform.weights_by = 'SLIDERS'
    for example, weights in zip(chosen, zip(*found)):
        actions.insert_keyframes(example, 'weight', start, weights)
    errors = []
    for (_, shape), before in zip(_over_frames(context, ob, start, end), shapes):
        errors.append(_farthest(shape, before))
        yield 0.5 + len(errors) / (2 * (end + 1 - start))
    _warn_of_error(ob, errors, start, "weights alone hold nothing", tell)
    context.scene.frame_set(context.scene.frame_current, subframe=context.scene.frame_subframe)


def to_key_values(context, ob, start, end, tell):
    """Generator: keys the values of the examples' shape keys, whose linear mix then replaces the deformation; yields
    the fraction done. tell: as for to_sliders()."""
    check(ob, of_keys=True)
    frames.check_time(context.scene)
    keys = [_of_samples(examples.positions_of(ob, e) - mesh_data.rest_positions(ob.data))
            for e in examples.enabled(ob.detail_deform)]
    found, errors = [], []
    for weights, shape in _over_frames(context, ob, start, end):
        found.append(weights)
        errors.append(_farthest(np.tensordot(weights, keys, 1), shape))
        yield len(found) / (end + 1 - start)
    blocks = ob.data.shape_keys.key_blocks
    for example, weights in zip(examples.enabled(ob.detail_deform), zip(*found)):
        key = blocks[example.name]
        key.mute = False
        key.slider_min, key.slider_max = min(key.slider_min, *weights), max(key.slider_max, *weights)
        actions.insert_keyframes(key, 'value', start, weights)
    modifier = bake.modifier_of(ob)
    modifier.show_viewport = modifier.show_render = False
    _warn_of_error(ob, errors, start, "shape keys hold nothing and mix along straight lines", tell)
    context.scene.frame_set(context.scene.frame_current, subframe=context.scene.frame_subframe)


def _over_frames(context, ob, start, end):
    """Generator, for each frame, of the weights that fit the handles and the offsets of the sampled vertices."""
    with contextlib.closing(bake.over_frames(context, ob, start, end)) as walk:
        for _ in walk:
            yield status.example_weights(ob), _of_samples(offset_attribute.read(ob.data))


def _of_samples(values):
    return np.array(values[::-(-len(values) // _SAMPLES)], np.float32)


def _farthest(a, b):
    return float(np.linalg.norm(a - b, axis=1).max())


def _warn_of_error(ob, errors, start, why, tell):
    worst = int(np.argmax(errors))
    share = errors[worst] / pose_samples.size(ob)
    if share > _NOTABLE_ERROR:
        tell(f"In frame {start + worst} '{ob.name}' is up to {100 * share:.1f}% of its size from where its handles had "
             f"it, as {why}: keep out of the region what should stay, add an example near that frame, or bake a Mesh "
             "Cache.")
