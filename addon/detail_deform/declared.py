# SPDX-License-Identifier: GPL-3.0-or-later
"""Declares Blender's properties from the table of options."""

from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from .library.options import enum_numbers

_MAKERS = {bool: BoolProperty, int: IntProperty, float: FloatProperty, str: StringProperty}
USED, COMPARED = "To Deform", "For Comparison"  # headings in an enum's menu


def _items(option):
    """The items of an enum for bpy.props. A value has its number in the table, whatever its position in the menu."""
    if not option.compared:
        return option.kind
    numbers = enum_numbers(option.kind)
    usual, compared = ([(*value, 'NONE', numbers[value[0]]) for value in option.kind
                        if (value[0] in option.compared) == wanted] for wanted in (False, True))
    return [("", USED, ""), *usual, ("", COMPARED, ""), *compared]


def declare(cls, options, update_of=lambda option: None, flags_of=None):
    """Adds a property for each option to a class that is not registered yet.

    update_of: returns the property's update callback for an Option. flags_of: returns bpy.props' options for it."""
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
