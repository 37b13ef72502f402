# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape that a binding starts from: what was seen when it was made, so that a handle that is added moves nothing.

It is the mesh's own vertices, moved by shape keys (keyed) and by what the binding before had made of them (kept).
Both are attributes of the mesh, which are copied, saved and undone with it. Only where they are needed.
"""

import numpy as np

from . import examples, handle_matrices, mesh_data, node_group, offset_attribute, proportions
from .offset_attribute import KEPT, KEYED


# Of some vertices' extent before a modifier, that behind it: what is flattened further tells no size to pull in.
_LEAST_SIZE = 1e-3


def shape(ob):
    """(n, 3) float32: what is bound."""
    result = shape_at_rest(ob)
    if is_deformed(ob.data):
        result += offset_attribute.read(ob.data, KEPT)
    return result


def shape_at_rest(ob):
    """(n, 3) float32: the same without what an earlier binding had made of it."""
    result = mesh_data.positions(ob.data)
    if offset_attribute.find(ob.data, KEYED) is not None:
        result += offset_attribute.read(ob.data, KEYED)
    return result


def is_deformed(mesh):
    return offset_attribute.find(mesh, KEPT) is not None


def with_kept(mesh, offsets):
    """(3 n,) float32: from the mesh's own vertices; offsets: from the start."""
    return offsets + offset_attribute.read(mesh, KEPT).ravel() if is_deformed(mesh) else offsets


def visible(ob):
    """(n, 3) float32: where the vertices are seen, before other modifiers, in any mode."""
    return mesh_data.positions(ob.data) + mesh_data.key_mix(ob) + _seen(ob)


def _seen(ob):
    """(n, 3) float32: the offsets as far as Factor and Influence show them."""
    modifier = node_group.find_modifier(ob)
    if not modifier or not modifier.show_viewport:
        return np.zeros((len(ob.data.vertices), 3), np.float32)
    return offset_attribute.read(ob.data) * np.asarray(node_group.amount(ob, modifier), np.float32)


def motion(ob, chosen, by=offset_attribute.NAME):
    """(4, 4): the rigid motion by which offsets, as far as they are seen or those that are kept, take the chosen
    vertices, and their neighbours where they are few. chosen: (n,) bool."""
    return next(motions(ob, [np.flatnonzero(chosen)], by))


def motions(ob, parts, by=offset_attribute.NAME):
    """The same for each of some arrays of vertices."""
    moved = offset_attribute.read(ob.data, by) if by == KEPT else _seen(ob)
    if not moved.any():
        yield from (np.eye(4) for _ in parts)
        return
    before = shape_at_rest(ob).astype(np.float64)
    yield from _motions(ob, parts, before, before + moved)


def motions_to(ob, parts, positions):
    """The same from what is bound to another shape. positions: (n, 3)."""
    yield from _motions(ob, parts, shape(ob).astype(np.float64), positions.astype(np.float64))


def similarities(ob, parts, before, after):
    """(4, 4) for each of some arrays of vertices: the similarity that takes them from one shape to another, (n, 3)."""
    yield from _motions(ob, parts, before.astype(np.float64), after.astype(np.float64), scaled=True)


def _motions(ob, parts, before, after, scaled=False):
    both_ways = None  # made for the first part that needs it
    # A motion is rigid as it is seen.
    linear = proportions.of(ob).astype(np.float64)
    before, after, space = before @ linear, after @ linear, proportions.Space(np.linalg.inv(linear))
    for part in parts:
        if len(part) < 3:
            if both_ways is None:
                edges = mesh_data.edges(ob.data)
                both_ways = np.concatenate([edges, edges[:, ::-1]])
                both_ways = both_ways[np.argsort(both_ways[:, 0])]
            low, high = (np.searchsorted(both_ways[:, 0], part, side) for side in ('left', 'right'))
            part = np.unique(np.concatenate([part, *(both_ways[b:e, 1] for b, e in zip(low, high))]))
        yield space.motions(_nearest(before[part], after[part], scaled)[None])[0]


def _nearest(before, after, scaled):
    """The nearest rigid motion of some points (Kabsch), or similarity (Umeyama)."""
    middle, there = before.mean(0), after.mean(0)
    left, sizes, right = np.linalg.svd((after - there).T @ (before - middle))
    handed = np.linalg.det(left @ right)
    left[:, 2] *= handed
    result = np.eye(4)
    result[:3, :3] = left @ right
    if scaled:
        spread = ((before - middle) ** 2).sum()
        size = (sizes[:2].sum() + handed * sizes[2]) / (spread or 1.0)
        result[:3, :3] *= size if _LEAST_SIZE < size < 1 / _LEAST_SIZE else 1.0
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
    if mesh_data.is_nothing(ob.data, vectors):
        offset_attribute.take_away(ob.data, name)
        return False
    offset_attribute.put(ob.data, name, vectors.ravel())
    return True


def forget_deformation(mesh):
    """Whether there was one."""
    return offset_attribute.take_away(mesh, KEPT)


def forget_strange(ob):
    """What came with the data of another object, as by Join, to one that neither is bound nor was."""
    settings = ob.detail_deform
    if not settings.signature and not any(map(handle_matrices.has_home, settings.handles)):
        forget(ob.data)
        offset_attribute.remove(ob.data)


def forget(mesh):
    """The mesh's own vertices are the start."""
    forget_deformation(mesh)
    offset_attribute.take_away(mesh, KEYED)
