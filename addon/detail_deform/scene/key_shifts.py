# SPDX-License-Identifier: GPL-3.0-or-later
"""The shift of handles' vertices by shape keys since Bind, and so their distance from their empties. Fast enough for
every redraw, as a few vertices of each handle are sampled."""

import numpy as np

from .. import session
from . import display_key, mesh_data, offset_attribute

# Sampled vertices a handle, and of all handles together (but at least one a handle): bound the time of a redraw.
_SAMPLES_A_HANDLE = 4
_SAMPLES_OF_ALL = 256
_samples = session.Memo(8)  # {signature of the binding: {group: [vertex]}}


def shifts(ob, handles):
    """(h, 3) float64: mean shift of the sampled vertices of each of these handles, in world space."""
    result = np.zeros((len(handles), 3))
    if ob.mode == 'EDIT' or ob.detail_deform.stale:  # no attributes to read, or indices out of date
        return result
    shown = [key for key in display_key.others(ob.data) if key.value and not key.mute and key != key.relative_key]
    at_bind = offset_attribute.find(ob.data, offset_attribute.SHAPE_KEY_OFFSETS)
    if not shown and at_bind is None:
        return result
    for number, vertices in enumerate(_samples_of(ob, [handle.vertex_group for handle in handles])):
        for vertex in vertices:
            for key in shown:
                weight = key.value * _weight(ob, key.vertex_group, vertex)
                result[number] += weight * np.subtract(key.data[vertex].co, key.relative_key.data[vertex].co)
            if at_bind is not None:
                result[number] -= at_bind.data[vertex].vector
        result[number] /= max(len(vertices), 1)
    return result @ np.array(ob.matrix_world, np.float64)[:3, :3].T


def _samples_of(ob, groups):
    """[[vertex]]: the samples of each of these groups; [] if the group no longer exists."""
    known = _samples.of(ob.detail_deform.signature, dict)
    new = [group for group in dict.fromkeys(groups) if group not in known and group in ob.vertex_groups]
    if new:
        count = min(_SAMPLES_A_HANDLE, max(1, _SAMPLES_OF_ALL // len(groups)))
        for group, vertices in zip(new, mesh_data.members_of_each(ob, new)):
            chosen = np.linspace(0, len(vertices) - 1, min(count, len(vertices))).astype(int)
            known[group] = vertices[chosen].tolist()
    return [known.get(group, []) for group in groups]


def _weight(ob, group, vertex):
    """Weight of a vertex in the group that masks a key; 1 without one."""
    if not group or group not in ob.vertex_groups:
        return 1.0
    try:
        return ob.vertex_groups[group].weight(vertex)
    except RuntimeError:  # the vertex is not in the group
        return 0.0
