# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape that a binding starts from: what was seen when it was made, so that a handle that is added moves nothing.

It is the mesh's own vertices, moved by shape keys (keyed) and by what the binding before had made of them (kept).
Both are attributes of the mesh, which are copied, saved and undone with it. Only where they are needed.
"""

import numpy as np

from . import examples, mesh_data, node_group, offset_attribute
from .offset_attribute import KEPT, KEYED

# Of the size of the mesh: by so little has nothing moved.
_NOTHING = 1e-6


def shape(ob):
    """(n, 3) float32: what is bound."""
    result = mesh_data.positions(ob.data)
    for name in (KEYED, KEPT):
        if offset_attribute.find(ob.data, name) is not None:
            result += offset_attribute.read(ob.data, name)
    return result


def is_deformed(mesh):
    return offset_attribute.find(mesh, KEPT) is not None


def with_kept(mesh, offsets):
    """(3 n,) float32: from the mesh's own vertices; offsets: from the start."""
    return offsets + offset_attribute.read(mesh, KEPT).ravel() if is_deformed(mesh) else offsets


def visible(ob):
    """(n, 3) float32: where the vertices are seen, before other modifiers, in any mode."""
    modifier = node_group.find_modifier(ob)
    result = mesh_data.positions(ob.data) + mesh_data.key_mix(ob)
    if modifier and modifier.show_viewport:
        result += offset_attribute.read(ob.data) * node_group.amount(ob, modifier)
    return result


def motion(ob, chosen, by=offset_attribute.NAME):
    """(4, 4): the rigid motion by which offsets, those that are shown or those that are kept, take the chosen
    vertices, and their neighbours where they are few. chosen: (n,) bool."""
    moved = offset_attribute.read(ob.data, by)
    if not moved.any():
        return np.eye(4)
    if chosen.sum() < 3:
        edges = mesh_data.edges(ob.data)
        chosen = chosen.copy()
        chosen[edges[chosen[edges].any(axis=1)]] = True
    before = mesh_data.positions(ob.data) + offset_attribute.read(ob.data, KEYED)
    return _rigid(before[chosen].astype(np.float64), (before + moved)[chosen].astype(np.float64))


def _rigid(before, after):
    """The nearest rigid motion of some points (Kabsch)."""
    middle, there = before.mean(0), after.mean(0)
    left, _, right = np.linalg.svd((after - there).T @ (before - middle))
    left[:, 2] *= np.linalg.det(left @ right)
    result = np.eye(4)
    result[:3, :3] = left @ right
    result[:3, 3] = there - result[:3, :3] @ middle
    return result


def take_keys(ob):
    """What the shape keys make of the mesh now belongs to the start, but for those that are examples: how much of
    these there is, is to be found."""
    _put(ob, KEYED, mesh_data.key_mix(ob, examples.shown_keys(ob)))


def take_deformation(ob):
    """What the offsets make of the mesh now does, too. Returns whether that is anything."""
    return _put(ob, KEPT, offset_attribute.read(ob.data))


def _put(ob, name, vectors):
    size = np.ptp(mesh_data.positions(ob.data), axis=0).max(initial=0)
    if np.abs(vectors).max(initial=0) <= _NOTHING * size:
        offset_attribute.take_away(ob.data, name)
        return False
    offset_attribute.put(ob.data, name, vectors.ravel())
    return True


def forget_deformation(mesh):
    """Whether there was one."""
    return offset_attribute.take_away(mesh, KEPT)


def forget(mesh):
    """The mesh's own vertices are the start."""
    forget_deformation(mesh)
    offset_attribute.take_away(mesh, KEYED)
