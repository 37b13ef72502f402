# SPDX-License-Identifier: GPL-3.0-or-later
"""The circle of Sculpt Mode's tool Pull: at the mouse, or while it pulls around what is pulled."""

from .. import session
from ..scene import brush_size
from . import view
from .reach_drawing import draw_circle

# While something is pulled: the view.View, the place of what is pulled, and the radius of its reach, in world units.
_pulled = session.Values(session.Until.DISABLED, view=None, point=None, radius=0.0)


def show(seen_in, point, radius):
    _pulled.view, _pulled.point, _pulled.radius = seen_in, point, radius
    seen_in.area.tag_redraw()


def end():
    _pulled.clear()


def draw(context, place):
    """Draws as a tool's cursor. place: of the mouse, in pixels of the window."""
    seen_in = view.chosen(context)
    if _pulled.view is None:
        middle = seen_in.region.data.view_location
        draw_circle(place, brush_size.radius(context, seen_in.unit(middle)) / seen_in.unit(middle))
        return
    centre = _pulled.view.on_screen(_pulled.point)
    if centre is not None:
        draw_circle((centre.x + _pulled.view.region.x, centre.y + _pulled.view.region.y),
                    _pulled.radius / _pulled.view.unit(_pulled.point))
