# SPDX-License-Identifier: GPL-3.0-or-later
"""What an update is asked for beside the handles' places: the settings that need no new bind."""

from ..library import options
from ..scene import examples

_KEPT_OF_SLOW = ('output', 'base_deformer', 'turns', 'handle_turns', 'pivots', 'soft_border')
_STEPS = next(option for option in options.SETTINGS if option.name == 'steps')


def asked(settings):
    """Options of an update: what can change without a new bind."""
    found = options.asked(options.UPDATE, settings)
    if settings.method == 'EXAMPLES':
        found['gradients'] = 'WHOLE'  # examples that swell are to be met
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
        return ""  # by its functions the surface goes beyond the examples
    return "This method has no base surface."


def quick(told, share=1.0):
    """What is shown while handles move: one step, and detail transfer in place of a slow method. share: of the time
    that this takes, how much there is; passes of Refine are left out for it."""
    if told['method'] == 'VOLUMES':
        kept = {name: told[name] for name in _KEPT_OF_SLOW if name in told}
        return {'method': 'TRANSFER', 'refine': 0, **kept}
    found = {**told, 'steps': 1}
    passes = found.get('refine')
    if share < 1.0 and passes:  # each takes about as long as an update without any
        # By examples one is the least: without any the surface meets the handles in another way.
        found['refine'] = max(int(share * (passes + 1)) - 1, int(told['method'] == 'EXAMPLES'))
    return found


def steps(settings):
    """How many; a base from outside has no motion that could be split."""
    return options.value(_STEPS, settings)


def soft_border(settings):
    """0: none; a base from outside says itself what moves at the border."""
    return settings.soft_border if settings.base == 'COMPUTED' and settings.output == 'RESULT' else 0.0


def knows_whole_turns(settings):
    """Whether a handle's whole turns make a difference."""
    return steps(settings) > 1 or settings.base_deformer != 'LINEAR'


def is_slow(settings):
    """Whether the result takes too long for a drag and follows when the handles pause."""
    return settings.output == 'RESULT' and (steps(settings) > 1 or settings.method == 'VOLUMES')
