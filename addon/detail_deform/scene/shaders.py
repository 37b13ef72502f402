# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's built-in shaders for points and lines wider than a pixel, by their names in each version.

Only OpenGL has a point size and line width outside the shader. Vulkan and Metal draw a pixel, unless the shader itself
sets the size, as these do.
"""

import bpy


def _built_in(name):
    import gpu
    return gpu.shader.from_builtin(name if bpy.app.version >= (4, 0) else f'3D_{name}')


def points():
    """For 'POINTS' with 'pos' and 'color'; the size is that of gpu.state.point_size_set()."""
    # Before 4.5 there is no such shader, and on Windows and Linux no back end but OpenGL.
    return _built_in('POINT_FLAT_COLOR' if bpy.app.version >= (4, 5) else 'FLAT_COLOR')


def lines(width, colour):
    """For 'LINES' and 'LINE_STRIP' with three-dimensional 'pos'; width in pixels of the drawn region."""
    import gpu
    shader = _built_in('POLYLINE_UNIFORM_COLOR')
    shader.uniform_float('viewportSize', gpu.state.viewport_get()[2:])
    shader.uniform_float('lineWidth', width)
    shader.uniform_float('color', colour)
    return shader
