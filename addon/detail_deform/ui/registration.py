# SPDX-License-Identifier: GPL-3.0-or-later
"""Classes, and entries in Blender's own menus, that come and go together."""

import bpy


def registration(classes, entries):
    """(register, unregister). entries: (a menu's name, what draws the entry); menus that this Blender doesn't have are
    left out."""
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
