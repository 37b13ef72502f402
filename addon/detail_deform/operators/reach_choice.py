# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a region reaches, chosen by eye: with the mouse, its wheel or a number, while the view shows it."""

from typing import NamedTuple

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d, region_2d_to_location_3d
from mathutils import Vector

from ..library.options import FALLOFF_ORDERS, FALLOFFS
from .reach_drawing import ReachDrawing

_WHEEL, _FINE = 1.1, 0.1
_LEAST = 1e-3  # of the first guess
_KEYS = "Mouse, wheel: reach    Shift: finely    0-9: type it    Enter, click: pull    Esc, right click: cancel"
_TAB = {False: "    Tab: afterwards (Object Mode)", True: "    Tab: afterwards (Edit Mode)"}  # whether it stays there
_SHARED = ", with what the handles move that it reaches"


class View(NamedTuple):
    """A 3D view of the window."""
    area: bpy.types.Area
    region: bpy.types.Region


class ReachChoice:
    """While it goes on, hear() takes the window's events."""

    def __init__(self, context, view, ob, around, others, event, stay=False, falloff='MESH'):
        """around: a region_setup.Around, whose distances are computed once. others: [pulling.Other]. stay: in Edit Mode
        afterwards; Tab changes it. falloff: of FALLOFFS; S changes it."""
        self.stay, self.falloff, self._of_mesh = stay, falloff, ob.detail_deform.smoothness
        self.around, self._view, self._units = around, view, context.scene.unit_settings
        self._guessed = self._moved = around.first_guess()
        self._typed = ""
        places = around.as_seen(ob, context.evaluated_depsgraph_get())
        chosen = places[around.chosen].astype(np.float64)
        middle = chosen.mean(0)
        self._extent = float(np.linalg.norm(chosen - middle, axis=1).max())
        self._middle = Vector(middle + around.origin)
        self._mouse, self._is_near = self._place_of(event), False
        self._shared_from = [around.distances[other.held].min(initial=np.inf) for other in others]
        self._drawing = ReachDrawing(self, around, places, [other.moves for other in others])
        self._show(context)

    @property
    def radius(self):
        """In the world's unit."""
        return max(self._typed_length() or self._moved, _LEAST * self._guessed)

    @property
    def shared(self):
        """Numbers of the others that are reached: what they move moves, too."""
        return [number for number, distance in enumerate(self._shared_from) if self.radius >= distance]

    @property
    def smoothness(self):
        """The order of the energy by which it falls off."""
        if self.falloff == 'MESH' or self.shared:
            return self._of_mesh
        return FALLOFF_ORDERS[self.falloff]

    def circle(self, region):
        """Where the drawing's circle is in a region, (middle, radius) in pixels; None where it is not shown."""
        if region != self._view.region:
            return None
        middle, unit = self._on_screen()
        return middle and (middle, (self._extent + self.radius) / unit)

    def hear(self, context, event):
        """'CONFIRM', 'CANCEL', or None while it goes on."""
        if event.type in {'ESC', 'RIGHTMOUSE'} and event.value == 'PRESS':
            return 'CANCEL'
        if event.type in {'RET', 'NUMPAD_ENTER'} and event.value == 'PRESS':
            return 'CONFIRM'
        if event.type == 'LEFTMOUSE' and event.value == 'RELEASE':  # so that it may be dragged, too
            return 'CONFIRM'
        if event.type in {'MOUSEMOVE', 'INBETWEEN_MOUSEMOVE'}:
            self._move(event)
        elif event.type in {'WHEELUPMOUSE', 'WHEELDOWNMOUSE'} and event.value == 'PRESS':
            step = _WHEEL ** (_FINE if event.shift else 1)
            self._moved = self.radius * (step if event.type == 'WHEELUPMOUSE' else 1 / step)
            self._typed = ""
        elif event.type == 'S' and event.value == 'PRESS' and not self.shared:
            self.falloff = FALLOFFS[self.smoothness % (len(FALLOFFS) - 1) + 1][0]
        elif event.type == 'TAB' and event.value == 'PRESS':
            self.stay = not self.stay
        elif event.value == 'PRESS':
            self._type(event)
        self._show(context)
        return None

    def close(self, context):
        """May be called twice."""
        self._drawing.close()
        self._view.area.header_text_set(None)
        self._view.area.tag_redraw()
        context.workspace.status_text_set(None)

    def _place_of(self, event):
        return Vector((event.mouse_x - self._view.region.x, event.mouse_y - self._view.region.y))

    def _on_screen(self):
        """The middle of what was chosen, and what a pixel is there in the world's unit."""
        region, view = self._view.region, self._view.region.data
        middle = location_3d_to_region_2d(region, view, self._middle)
        if middle is None:  # behind the eye
            return None, 1.0
        ends = [region_2d_to_location_3d(region, view, middle + Vector((x, 0)), self._middle) for x in (0, 100)]
        return middle, max((ends[1] - ends[0]).length / 100, 1e-30)

    def _move(self, event):
        """As much as the mouse goes away from the middle, so does the circle; as it comes nearer, too, once it has been
        within the circle: before, it is on its way back from the menu or the panel that was clicked."""
        before, self._mouse = self._mouse, self._place_of(event)
        middle, unit = self._on_screen()
        if self._typed or middle is None:
            return
        away = (self._mouse - middle).length - (before - middle).length
        self._is_near |= (self._mouse - middle).length <= (self._extent + self.radius) / unit
        if away < 0 and not self._is_near:
            return
        self._moved = max(self._moved + unit * away * (_FINE if event.shift else 1), _LEAST * self._guessed)

    def _type(self, event):
        if event.type == 'BACK_SPACE':
            self._typed = self._typed[:-1]
        elif event.ascii and event.ascii in '0123456789.,':
            self._typed += event.ascii.replace(',', '.')

    def _typed_length(self):
        """0 where nothing that makes sense was typed."""
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
        length = (f"{self.radius:.4g}" if self._units.system == 'NONE' else bpy.utils.units.to_string(
            self._units.system, 'LENGTH', self.radius * self._units.scale_length, precision=4))
        shape = "" if self.shared else f"    S: falloff ({FALLOFFS[self.smoothness][1].lower()})"
        keys = _KEYS + shape + _TAB[self.stay]
        self._view.area.header_text_set(f"Reach: {f'[{self._typed}|] = ' if self._typed else ''}{length}"
                                        f"{_SHARED * bool(self.shared)}    {keys}")
        context.workspace.status_text_set(keys)
        self._view.area.tag_redraw()
