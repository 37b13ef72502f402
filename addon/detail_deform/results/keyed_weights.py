# SPDX-License-Identifier: GPL-3.0-or-later
"""The weights that handles ask for over a range of frames, keyed: of the examples' sliders, or of their shape keys."""

import contextlib

from ..follow import status
from ..scene import actions, examples
from ..scene.mesh_data import MeshProblem
from . import bake


def check(ob, of_keys=False):
    """of_keys: the keys' values are to be keyed, not the sliders. Raises MeshProblem."""
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
            examples.positions_of(ob, example)  # the key is there
        owner, names = example, ['weight']
        if of_keys:
            owner, names = ob.data.shape_keys.key_blocks[example.name], ['value', 'mute']
        for name in names:
            if actions.is_driven(owner, name):
                raise MeshProblem(f"A driver sets the {name} of '{examples.title(example)}', which so can't be keyed: "
                                  "delete that driver first.")


def to_sliders(context, ob, start, end):
    """Generator: keys the examples' sliders and has these say the weights; yields the fraction done."""
    check(ob)
    found = yield from _found(context, ob, start, end)
    chosen = examples.enabled(ob.detail_deform)
    ob.detail_deform.weights_by = 'SLIDERS'
    for example, weights in zip(chosen, zip(*found)):
        actions.key(example, 'weight', start, weights)
    context.scene.frame_set(context.scene.frame_current, subframe=context.scene.frame_subframe)


def to_key_values(context, ob, start, end):
    """Generator: keys the values of the examples' shape keys, which then show the mix in place of the deformation, as
    far as a mix of keys can; yields the fraction done."""
    check(ob, of_keys=True)
    found = yield from _found(context, ob, start, end)
    blocks = ob.data.shape_keys.key_blocks
    for example, weights in zip(examples.enabled(ob.detail_deform), zip(*found)):
        key = blocks[example.name]
        key.mute = False
        key.slider_min, key.slider_max = min(key.slider_min, *weights), max(key.slider_max, *weights)
        actions.key(key, 'value', start, weights)
    modifier = bake.modifier_of(ob)
    modifier.show_viewport = modifier.show_render = False
    context.scene.frame_set(context.scene.frame_current, subframe=context.scene.frame_subframe)


def _found(context, ob, start, end):
    found = []
    with contextlib.closing(bake.over_frames(context, ob, start, end)) as walk:
        for _ in walk:
            found.append(status.example_weights(ob))
            yield len(found) / (end + 1 - start)
    return found
