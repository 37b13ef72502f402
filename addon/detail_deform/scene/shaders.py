# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own shaders for points and for lines wider than a pixel, under the names that each Blender has for them.

Only OpenGL has a size of points and a width of lines beside the shader. Vulkan and Metal draw them a pixel wide, unless
the shader itself makes them larger, as these do.
"""

import bpy


def _built_in(name):
    import gpu
    return gpu.shader.from_builtin(name if bpy.app.version >= (4, 0) else f'3D_{name}')


def points():
    """For 'POINTS' with 'pos' and 'color', which are as large as gpu.state.point_size_set() says."""
    # Before 4.5 Blender has no shader of this kind, and no other back end than OpenGL for Windows and Linux.
    return _built_in('POINT_FLAT_COLOR' if bpy.app.version >= (4, 5) else 'FLAT_COLOR')


def lines(width, colour):
    """For 'LINES' and 'LINE_STRIP' with 'pos' in three dimensions; width in pixels of the region that is drawn."""
    import gpu
    shader = _built_in('POLYLINE_UNIFORM_COLOR')
    shader.uniform_float('viewportSize', gpu.state.viewport_get()[2:])
    shader.uniform_float('lineWidth', width)
    shader.uniform_float('color', colour)
    return shader
