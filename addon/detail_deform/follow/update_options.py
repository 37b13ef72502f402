# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of an update: the settings that take effect without a new bind."""

import math

from ..library import options
from ..scene import examples
from ..scene.mesh_data import MeshProblem

_KEPT_OF_SLOW = ('output', 'base_deformer', 'turns', 'handle_turns', 'pivots', 'soft_border')
_STEPS, _REFINE = (next(option for option in options.SETTINGS if option.name == name) for name in ('steps', 'refine'))


def arguments(settings):
    """{name: value} of dd_update_options."""
    found = options.arguments_of(options.UPDATE, settings)
    if settings.method == 'EXAMPLES':
        found['gradients'] = 'WHOLE'  # rotations alone could not reproduce examples that swell
        if settings.weights_by == 'SLIDERS' and settings.base == 'COMPUTED':
            found['example_weights'] = examples.weights(settings)
        else:
            found['example_limits'] = examples.limits(settings)
    return found


def why_no_base(settings):
    """Why the base surface's settings have no effect now: a sentence, or ''."""
    if settings.output != 'RESULT' or settings.method not in {'GRADIENT', 'EXAMPLES'}:
        return ""
    if settings.method == 'EXAMPLES' and settings.weights_by == 'HANDLES' and settings.refine > 0:
        return ""  # the base's functions move handles beyond what examples reach
    return "This method has no base surface."


def quick(given, share=1.0):
    """The options while handles move: a single step, and detail transfer in place of a slow method. share: the part of
    the time of such an update that is available; passes of Refine are left out accordingly."""
    if given['method'] == 'VOLUMES':
        kept = {name: given[name] for name in _KEPT_OF_SLOW if name in given}
        return {'method': 'DETAIL', 'refine': 0, **kept}
    found = {**given, 'steps': 1}
    passes = found.get('refine')
    if share < 1.0 and passes:  # a pass takes about as long as an update without passes
        # Examples need one pass: without any their handles are met by another method, which would jump.
        found['refine'] = max(int(share * (passes + 1)) - 1, int(given['method'] == 'EXAMPLES'))
    return found


def steps(settings):
    """The number of steps; 1 for Examples, and with a base object, whose motion can't be divided."""
    return options.library_value(_STEPS, settings)


def soft_border(settings):
    """The width as a fraction of the way to the handles; 0 for the output Base, and with a base object, which moves the
    border itself. Raises MeshProblem."""
    if settings.base != 'COMPUTED' or settings.output != 'RESULT':
        return 0.0
    if math.isnan(settings.soft_border):  # the file was modified by something else
        raise MeshProblem("Soft Border is not a number: set it to one from 0 to 1.")
    return settings.soft_border


def loose_parts(settings):
    """How loose parts ride along; with a base object, which carries them, they do not."""
    return settings.loose_parts if settings.base == 'COMPUTED' else 'STAY'


def knows_whole_turns(settings):
    """Whether a handle's whole turns make a difference."""
    return steps(settings) > 1 or settings.base_deformer != 'LINEAR'


def is_slow(settings):
    """Whether the result takes too long for a drag, and is computed when the handles pause."""
    return settings.output == 'RESULT' and (steps(settings) > 1 or settings.method == 'VOLUMES')


def keeps_parts_rigid(settings):
    """Whether parts with a stiffness of 1 are rigid, or by Examples as these have them."""
    if settings.method == 'TRANSFER':
        return options.library_value(_REFINE, settings) > 0
    return settings.method in {'GRADIENT', 'EXAMPLES'}
