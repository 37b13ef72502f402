# SPDX-License-Identifier: GPL-3.0-or-later
"""The markers of a mesh and of its source as numbered dots in the viewport."""

import bpy

from ..setup import markers
from ..scene.mesh_data import MeshProblem
from .preview import Drawing

_BOTH_COLOUR, _ONE_COLOUR = (1.0, 0.85, 0.1, 1.0), (1.0, 0.25, 0.2, 1.0)
_TEXT_SIZE = 14
_found = {}  # by object: what they were found in, and the vertex of each number


def is_in_use():
    """Whether anything is kept that forget() could forget."""
    return bool(_found)


def forget(edited):
    """They are looked for anew where these meshes were edited."""
    for name in list(_found):
        ob = bpy.data.objects.get(name)
        if ob is None or ob.data in edited:
            del _found[name]


def _of(ob):
    """As markers.of(), looked for only when groups or empties are others; none while something is wrong with
    them, which the search says."""
    made_of = (*ob.vertex_groups.keys(), *(child.name for child in ob.children), len(ob.data.vertices), ob.mode)
    known = _found.get(ob.name)
    if known is None or known[0] != made_of:
        try:
            known = (made_of, markers.of(ob))
        except MeshProblem:
            known = (made_of, {})
        _found[ob.name] = known
    return known[1]


def labels(ob):
    """[(number, world place, whether the other mesh has it too)] of a mesh and of its source."""
    source = ob.detail_deform.transfer.source
    sides = [(side, _of(side)) for side in (ob, source) if side is not None and side.type == 'MESH']
    both = set.intersection(*(set(found) for _, found in sides))
    result = []
    for side, found in sides:
        vertices = side.data.vertices
        result += [(number, side.matrix_world @ vertices[vertex].co, number in both)
                   for number, vertex in found.items() if vertex < len(vertices)]
    return result


def _draw():
    context = bpy.context
    ob = context.active_object
    if ob is None or ob.type != 'MESH':
        return
    settings = ob.detail_deform.transfer
    if not settings.show_markers or settings.live:
        return
    import blf
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    size = int(_TEXT_SIZE * context.preferences.system.ui_scale)
    blf.size(0, size, *(() if bpy.app.version >= (4, 0) else (72,)))
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0, 0, 0, 1)
    for number, place, on_both in labels(ob):
        at = location_3d_to_region_2d(context.region, context.region_data, place)
        if at is None:
            continue
        blf.color(0, *(_BOTH_COLOUR if on_both else _ONE_COLOUR))
        blf.position(0, at.x - size / 6, at.y - size / 3, 0)
        blf.draw(0, f"\u2022 {number}")
    blf.disable(0, blf.SHADOW)


_drawing = Drawing(_draw, 'POST_PIXEL')
register = _drawing.register


def unregister():
    _drawing.unregister()
    _found.clear()
