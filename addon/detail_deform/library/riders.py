# SPDX-License-Identifier: GPL-3.0-or-later
"""Loose parts that ride on a surface."""

import threading

from .loading import Owned, call_when_free, filled
from .structs import RidersOptions, mesh, points, points_out


class Riders(Owned):
    """Groups of vertices, each of which moves rigidly with the triangles on which it rides: dd_riders."""

    free = 'dd_riders_free'

    def __init__(self, rest, triangles, **options):
        """rest: (n, 3); triangles: (m, 3). options: by the names of dd_riders_options' fields: riders, (k, 2), a vertex
        and its group; contacts, (p, 2), a group and a triangle on which it rides; sizes, (g,), of the groups, 0 for one
        that moves by means."""
        self._lock = threading.Lock()
        self._make('dd_riders_make', mesh(rest, triangles), filled(RidersOptions, **options))

    def place(self, offsets):
        """offsets: contiguous (n, 3) float32, from rest; those of the riders are written."""
        with self._lock:
            call_when_free('dd_riders_place', self, points('offsets', offsets), points_out(offsets))
