# SPDX-License-Identifier: GPL-3.0-or-later
"""The start of a binding: the shape displayed at Bind (at Factor 1, no Influence), so that adding a handle moves
nothing.

It is the mesh's own vertices plus the offsets by shape keys (SHAPE_KEY_OFFSETS) and those of the previous binding
(PREVIOUS_OFFSETS). Both are attributes of the mesh, copied, saved and undone with it, and present only where they are
large enough to be seen.
"""

import numpy as np

from . import deform_modifier, display_key, examples, handle_rests, mesh_data, offset_attribute, proportions
from .offset_attribute import PREVIOUS_OFFSETS, SHAPE_KEY_OFFSETS


# Least scale of a similarity, and inverse of the largest: outside of that the vertices have collapsed, or were
# collapsed, and the scale is taken as 1. Safety: the similarity is inverted.
_MIN_SCALE = 1e-3


def shape(ob):
    """(n, 3) float32: the start, in local space."""
    result = undeformed_shape(ob)
    if has_previous_offsets(ob.data):
        result += offset_attribute.read(ob.data, PREVIOUS_OFFSETS)
    return result


def undeformed_shape(ob):
    """(n, 3) float32: the start without the offsets of the previous binding."""
    result = mesh_data.positions(ob.data)
    if offset_attribute.find(ob.data, SHAPE_KEY_OFFSETS) is not None:
        result += offset_attribute.read(ob.data, SHAPE_KEY_OFFSETS)
    return result


def has_previous_offsets(mesh):
    return offset_attribute.find(mesh, PREVIOUS_OFFSETS) is not None


def with_previous_offsets(mesh, offsets):
    """(3 n,) float32: offsets from the start, (3 n,), plus those of the previous binding."""
    return offsets + offset_attribute.read(mesh, PREVIOUS_OFFSETS).ravel() if has_previous_offsets(mesh) else offsets


def deformed_positions(ob):
    """(n, 3) float32: displayed positions before other modifiers: with shape keys and offsets, in any mode."""
    return mesh_data.positions(ob.data) + mesh_data.key_mix(ob) + _displayed_offsets(ob)


def _displayed_offsets(ob):
    """(n, 3) float32: the offsets times Factor and Influence; zero if the modifier or its shape key is hidden."""
    modifier = deform_modifier.find(ob)
    if not modifier or not modifier.show_viewport or display_key.why_hidden(ob):
        return np.zeros((len(ob.data.vertices), 3), np.float32)
    return offset_attribute.read(ob.data) * np.asarray(deform_modifier.display_weights(ob, modifier), np.float32)


def rigid_motion(ob, chosen, by=offset_attribute.DISPLAYED_OFFSETS):
    """(4, 4): the nearest rigid motion of the chosen vertices by the displayed offsets, or by the attribute
    PREVIOUS_OFFSETS. Fewer than three vertices are extended by their neighbours. chosen: (n,) bool."""
    return next(rigid_motions(ob, [np.flatnonzero(chosen)], by))


def rigid_motions(ob, parts, by=offset_attribute.DISPLAYED_OFFSETS):
    """Generator of rigid_motion() for each array of vertices in parts."""
    moved = offset_attribute.read(ob.data, by) if by == PREVIOUS_OFFSETS else _displayed_offsets(ob)
    if not moved.any():
        yield from (np.eye(4) for _ in parts)
        return
    before = undeformed_shape(ob).astype(np.float64)
    yield from _fitted_maps(ob, parts, before, before + moved)


def rigid_motions_to(ob, parts, positions):
    """Generator: the nearest rigid motion of each array of vertices in parts from the start to positions, (n, 3)."""
    yield from _fitted_maps(ob, parts, shape(ob).astype(np.float64), positions.astype(np.float64))


def similarities(ob, parts, before, after):
    """Generator of (4, 4): the nearest similarity of each array of vertices in parts from before to after, (n, 3)
    each."""
    yield from _fitted_maps(ob, parts, before.astype(np.float64), after.astype(np.float64), scaled=True)


def _fitted_maps(ob, parts, before, after, scaled=False):
    both_ways = None  # made for the first part that needs it
    # Rigid in the scene's proportions.
    linear = proportions.of(ob).astype(np.float64)
    before, after, space = before @ linear, after @ linear, proportions.ProportionalSpace(np.linalg.inv(linear))
    for part in parts:
        if len(part) < 3:
            if both_ways is None:
                edges = mesh_data.edges(ob.data)
                both_ways = np.concatenate([edges, edges[:, ::-1]])
                both_ways = both_ways[np.argsort(both_ways[:, 0])]
            low, high = (np.searchsorted(both_ways[:, 0], part, side) for side in ('left', 'right'))
            part = np.unique(np.concatenate([part, *(both_ways[b:e, 1] for b, e in zip(low, high))]))
        yield space.motions(_fit(before[part], after[part], scaled)[None])[0]


def _fit(before, after, scaled):
    """(4, 4): least-squares rigid motion of points (Kabsch), or similarity if scaled (Umeyama)."""
    middle, image_middle = before.mean(0), after.mean(0)
    left, sizes, right = np.linalg.svd((after - image_middle).T @ (before - middle))
    handed = np.linalg.det(left @ right)
    left[:, 2] *= handed
    result = np.eye(4)
    result[:3, :3] = left @ right
    if scaled:
        spread = ((before - middle) ** 2).sum()
        size = (sizes[:2].sum() + handed * sizes[2]) / (spread or 1.0)
        result[:3, :3] *= size if _MIN_SCALE < size < 1 / _MIN_SCALE else 1.0
    result[:3, 3] = image_middle - result[:3, :3] @ middle
    return result


def store_key_offsets(ob):
    """Stores the present offsets by shape keys as part of the start, except by keys that are examples, whose weights
    the method solves for."""
    _put(ob, SHAPE_KEY_OFFSETS, mesh_data.key_mix(ob, examples.shown_keys(ob)))


def store_previous_offsets(ob):
    """Stores the present offset attribute as part of the start. Returns whether any is large enough to be seen."""
    return _put(ob, PREVIOUS_OFFSETS, offset_attribute.read(ob.data))


def _put(ob, name, vectors):
    if mesh_data.are_invisible(ob.data, vectors):
        offset_attribute.remove_attribute(ob.data, name)
        return False
    offset_attribute.put(ob.data, name, vectors.ravel())
    return True


def forget_previous_offsets(mesh):
    """Removes the previous binding's offsets from the start. Returns whether there were any."""
    return offset_attribute.remove_attribute(mesh, PREVIOUS_OFFSETS)


def forget_foreign(ob):
    """Removes attributes that came with another object's data, as by Join, if this object is not and never was
    bound."""
    settings = ob.detail_deform
    if not settings.signature and not any(map(handle_rests.has_home, settings.handles)):
        forget(ob.data)
        offset_attribute.remove(ob.data)
        display_key.keep_alone(ob.data, display_key.find(ob.data))


def forget(mesh):
    """Removes PREVIOUS_OFFSETS and SHAPE_KEY_OFFSETS: the start is then the mesh's own vertices."""
    forget_previous_offsets(mesh)
    offset_attribute.remove_attribute(mesh, SHAPE_KEY_OFFSETS)
