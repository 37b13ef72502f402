# SPDX-License-Identifier: GPL-3.0-or-later
"""The markers of a source and of its targets as numbered dots in the viewport."""

import bpy

from . import marker_cache
from .preview import Drawing

_BOTH_COLOUR, _ONE_COLOUR = (1.0, 0.85, 0.1, 1.0), (1.0, 0.25, 0.2, 1.0)
_DOUBT_COLOUR = (1.0, 0.35, 0.9, 1.0)
_TEXT_SIZE = 14  # pixels, at an interface scale of 1


def pairs(ob):
    """[(source, target)]: the transfers whose markers are shown while this mesh, as source or target, is active."""
    targets = marker_cache.followers(ob)
    if ob.detail_deform.transfer.source or not targets:
        targets.insert(0, ob)
    found = [(target.detail_deform.transfer.source, target) for target in targets]
    return [(source, target) for source, target in found
            if target.detail_deform.transfer.show_markers and not target.detail_deform.transfer.live]


def labels(ob, depsgraph):
    """[(number, world place, colour)] of the markers of this mesh and of its source or targets."""
    shown = {}
    for source, target in pairs(ob):
        sides = [side for side in (target, source) if side is not None and side.type == 'MESH']
        both = set.intersection(*(set(marker_cache.markers_of(side)) for side in sides))
        doubts = marker_cache.doubts(source, target) if len(sides) == 2 else ()
        for side in sides:
            points = _displayed_points(side, depsgraph)
            for number, vertex in marker_cache.markers_of(side).items():
                if vertex < len(points):
                    colour = _DOUBT_COLOUR if number in doubts else _BOTH_COLOUR if number in both else _ONE_COLOUR
                    shown[side, number] = (number, side.matrix_world @ points[vertex].co, colour)
    return list(shown.values())


def _displayed_points(ob, depsgraph):
    """The evaluated vertices, or the mesh's own if modifiers change their number."""
    seen = ob.evaluated_get(depsgraph).data
    return seen.vertices if len(seen.vertices) == len(ob.data.vertices) else ob.data.vertices


def _draw():
    context = bpy.context
    ob = context.active_object
    if ob is None or ob.type != 'MESH' or context.screen.is_animation_playing:
        return
    depsgraph = context.view_layer.depsgraph  # as it is: evaluating waits for a render that waits for us
    found = labels(ob, depsgraph)
    if not found:
        return
    import blf
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    size = int(_TEXT_SIZE * context.preferences.system.ui_scale)
    blf.size(0, size)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0, 0, 0, 1)
    solid = _solid(context, ob)
    for number, point, colour in found:
        at = location_3d_to_region_2d(context.region, context.region_data, point)
        if at is None or marker_cache.is_hidden(point, _eye(context.region_data, point), solid, depsgraph):
            continue
        blf.color(0, *colour)
        blf.position(0, at.x - size / 6, at.y - size / 3, 0)
        blf.draw(0, f"\u2022 {number}")
    blf.disable(0, blf.SHADOW)


def _solid(context, ob):
    """The meshes with markers that are drawn opaque and may occlude them."""
    shading = context.space_data.shading
    if shading.type == 'WIREFRAME' or shading.show_xray and shading.type == 'SOLID':
        return ()
    return {side for pair in pairs(ob) for side in pair if side is not None and side.visible_get()}


def _eye(view, point):
    """The eye of a RegionView3D; in an orthographic view a point at twice the view distance from the point."""
    back = view.view_matrix.inverted()
    return back.translation if view.is_perspective else point + 2 * view.view_distance * back.col[2].xyz


_drawing = Drawing(_draw, 'POST_PIXEL')
register, unregister = _drawing.register, _drawing.unregister
