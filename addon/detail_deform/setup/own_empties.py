# SPDX-License-Identifier: GPL-3.0-or-later
"""A copy of a mesh gets empties of its own in place of those of the first."""

from ..follow import hints
from . import handle_setup


def make(context, ob):
    """Each stands to this object as the other's stands to the other."""
    settings = ob.detail_deform
    settings.handle_collection = None  # that of the other one
    other = hints.shares_empties_with(ob)
    while other:
        for handle in settings.handles:
            empty = handle.target
            if empty and any(h.target == empty for h in other.detail_deform.handles):
                handle.target = handle.own_target = _copy(context, ob, other, empty)
        context.view_layer.update()
        other = hints.shares_empties_with(ob)


def _copy(context, ob, other, empty):
    place = ob.matrix_world @ other.matrix_world.inverted_safe() @ empty.matrix_world
    copy = empty.copy()
    handle_setup.collection_of(context, ob).objects.link(copy)
    if empty.parent == other:
        copy.parent = ob  # the rest as it was, so that its animation goes on
    else:
        copy.matrix_world = place
    return copy
