# SPDX-License-Identifier: GPL-3.0-or-later
"""Registers classes together with entries in Blender's own menus."""

import bpy


def registration(classes, entries):
    """Returns (register, unregister). entries: (name of a menu, draw function); menus that this version of Blender
    lacks are skipped."""
    register_classes, unregister_classes = bpy.utils.register_classes_factory(classes)

    def present():
        return [(getattr(bpy.types, menu), draw) for menu, draw in entries if hasattr(bpy.types, menu)]

    def register():
        register_classes()
        for menu, draw in present():
            menu.append(draw)

    def unregister():
        for menu, draw in present():
            menu.remove(draw)
        unregister_classes()

    return register, unregister
