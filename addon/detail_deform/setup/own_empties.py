# SPDX-License-Identifier: GPL-3.0-or-later
"""A copy of a mesh gets empties of its own in place of those of the first."""

from ..follow import hints
from . import empties


def make(context, ob):
    """Each stands to this object, and to the other copies, as the other's stands to the other."""
    settings = ob.detail_deform
    settings.handle_collection = None  # that of the other one
    other = hints.shares_empties_with(ob)
    while other:
        shared = {handle.target for handle in other.detail_deform.handles}
        copies = {empty: _copy(context, ob, empty)
                  for empty in {handle.target for handle in settings.handles if handle.target} & shared}
        instead = {other: ob, **copies}
        for empty, copy in copies.items():
            place = ob.matrix_world @ other.matrix_world.inverted_safe() @ empty.matrix_world
            if empty.parent not in instead:  # else the rest is as it was, so that its animation goes on
                copy.matrix_world = place
            _lead_to(copy, instead)
        for handle in settings.handles:
            if handle.target in copies:
                handle.target = handle.own_target = copies[handle.target]
        context.view_layer.update()
        other = hints.shares_empties_with(ob)


def _copy(context, ob, empty):
    copy = empty.copy()
    empties.collection_of(context, ob).objects.link(copy)
    animation = copy.animation_data
    if animation and animation.action:
        slot = getattr(animation, 'action_slot', None)  # Blender 4.4
        identifier = slot and slot.identifier
        animation.action = animation.action.copy()
        if identifier and animation.action_slot is None:
            animation.action_slot = animation.action.slots[identifier]
    return copy


def _lead_to(copy, instead):
    """What it hangs on: a parent, constraints, drivers."""
    if copy.parent in instead:
        copy.parent = instead[copy.parent]
    for constraint in copy.constraints:
        for user in (constraint, *getattr(constraint, 'targets', ())):
            if getattr(user, 'target', None) in instead:
                user.target = instead[user.target]
    for curve in copy.animation_data.drivers if copy.animation_data else ():
        for variable in curve.driver.variables:
            for target in variable.targets:
                if target.id in instead:
                    target.id = instead[target.id]
