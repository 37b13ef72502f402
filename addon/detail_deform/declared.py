# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's properties from the table of options."""

from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from .library.options import numbers_of

_MAKERS = {bool: BoolProperty, int: IntProperty, float: FloatProperty, str: StringProperty}
USED, COMPARED = "To Deform", "For Comparison"  # headings in a menu


def _items(option):
    """Of an enum. Numbers are those of the table, wherever a value stands in the menu."""
    if not option.compared:
        return option.kind
    numbers = numbers_of(option.kind)
    usual, compared = ([(*value, 'NONE', numbers[value[0]]) for value in option.kind
                        if (value[0] in option.compared) == wanted] for wanted in (False, True))
    return [("", USED, ""), *usual, ("", COMPARED, ""), *compared]


def declare(cls, options, update_of=lambda option: None, flags_of=None):
    """Adds a property for each option to a class that is not registered yet.

    update_of, flags_of: the function that hears of changes, and bpy.props' options, for an Option."""
    for option in options:
        make, more = _MAKERS.get(option.kind, EnumProperty), dict(option.limits)
        if make is EnumProperty:
            more['items'] = _items(option)
        if option.default is not None:
            more['default'] = option.default
        if flags_of:
            more['options'] = flags_of(option)
        cls.__annotations__[option.name] = make(
            name=option.title, description=option.tooltip, update=update_of(option), **more)
