# SPDX-License-Identifier: GPL-3.0-or-later
"""What an update is asked for beside the handles' places: the settings that need no new bind."""

from ..scene import examples


def options(settings):
    """Options of an update: what can change without a new bind. Those that don't matter to the method
    keep their default, so that changing them costs nothing."""
    look = {'method': settings.method, 'output': settings.output}
    if settings.method in {'TRANSFER', 'GRADIENT'}:
        look['gradients'] = 'ROTATIONS' if settings.rotation_only else 'WHOLE'
    if settings.method == 'TRANSFER':
        look['refine'] = 0 if why_not_refined(settings) else settings.refine
        look['formulation'] = settings.formulation
    if settings.method == 'NORMAL':
        look['levels'] = settings.levels
    if settings.method == 'EXAMPLES':
        look['gradients'] = 'WHOLE'  # examples that swell are to be met
        look['example_stiffness'] = settings.example_stiffness
        if settings.weights_by == 'SLIDERS' and settings.base == 'COMPUTED':
            look['example_weights'] = examples.weights(settings)
    if settings.method == 'VOLUMES':
        look['volume_tolerance'] = settings.volume_tolerance
        look['volume_iterations'] = settings.volume_iterations
    return look


# Why a setting has no effect now: a sentence, or ''.

def why_not_refined(settings):
    if settings.base == 'OBJECT':
        return "A base object is followed as it is: refining would go away from it."
    if not settings.rotation_only:
        return "Only rotations are refined: switch Rotation Only on."
    if settings.formulation != 'SURFACE':
        return "Only the surface formulation (Advanced) is refined."
    return ""


def why_not_smoothed(settings):
    return "" if settings.base_metric == 'SURFACE' else "Only stiffness from the surface is smoothed."


def why_not_in_steps(settings):
    if settings.method == 'EXAMPLES':
        return "Examples are not approached in steps: add examples of the larger motion."
    return "" if settings.base == 'COMPUTED' else "The motion of a base object can't be split."


def quick(asked):
    """What is shown while handles move: a slow method is replaced by detail transfer."""
    if asked['method'] == 'VOLUMES':
        return {'method': 'TRANSFER', 'refine': 0, 'output': asked['output']}
    return asked


def steps(settings):
    """How many; a base from outside has no motion that could be split."""
    return 1 if why_not_in_steps(settings) else settings.steps


def is_slow(settings):
    """Whether the result takes too long for a drag and follows when the handles pause."""
    return settings.output == 'RESULT' and (steps(settings) > 1 or settings.method == 'VOLUMES')
