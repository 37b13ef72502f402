# SPDX-License-Identifier: GPL-3.0-or-later
"""Loose parts that ride along: plates, rivets, horns, eyes, hair cards and single vertices that lie on a surface or
stick in it, and that no handle holds. They go with the surface beneath them: small ones rigidly, large ones, as
clothes, bend with it."""

import numpy as np

from ..library import native
from .loose_parts import LooseParts


class RidingParts:
    """The parts of a mesh that ride along."""

    def __init__(self, rest, triangles, faces, edges, roles, copies, how):
        """rest: (n, 3); triangles: (m, 3); faces: the function that reads the face of each, (m,); edges: (e, 2); roles:
        (n,), as for native.Bind. copies: (n,) bool, vertices that are welded with another one, and in no face here.
        how: 'AUTO', 'RIGID' or 'BEND'."""
        rest = rest.astype(np.float64)
        parts = LooseParts(rest, triangles, faces, edges, roles, copies)
        parts.find(how)
        self.counts = parts.counts
        found = [riders for riders in (parts.bending, parts.rigid) if riders is not None]
        self.vertices = np.concatenate([np.zeros(0, np.intp), *(riders.vertices for riders in found)])
        size = np.ptp(rest, axis=0).max(initial=0) or 1.0
        self._stages = [_library_riders(rest, triangles, riders, size) for riders in found]

    def __bool__(self):
        return bool(self._stages)

    def placed(self, offsets):
        """(3 n,) float32: offsets, with those of the parts that ride filled in."""
        result = np.array(offsets, np.float32)
        for riders in self._stages:  # rigid parts may ride on those that bend
            riders.place(result.reshape(-1, 3))
        return result


def _library_riders(rest, triangles, riders, size):
    """native.Riders. riders: loose_parts.Riders. size: of the mesh, the unit of their sizes."""
    numbers, groups = np.unique(riders.groups, return_inverse=True)
    used, of_contact = np.unique(riders.contacts[:, 1], return_inverse=True)
    contacts = np.stack([np.searchsorted(numbers, riders.contacts[:, 0]), of_contact], axis=1)
    sizes = [size * riders.sizes[number] for number in numbers] if riders.sizes else np.zeros(len(numbers))
    return native.Riders(rest, triangles[used], riders=np.stack([riders.vertices, groups], axis=1), contacts=contacts,
                         sizes=sizes)
