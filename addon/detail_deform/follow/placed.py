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
    width, signature = look.soft_border(ob.detail_deform), ob.detail_deform.signature
    if width:
        ways = _of(signature, _ways, lambda: soft_border.ways(ob, content.roles(ob)))
        computed = computed * np.repeat(soft_border.shares(ways, width), 3)
    return _closed(ob, signature, start.with_kept(ob.data, computed), lambda: content.roles(ob))


def followed(ob, made_for, computed):
    """The same of what follows a source. made_for: what tells its transfer from all others."""
    return _closed(ob, made_for, computed, lambda: None)


def _closed(ob, made_for, result, roles):
    key = mirror_plane.key(ob)
    if not key:
        return result
    return _of(made_for, _seams, lambda: mirror_plane.Seams(ob, roles()), lambda seams: seams.key == key).closed(result)


def _of(made_for, kept, make, fits=lambda found: True):
    found = kept.pop(made_for, None)
    if found is None or not fits(found):
        found = make()
    kept[made_for] = found  # as the newest
    for old in list(kept)[:-_SPARE]:
        del kept[old]
    return found


def clear():
    _seams.clear()
    _ways.clear()
