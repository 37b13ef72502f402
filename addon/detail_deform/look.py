# SPDX-License-Identifier: GPL-3.0-or-later
"""What an update is asked for beside the handles' places: the settings that need no new bind."""


def options(settings):
    """Options of an update: what can change without a new bind. Those that don't matter to the method
    keep their default, so that changing them costs nothing."""
    look = {'method': settings.method, 'shown': settings.output}
    if settings.method in {'TRANSFER', 'GRADIENT'}:
        look['rotation_only'] = settings.rotation_only
    if settings.method == 'TRANSFER':
        # Refining goes away from the base, which is right where it was made by hand.
        refined = settings.rotation_only and settings.base == 'COMPUTED'
        look['refine'] = settings.refine if refined else 0
        look['formulation'] = settings.formulation
    if settings.method == 'NORMAL':
        look['levels'] = settings.levels
    if settings.method == 'VOLUMES':
        look['volume_tolerance'] = settings.volume_tolerance
        look['volume_iterations'] = settings.volume_iterations
    return look


def quick(asked):
    """What is shown while handles move: a slow method is replaced by detail transfer."""
    if asked['method'] == 'VOLUMES':
        return {'method': 'TRANSFER', 'refine': 0, 'shown': asked['shown']}
    return asked


def steps(settings):
    """How many; a base from outside has no motion that could be split."""
    return settings.steps if settings.base == 'COMPUTED' else 1


def is_slow(settings):
    """Whether the result takes too long for a drag and follows when the handles pause."""
    return settings.output == 'RESULT' and (steps(settings) > 1 or settings.method == 'VOLUMES')
