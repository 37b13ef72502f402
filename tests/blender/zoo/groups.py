# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of odd regions and handle groups."""

import numpy as np

from .kind import Kinds
from .specimen import REGION, RIGHT, DoesNotCombine, update

KINDS = kind = Kinds('object')


def _count(of):
    return len(of.ob.data.vertices)


def _members(of, name):
    if name not in of.ob.vertex_groups:
        raise DoesNotCombine
    index = of.ob.vertex_groups[name].index
    return [v.index for v in of.ob.data.vertices if any(g.group == index and g.weight > 0.5 for g in v.groups)]


def _free(of):
    right = set(_members(of, RIGHT))
    found = [v for v in _members(of, REGION) if v not in right]
    if not found:
        raise DoesNotCombine
    return found


# ---- the region

@kind("region empty", about='region')
def _region_empty(of):
    of.weights(REGION, {})


@kind("region of a group that is gone", about='region')
def _region_gone(of):
    of.ob.vertex_groups.remove(of.ob.vertex_groups[REGION])


@kind("no region", about='region')
def _no_region(of):
    of.ob.detail_deform.region = ''


@kind("region of everything", about='region')
def _region_all(of):
    of.weights(REGION, range(_count(of)))


@kind("region the handle alone", about='region')
def _region_handle(of):
    of.weights(REGION, _members(of, RIGHT))


@kind("region of one vertex", about='region')
def _region_vertex(of):
    of.weights(REGION, {_free(of)[0]: 1})


@kind("region of one row beside the handle", about='region')
def _region_row(of):
    right = set(_members(of, RIGHT))
    beside = {v for e in of.ob.data.edges for v in e.vertices if right & set(e.vertices)} - right
    of.weights(REGION, beside | right)


@kind("region of scattered vertices", about='region')
def _region_scattered(of):
    of.weights(REGION, range(0, _count(of), 7))


@kind("region cut into stripes", about='region')
def _region_stripes(of):
    of.weights(REGION, {v: 1 for v in range(_count(of)) if v // 11 % 3})


@kind("region without the handle", about='region')
def _region_beside(of):
    of.weights(REGION, _free(of))


@kind("region with weights of one half", about='region')
def _region_half(of):
    of.weights(REGION, dict.fromkeys(range(_count(of)), 0.5))


@kind("groups locked")
def _locked(of):
    for group in of.ob.vertex_groups:
        group.lock_weight = True


# ---- handles

@kind("handle without vertices", about='handle')
def _handle_empty(of):
    of.weights(RIGHT, {})


@kind("handle of the whole mesh", about='handle')
def _handle_all(of):
    of.weights(RIGHT, range(_count(of)))


@kind("handle of one vertex", about='handle')
def _handle_vertex(of):
    of.weights(RIGHT, {_free(of)[-1]: 1})


@kind("handle of scattered vertices", about='handle')
def _handle_scattered(of):
    of.weights(RIGHT, dict.fromkeys(_free(of)[::5], 1))


@kind("handle outside the region", about='handle')
def _handle_outside(of):
    region = set(_members(of, REGION))
    of.weights(RIGHT, {v: 1 for v in range(_count(of)) if v not in region} or {0: 1})


@kind("handle of all but one vertex", about='handle')
def _handle_nearly(of):
    left_out = _free(of)[0]
    of.weights(RIGHT, {v: 1 for v in range(_count(of)) if v != left_out})


@kind("handle with weights of one half", about='handle')
def _handle_half(of):
    of.weights(RIGHT, dict.fromkeys(_members(of, RIGHT), 0.5))


@kind("handle with weights NaN", about='handle')
def _handle_nan(of):
    of.weights(RIGHT, {v: float('nan') for v in _members(of, RIGHT)})


@kind("handle with weights of all kinds", about='handle')
def _handle_weights(of):
    found = _members(of, RIGHT)
    of.weights(RIGHT, {v: (1e-30, 0.500001, 0.51, 1)[k % 4] for k, v in enumerate(found)})


@kind("handle on a loose vertex", about='handle')
def _handle_loose(of):
    used = {v for p in of.ob.data.polygons for v in p.vertices}
    loose = [v for v in range(_count(of)) if v not in used]
    if not loose:
        of.ob.data.vertices.add(1)
        loose = [_count(of) - 1]
    of.weights(RIGHT, {loose[0]: 1})


@kind("handle's group gone", about='handle')
def _handle_gone(of):
    _members(of, RIGHT)
    of.ob.vertex_groups.remove(of.ob.vertex_groups[RIGHT])


@kind("handle without a group", about='handle')
def _handle_without(of):
    of.handle.vertex_group = ''


@kind("no handle", about='handle')
def _no_handle(of):
    of.ob.detail_deform.handles.clear()


@kind("handle switched off", about='handle')
def _handle_off(of):
    of.handle.enabled = False


@kind("two handles of one group")
def _same_group(of):
    of.add_handle("Other", [])
    of.ob.detail_deform.handles[-1].vertex_group = of.handle.vertex_group


@kind("two handles of one name")
def _same_name(of):
    of.add_handle("Other", _free(of)[:2])
    of.ob.detail_deform.handles[-1].name = of.handle.name


@kind("two handles that overlap")
def _overlapping(of):
    of.add_handle("Other", [*_members(of, RIGHT)[::2], *_free(of)[-3:]])


@kind("two handles side by side")
def _side_by_side(of):
    right = set(_members(of, RIGHT))
    of.add_handle("Other", {v for e in of.ob.data.edges for v in e.vertices if right & set(e.vertices)} - right
                  or _free(of)[:1])


@kind("a handle that stays in the middle")
def _anchor(of):
    free = _free(of)
    of.add_handle("Anchor", free[len(free) // 2:len(free) // 2 + 1])


@kind("each vertex a handle of its own")
def _all_handles(of):
    for v in _free(of)[:40:2]:
        of.add_handle(f"Vertex {v}", [v])


@kind("odd names")
def _names(of):
    _members(of, RIGHT)
    of.ob.vertex_groups[RIGHT].name = "ré'gion\n…\"%s{}"
    of.handle.vertex_group = "ré'gion\n…\"%s{}"
    of.handle.name = "handle 7"


@kind("a group that has the attribute's name")
def _taken(of):
    of.ob.vertex_groups.new(name='detail_deform_offset')


@kind("faces hidden and selected")
def _hidden(of):
    mesh = of.ob.data
    mesh.polygons.foreach_set('hide', np.arange(len(mesh.polygons)) % 2 == 0)
    mesh.vertices.foreach_set('hide', np.arange(len(mesh.vertices)) % 3 == 0)
    update()
