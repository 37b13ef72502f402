# SPDX-License-Identifier: GPL-3.0-or-later
"""A 3D view of the window, in which an operator follows the mouse."""

from typing import NamedTuple

import bpy
from bpy_extras.view3d_utils import (location_3d_to_region_2d, region_2d_to_location_3d, region_2d_to_origin_3d,
                                     region_2d_to_vector_3d)
from mathutils import Vector

# Pixels between the two points that measure the unit: enough that single precision tells them apart.
_SPAN = 100


class View(NamedTuple):
    """Places in it are in pixels of its region, others are world places."""
    area: bpy.types.Area
    region: bpy.types.Region

    def mouse(self, event):
        return Vector((event.mouse_x - self.region.x, event.mouse_y - self.region.y))

    def on_screen(self, point):
        """Where it is seen; None behind the eye."""
        return location_3d_to_region_2d(self.region, self.region.data, point)

    def at_depth(self, place, point):
        """The point that is seen at this place and as far away as another point."""
        return region_2d_to_location_3d(self.region, self.region.data, place, point)

    def unit(self, point):
        """World units per pixel at the depth of a point; 1 behind the eye."""
        middle = self.on_screen(point)
        if middle is None:
            return 1.0
        ends = [self.at_depth(middle + Vector((x, 0)), point) for x in (0, _SPAN)]
        return max((ends[1] - ends[0]).length / _SPAN, 1e-30)

    def ray(self, place):
        """(origin, direction, whether it is a line) of what is seen at this place. In orthographic views the origin may
        be inside of objects, so that a line is meant."""
        data = self.region.data
        return (region_2d_to_origin_3d(self.region, data, place), region_2d_to_vector_3d(self.region, data, place),
                not data.is_perspective)


def chosen(context):
    """The View from which an operator was called, or the window's largest; None without any."""
    areas = [area for area in context.window.screen.areas if area.type == 'VIEW_3D']
    if not areas:
        return None
    area = context.area if context.area in areas else max(areas, key=lambda area: area.width * area.height)
    if context.area == area and context.region.type == 'WINDOW':
        return View(area, context.region)
    return View(area, next(region for region in area.regions if region.type == 'WINDOW'))
