# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's built-in shaders for points and lines wider than a pixel, by their names in each version, and a circle.

Only OpenGL has a point size and line width outside the shader. Vulkan and Metal draw a pixel, unless the shader itself
sets the size, as these do.
"""

import bpy
import numpy as np

_SEGMENTS = 96  # of the circle


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


def draw_circle(centre, radius):
    """Draws a circle that is visible on any background. centre, radius: in pixels of the drawn region."""
    import gpu
    from gpu_extras.batch import batch_for_shader
    turns = np.linspace(0, 2 * np.pi, _SEGMENTS + 1)
    corners = np.stack([centre[0] + radius * np.cos(turns), centre[1] + radius * np.sin(turns), 0 * turns], -1)
    gpu.state.blend_set('ALPHA')
    for width, colour in ((3.0, (0.0, 0.0, 0.0, 0.5)), (1.5, (1.0, 1.0, 1.0, 0.9))):
        shader = lines(width, colour)
        batch_for_shader(shader, 'LINE_STRIP', {'pos': corners.astype(np.float32)}).draw(shader)
    gpu.state.blend_set('NONE')
