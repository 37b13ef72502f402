# SPDX-License-Identifier: GPL-3.0-or-later
"""What the library computes as a mesh is to show it: fading towards the region's border where that is asked for,
counted from its own vertices, and with closed seams."""

import numpy as np

from ..scene import mirror_plane, soft_border, start
from . import content, look

_SPARE = 8

_seams = {}  # mirror_plane.Seams by the content that they were made for
_ways = {}  # soft_border.ways by the same


def offsets(ob, computed):
    """(3 n,) float32; computed: from the start."""
    width, key = look.soft_border(ob.detail_deform), mirror_plane.key(ob)
    if width:
        ways = _of(ob, _ways, lambda: soft_border.ways(ob, content.roles(ob)))
        computed = computed * np.repeat(soft_border.shares(ways, width), 3)
    result = start.with_kept(ob.data, computed)
    if not key:
        return result
    return _of(ob, _seams, lambda: mirror_plane.Seams(ob, content.roles(ob)), lambda seams: seams.key == key).closed(
        result)


def _of(ob, kept, make, fits=lambda found: True):
    signature = ob.detail_deform.signature
    found = kept.pop(signature, None)
    if found is None or not fits(found):
        found = make()
    kept[signature] = found  # as the newest
    for old in list(kept)[:-_SPARE]:
        del kept[old]
    return found


def clear():
    _seams.clear()
    _ways.clear()
