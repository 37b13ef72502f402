# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures of a deformation, its gradients at vertices, and distances over a surface."""

import numpy as np

from .loading import call, filled
from .structs import MeasureOptions, Measures, contiguous, mesh, points


def measure(rest, deformed, triangles, roles, base=None, deformed_base=None):
    """Measures of a deformation; all positions (n, 3), roles as for Bind."""
    found = Measures()
    roles = contiguous('roles', roles, np.int32)
    call('dd_mesh_measure', mesh(rest, triangles), roles, len(roles), points('deformed', deformed),
         filled(MeasureOptions, base=base, deformed_base=deformed_base), found)
    return found


def distances(positions, triangles, sources):
    """(n,) float32: over the surface, from the nearest source; infinite where no triangles lead.
    positions: (n, 3); triangles: (m, 3); sources: (n,) bool."""
    sources = contiguous('sources', sources, np.int32)
    found = np.empty(len(positions), np.float32)
    call('dd_mesh_distances', mesh(positions, triangles), sources, len(sources), found, len(found))
    return found


def vertex_gradients(rest, deformed, triangles):
    """(n, 3, 3) float32: at each vertex the mean deformation gradient (15) of the triangles around it, from rest to
    deformed; both (n, 3)."""
    found = np.empty((len(rest), 3, 3), np.float32)
    call('dd_mesh_vertex_gradients', mesh(rest, triangles), points('deformed', deformed), found, len(found))
    return found
