# SPDX-License-Identifier: GPL-3.0-or-later
"""Interactive choice of a region's radius: with the mouse, its wheel or a typed number, with a preview in the view."""

import bpy
import numpy as np
from mathutils import Vector

from ..library.options import FALLOFFS, FALLOFF_ORDERS
from .reach_drawing import ReachDrawing

_WHEEL, _FINE = 1.1, 0.1  # factor of the radius for a notch of the wheel; speed while Shift is held
_MIN_RADIUS = 1e-3  # least radius / first guess; safety: the wheel couldn't enlarge 0, and the shader divides by it
_KEYS = "Mouse, wheel: reach    Shift: finely    0-9: type it    Enter, click: pull    Esc, right click: cancel"
_TAB = {False: "    Tab: afterwards (Object Mode)", True: "    Tab: afterwards (Edit Mode)"}  # by ReachChoice.stay
_SHARED = ", with what the handles move that it reaches"


def length_text(units, length):
    """A length in world units, as the scene's UnitSettings have it."""
    if units.system == 'NONE':
        return f"{length:.4g}"
    return bpy.utils.units.to_string(units.system, 'LENGTH', length * units.scale_length, precision=4)


class ReachChoice:
    """Pass the window's events to handle_event() until it returns an answer, then call close()."""

    def __init__(self, context, view, ob, surface, earlier, event, stay=False, falloff='MESH'):
        """surface: a region_setup.SurfaceDistances, whose distances are computed once. earlier:
        [pulling.EarlierHandles]. stay: return to Edit Mode afterwards; Tab toggles it. falloff: one of FALLOFFS; S
        cycles through them."""
        self.stay, self.falloff, self._mesh_smoothness = stay, falloff, ob.detail_deform.smoothness
        self.surface, self._view, self._units = surface, view, context.scene.unit_settings
        self._guessed = self._mouse_radius = surface.suggested_radius()
        self._typed = ""
        positions = surface.displayed_positions(ob, context.evaluated_depsgraph_get())
        chosen = positions[surface.chosen].astype(np.float64)
        middle = chosen.mean(0)
        self._extent = float(np.linalg.norm(chosen - middle, axis=1).max())
        self._middle = Vector(middle + surface.origin)
        self._mouse, self._is_near = view.mouse(event), False
        self._sharing_distances = [surface.distances[other.held].min(initial=np.inf) for other in earlier]
        self._drawing = ReachDrawing(self, surface, positions, [other.moved for other in earlier])
        self._show(context)

    @property
    def radius(self):
        """The chosen radius, in world units."""
        return max(self._typed_length() or self._mouse_radius, _MIN_RADIUS * self._guessed)

    @property
    def sharing_indices(self):
        """Indices of the others within the radius, whose reach is shared."""
        return [number for number, distance in enumerate(self._sharing_distances) if self.radius >= distance]

    @property
    def smoothness(self):
        """The order of the base energy, 1 to 3, which determines the falloff."""
        if self.falloff == 'MESH' or self.sharing_indices:
            return self._mesh_smoothness
        return FALLOFF_ORDERS[self.falloff]

    def circle(self, region):
        """(centre, radius) of the circle in pixels of a region; None if it isn't drawn there."""
        if region != self._view.region:
            return None
        middle, unit = self._view.on_screen(self._middle), self._view.unit(self._middle)
        return middle and (middle, (self._extent + self.radius) / unit)

    def handle_event(self, context, event):
        """Handles an event. Returns 'CONFIRM', 'CANCEL', or None to go on."""
        if event.type in {'ESC', 'RIGHTMOUSE'} and event.value == 'PRESS':
            return 'CANCEL'
        if event.type in {'RET', 'NUMPAD_ENTER'} and event.value == 'PRESS':
            return 'CONFIRM'
        if event.type == 'LEFTMOUSE' and event.value == 'RELEASE':  # so that a drag works, too
            return 'CONFIRM'
        if event.type in {'MOUSEMOVE', 'INBETWEEN_MOUSEMOVE'}:
            self._move(event)
        elif event.type in {'WHEELUPMOUSE', 'WHEELDOWNMOUSE'} and event.value == 'PRESS':
            step = _WHEEL ** (_FINE if event.shift else 1)
            self._mouse_radius = self.radius * (step if event.type == 'WHEELUPMOUSE' else 1 / step)
            self._typed = ""
        elif event.type == 'S' and event.value == 'PRESS' and not self.sharing_indices:
            self.falloff = FALLOFFS[self.smoothness % (len(FALLOFFS) - 1) + 1][0]
        elif event.type == 'TAB' and event.value == 'PRESS':
            self.stay = not self.stay
        elif event.value == 'PRESS':
            self._type(event)
        self._show(context)
        return None

    def close(self, context):
        """Removes the preview. May be called twice."""
        self._drawing.close()
        self._view.area.header_text_set(None)
        self._view.area.tag_redraw()
        context.workspace.status_text_set(None)

    def _move(self, event):
        """Changes the radius as the mouse's distance from the centre changes. It decreases only once the mouse has been
        within the circle: before, the mouse is on its way back from the menu or the panel that was clicked."""
        before, self._mouse = self._mouse, self._view.mouse(event)
        middle, unit = self._view.on_screen(self._middle), self._view.unit(self._middle)
        if self._typed or middle is None:
            return
        away = (self._mouse - middle).length - (before - middle).length
        self._is_near |= (self._mouse - middle).length <= (self._extent + self.radius) / unit
        if away < 0 and not self._is_near:
            return
        self._mouse_radius = max(self._mouse_radius + unit * away * (_FINE if event.shift else 1),
                                 _MIN_RADIUS * self._guessed)

    def _type(self, event):
        if event.type == 'BACK_SPACE':
            self._typed = self._typed[:-1]
        elif event.ascii and event.ascii in '0123456789.,':
            self._typed += event.ascii.replace(',', '.')

    def _typed_length(self):
        """The typed length in world units; 0 if none, or no valid one, was typed."""
        units = self._units
        try:
            if units.system == 'NONE':
                return float(self._typed or 0)
            unit = None if units.length_unit == 'ADAPTIVE' else units.length_unit.lower()
            return bpy.utils.units.to_value(units.system, 'LENGTH', self._typed or '0',
                                            str_ref_unit=unit) / units.scale_length
        except ValueError:
            return 0.0

    def _show(self, context):
        length = length_text(self._units, self.radius)
        shape = "" if self.sharing_indices else f"    S: falloff ({FALLOFFS[self.smoothness][1].lower()})"
        keys = _KEYS + shape + _TAB[self.stay]
        self._view.area.header_text_set(f"Reach: {f'[{self._typed}|] = ' if self._typed else ''}{length}"
                                        f"{_SHARED * bool(self.sharing_indices)}    {keys}")
        context.workspace.status_text_set(keys)
        self._view.area.tag_redraw()
