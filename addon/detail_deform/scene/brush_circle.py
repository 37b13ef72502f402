# SPDX-License-Identifier: GPL-3.0-or-later
"""The circle of Sculpt Mode's tool Pull: at the mouse, or while it pulls around what is pulled."""

import bpy

from .. import session
from . import brush_size, shaders, view

# Until 4.2 Blender draws its brush's circle with any tool of Sculpt Mode.
_BLENDER_DRAWS_IT = bpy.app.version < (4, 3)
# While something is pulled: the view.View, the place of what is pulled, and the radius of its reach, in world units.
_pulled = session.Values(session.Until.DISABLED, view=None, point=None, radius=0.0)


def show(seen_in, point, radius):
    _pulled.view, _pulled.point, _pulled.radius = seen_in, point, radius
    seen_in.area.tag_redraw()


def end():
    _pulled.clear()


def draw(context, place):
    """Draws as a tool's cursor. place: of the mouse, in pixels of the window."""
    if _pulled.view is None:
        if not _BLENDER_DRAWS_IT:
            seen_in = view.chosen(context)
            unit = seen_in.unit(seen_in.region.data.view_location)
            shaders.draw_circle(place, brush_size.radius(context, unit) / unit)
        return
    centre = _pulled.view.on_screen(_pulled.point)
    if centre is not None:
        shaders.draw_circle((centre.x + _pulled.view.region.x, centre.y + _pulled.view.region.y),
                            _pulled.radius / _pulled.view.unit(_pulled.point))
