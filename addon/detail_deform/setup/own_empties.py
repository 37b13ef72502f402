# SPDX-License-Identifier: GPL-3.0-or-later
"""Gives a copied mesh empties of its own in place of those that it shares with the original."""

from ..follow import hints
from . import empties


def make(context, ob):
    """Replaces the shared empties by copies. A copy has the transform relative to this object that the original empty
    has relative to the other object; parents, constraints and drivers lead to the copies."""
    settings = ob.detail_deform
    settings.handle_collection = None  # still the other object's
    other = hints.shares_empties_with(ob)
    while other:
        shared = {handle.target for handle in other.detail_deform.handles}
        copies = {empty: _copy(context, ob, empty)
                  for empty in {handle.target for handle in settings.handles if handle.target} & shared
                  if empty.type != 'ARMATURE'}  # a rig is shared by all that it moves
        replacements = {other: ob, **copies}
        for empty, copy in copies.items():
            place = ob.matrix_world @ other.matrix_world.inverted_safe() @ empty.matrix_world
            if empty.parent not in replacements:  # else the animated local transform is kept
                empties.place(copy, place, empty.rotation_euler[:])
            _redirect_references(copy, replacements)
        for handle in settings.handles:
            if handle.target in copies:
                handle.target = handle.own_target = copies[handle.target]
        context.view_layer.update()
        other = hints.shares_empties_with(ob)


def _copy(context, ob, empty):
    copy = empty.copy()
    if copy.data:
        copy.data = copy.data.copy()
    empties.collection_of(context, ob).objects.link(copy)
    for owner in filter(None, (copy, copy.data, getattr(copy.data, 'shape_keys', None))):
        _copy_action(owner.animation_data)
    return copy


def _copy_action(animation):
    if animation and animation.action:
        slot = getattr(animation, 'action_slot', None)  # from Blender 4.4 on
        identifier = slot and slot.identifier
        animation.action = animation.action.copy()
        if identifier and animation.action_slot is None:
            animation.action_slot = animation.action.slots[identifier]


def _redirect_references(copy, replacements):
    """Redirects the copy's parent, hooks, constraints and drivers. replacements: {original: replacement}."""
    if copy.parent in replacements:
        copy.parent = replacements[copy.parent]
    for modifier in copy.modifiers:
        if getattr(modifier, 'object', None) in replacements:  # a hook
            modifier.object = replacements[modifier.object]
    for constraint in copy.constraints:
        for user in (constraint, *getattr(constraint, 'targets', ())):
            if getattr(user, 'target', None) in replacements:
                user.target = replacements[user.target]
    for curve in copy.animation_data.drivers if copy.animation_data else ():
        for variable in curve.driver.variables:
            for target in variable.targets:
                if target.id in replacements:
                    target.id = replacements[target.id]
