# SPDX-License-Identifier: GPL-3.0-or-later
"""Preview of a region: its surface, coloured by the distance from the selection to the border, and a circle."""

import bpy
import numpy as np
from mathutils import Matrix

from ..scene import mesh_data, shaders

_NEAR_COLOUR, _BORDER_COLOUR = (1.0, 0.55, 0.1, 0.6), (0.2, 0.75, 0.7, 0.25)
_NEARER = 2e-4  # depth bias in normalized device coordinates, so that the surface doesn't hide its own preview

_VERTEX = """
void main()
{
  away = distance_over_surface;
  gl_Position = placed * vec4(position, 1.0);
  gl_Position.z -= nearer * gl_Position.w;
}
"""
# The colour fades with the share s of the radius like the deformation: by smoothstep, level at both ends, or if sharp
# (order 1) by (1 - s)^1.65: .69, .32, .07 at s = 1/5, 1/2, 4/5, near the heights .69, .32, .08 that
# native/bench/RESULTS.md gives on a flat disk for a handle whose radius is an eighth of the reach's.
_FRAGMENT = """
void main()
{
  float share = away / reach;
  if (!(share <= 1.0)) {
    discard;
  }
  float faded = sharp > 0.5 ? 1.0 - pow(1.0 - share, 1.65) : smoothstep(0.0, 1.0, share);
  colour = mix(near_colour, border_colour, faded);
}
"""


def _make_shader():
    import gpu
    info, interface = gpu.types.GPUShaderCreateInfo(), gpu.types.GPUStageInterfaceInfo('detail_deform_reach')
    interface.smooth('FLOAT', 'away')
    for kind, name in (('MAT4', 'placed'), ('VEC4', 'near_colour'), ('VEC4', 'border_colour'), ('FLOAT', 'reach'),
                       ('FLOAT', 'nearer'), ('FLOAT', 'sharp')):
        info.push_constant(kind, name)
    info.vertex_in(0, 'VEC3', 'position')
    info.vertex_in(1, 'FLOAT', 'distance_over_surface')
    info.vertex_out(interface)
    info.fragment_out(0, 'VEC4', 'colour')
    info.vertex_source(_VERTEX)
    info.fragment_source(_FRAGMENT)
    return gpu.shader.create_from_info(info)


class ReachDrawing:
    """Draws into every 3D view until close(). The buffers are made once; another radius is another uniform."""

    def __init__(self, choice, surface, positions, others):
        """positions: (n, 3) float32, the displayed positions of the vertices of around, in world units from the
        object's origin. others: [vertices], what each of the choice's others moves."""
        self._choice, self._surface, self._positions, self._others = choice, surface, positions, others
        self._shader = self._batch = self._batches = None
        self._handles = [bpy.types.SpaceView3D.draw_handler_add(draw, (), 'WINDOW', kind)
                         for draw, kind in ((self._draw_surface, 'POST_VIEW'), (self._draw_circle, 'POST_PIXEL'))]

    def close(self):
        for handle in self._handles:
            bpy.types.SpaceView3D.draw_handler_remove(handle, 'WINDOW')
        self._handles = []
        self._shader = self._batch = self._batches = None

    def _prepare(self):
        self._shader = _make_shader()
        # Unreachable vertices are infinitely far, but the shader needs finite numbers.
        away = np.where(np.isfinite(self._surface.distances), self._surface.distances, np.float32(1e30))
        self._batch = self._batch_of(away, self._surface.triangles)
        self._batches = []
        for moves in self._others:
            away = np.full(len(self._positions), 2)
            away[moves] = 0
            near = self._surface.triangles[mesh_data.touching(self._surface.triangles, away == 0)]
            self._batches.append(self._batch_of(away, near))

    def _batch_of(self, away, triangles):
        from gpu_extras.batch import batch_for_shader
        content = {'position': self._positions, 'distance_over_surface': away.astype(np.float32)}
        return batch_for_shader(self._shader, 'TRIS', content, indices=triangles)

    def _draw_surface(self):
        import gpu
        if self._batch is None:
            self._prepare()
        self._shader.bind()
        placed = bpy.context.region_data.perspective_matrix @ Matrix.Translation(self._surface.origin)
        for name, value in (('placed', placed), ('border_colour', _BORDER_COLOUR), ('nearer', _NEARER),
                            ('sharp', float(self._choice.smoothness == 1))):
            self._shader.uniform_float(name, value)
        gpu.state.blend_set('ALPHA')
        gpu.state.depth_test_set('LESS_EQUAL')
        shown = [(self._batches[number], _BORDER_COLOUR, 1.0) for number in self._choice.sharing_indices]
        for batch, near, reach in (*shown, (self._batch, _NEAR_COLOUR, self._choice.radius)):
            self._shader.uniform_float('near_colour', near)
            self._shader.uniform_float('reach', reach)
            batch.draw(self._shader)
        gpu.state.depth_test_set('NONE')
        gpu.state.blend_set('NONE')

    def _draw_circle(self):
        circle = self._choice.circle(bpy.context.region)
        if circle is None:
            return
        shaders.draw_circle(*circle)
