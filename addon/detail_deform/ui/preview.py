# SPDX-License-Identifier: GPL-3.0-or-later
"""The region's and the handles' vertices as coloured points in the viewport."""

import colorsys

import bpy
import numpy as np

from .. import session
from ..results import missing_examples
from ..scene import mesh_data, saved_match, shaders
from ..scene.subject import enabled_handles

_POINT_SIZE = 4.0  # pixels
_NEARER = 0.004  # of the distance to the eye, by which points are offset so that the surface doesn't hide them
_REGION_COLOUR = (0.3, 0.8, 0.75, 0.8)
_OTHER_COLOUR = (0.5, 0.5, 0.5, 0.35)
_BAD_COLOUR, _GOOD_COLOUR = (0.9, 0.1, 0.1, 0.9), (0.2, 0.8, 0.2, 0.9)
_colours = session.kept({}, session.Until.REPLACED)  # {object's name: (key of the content, (n, 4) colours or None)}
# names: of the objects with a preview; None: to be collected, which is slow in large scenes. object_count: when they
# were collected.
_with_preview = session.Values(session.Until.REPLACED, names=None, object_count=0)


class Drawing:
    """A draw function for every 3D view; it is called between register() and unregister()."""

    def __init__(self, draw, kind):
        self._draw, self._kind, self._handle = draw, kind, None

    def register(self):
        if not bpy.app.background:  # without a window there is nothing to draw on
            self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), 'WINDOW', self._kind)

    def unregister(self):
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, 'WINDOW')
            self._handle = None


def handle_colour(number):
    """RGBA. Hues step by the golden ratio, so that those of any number of handles are far apart."""
    return (*colorsys.hsv_to_rgb((0.08 + 0.618 * number) % 1.0, 0.9, 1.0), 1.0)


def vertex_colours(ob):
    """(n, 4) float32 RGBA by the confidence of the match with a source, by the errors of examples for a pose, or by
    region and handle, from weights alone, so that they show before a Bind. None if only unknown errors are to show."""
    settings = ob.detail_deform
    match = saved_match.vertex_confidence(ob) if settings.transfer.show_match else None
    errors = missing_examples.errors_of(ob) if settings.show_error else None
    if match is None and errors is not None:
        match = 1 - errors / max(errors.max(), 1e-30)
    if match is not None:
        bad, good = np.float32([_BAD_COLOUR, _GOOD_COLOUR])
        return bad + match[:, None] * (good - bad)
    if not (settings.preview or settings.transfer.show_match):
        return None  # only the errors are to show
    handles = [h for h in enabled_handles(settings) if h.vertex_group in ob.vertex_groups]
    region = settings.region if settings.region in ob.vertex_groups else ""
    winner, inside, _ = mesh_data.handles_of_vertices(ob, region, [h.vertex_group for h in handles])
    reaches = {h.reach for h in handles if h.reach in ob.vertex_groups}
    if reaches:
        goes_by_region = settings.base != 'COMPUTED' or any(not h.reach for h in handles)
        inside = (inside & goes_by_region) | mesh_data.members(ob, *reaches)
    colours = np.empty((len(ob.data.vertices), 4), np.float32)
    colours[:] = _REGION_COLOUR
    colours[~inside] = _OTHER_COLOUR
    in_handle = winner >= 0
    if in_handle.any():
        of_handles = np.float32([handle_colour(number) for number in range(len(handles))])
        colours[in_handle] = of_handles[winner[in_handle]]
    return colours


def _is_wanted(ob):
    settings = ob.detail_deform
    return settings.preview or settings.transfer.show_match or settings.show_error


def is_in_use():
    """Whether anything is cached."""
    return bool(_colours)


def forget(edited=None):
    """Drops the cached colours of these edited meshes. Without an argument drops all, and the list of objects with a
    preview."""
    if edited is None:
        _with_preview.clear()
    for name in list(_colours):
        ob = bpy.data.objects.get(name)
        if edited is None or ob is None or ob.data in edited:
            del _colours[name]


def _points(ob, depsgraph):
    """(world positions, colours), or None if there is nothing to show or if modifiers change the number of vertices."""
    mesh = ob.evaluated_get(depsgraph).data
    if len(mesh.vertices) != len(ob.data.vertices):
        return None
    settings = ob.detail_deform
    made_of = (settings.region, settings.preview, settings.transfer.show_match, saved_match.digest(ob),
               len(ob.data.vertices), settings.show_error, settings.missing_index,
               *(row.mark for row in settings.missing_examples),
               *((h.vertex_group, h.reach, h.enabled) for h in settings.handles))
    known = _colours.get(ob.name)
    if known is None or known[0] != made_of:
        known = _colours[ob.name] = (made_of, vertex_colours(ob))
    if known[1] is None:
        return None
    world = np.array(ob.matrix_world, np.float32)
    return mesh_data.positions(mesh) @ world[:3, :3].T + world[:3, 3], known[1]


def _nearer(points, view):
    """The points, offset towards the eye of a RegionView3D."""
    back = np.array(view.view_matrix.inverted(), np.float32)
    if view.is_perspective:
        return points + _NEARER * (back[:3, 3] - points)
    return points + _NEARER * view.view_distance * back[:3, 2]


def _draw():
    import gpu
    from gpu_extras.batch import batch_for_shader
    context = bpy.context
    if _with_preview.object_count != len(bpy.data.objects) or _with_preview.names is None:
        _with_preview.object_count = len(bpy.data.objects)
        _with_preview.names = [ob.name for ob in bpy.data.objects if ob.type == 'MESH' and _is_wanted(ob)]
    shown = [ob for ob in map(context.view_layer.objects.get, _with_preview.names) if ob is not None
             and _is_wanted(ob) and ob.mode not in {'EDIT', 'WEIGHT_PAINT'} and ob.visible_get()]
    if not shown:
        return
    shader = shaders.points()
    gpu.state.blend_set('ALPHA')
    gpu.state.depth_test_set('LESS_EQUAL')
    gpu.state.point_size_set(_POINT_SIZE)
    for ob in shown:
        points = _points(ob, context.view_layer.depsgraph)  # as it is: evaluating waits for a render that waits for us
        if points is not None:
            content = {'pos': _nearer(points[0], context.region_data), 'color': points[1]}
            batch_for_shader(shader, 'POINTS', content).draw(shader)
    gpu.state.point_size_set(1.0)
    gpu.state.depth_test_set('NONE')
    gpu.state.blend_set('NONE')


_drawing = Drawing(_draw, 'POST_VIEW')
register, unregister = _drawing.register, _drawing.unregister
