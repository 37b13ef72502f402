# SPDX-License-Identifier: GPL-3.0-or-later
"""The size of Sculpt Mode's brush, which is kept in other places and counted otherwise from one version to the next."""

import bpy

# From 5.0 on sizes are diameters, before they are radii.
_RADII_A_SIZE = 0.5 if bpy.app.version >= (5, 0) else 1.0
_UNPROJECTED = 'unprojected_size' if bpy.app.version >= (5, 0) else 'unprojected_radius'


def size_property(context):
    """(owner, name) of the property that holds the size: that of all brushes, or of the active one."""
    settings = context.tool_settings
    brush = settings.sculpt.brush
    shared = (settings.sculpt if bpy.app.version >= (5, 0) else settings).unified_paint_settings
    owner = shared if shared.use_unified_size or brush is None else brush
    return owner, _UNPROJECTED if owner.use_locked_size == 'SCENE' else 'size'


def radius(context, unit):
    """In world units. unit: world units per pixel where the brush is."""
    owner, name = size_property(context)
    return _RADII_A_SIZE * getattr(owner, name) * (unit if name == 'size' else 1.0)
