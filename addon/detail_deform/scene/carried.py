# SPDX-License-Identifier: GPL-3.0-or-later
"""Carries along what is kept in an object's own space where that space has changed under it.

Set Origin and Apply move all vertices of a mesh by one affine motion and the object by its inverse, so that nothing is
seen to move. The places of handles at rest, and offsets, are told in the same space and have to go along. To know the
motion, some of the vertices' positions are kept from the bind, as text that is saved and undone with the object.
"""

import numpy as np

from . import handle_matrices, mesh_data, offset_attribute, outside_base
from .offset_attribute import KEPT, KEYED, NAME

_POINTS = 64  # vertices, evenly through the mesh's list: four in general position would do
_EXACT = 1e-5  # of the mesh's size: what single precision leaves of an affine motion, and less than an edit
_FLAT = 1e-5  # of a mesh's largest extent, the smallest that tells how it was scaled that way


def points(mesh):
    """Of what is bound, for motion_since."""
    return _chosen(mesh).tobytes().hex()


def _chosen(mesh):
    positions = mesh_data.positions(mesh)
    return positions[np.linspace(0, len(positions) - 1, min(_POINTS, len(positions))).astype(np.intp)]


def motion_since(mesh, kept):
    """(4, 4): the affine motion that has taken the vertices from where these points were kept; None where there is
    none, as after an edit, or none is known."""
    try:
        before = np.frombuffer(bytes.fromhex(kept), np.float32).reshape(-1, 3).astype(np.float64)
    except (TypeError, ValueError):  # in a file that something else has written to
        return None
    after = _chosen(mesh).astype(np.float64)
    if not len(before) or len(before) != len(after) or not (np.isfinite(before).all() and np.isfinite(after).all()):
        return None
    found = _affine(before, after)
    if found is None:
        return None
    # What single precision rounds off depends on how far from the origin the mesh is, before and after.
    linear = np.abs(found[:3, :3]).sum(axis=1).max()
    rounded = 1e-6 * (np.abs(after).max() + linear * np.abs(before).max())
    allowed = _EXACT * np.ptp(after, axis=0).max() + rounded
    if np.abs(before @ found[:3, :3].T + found[:3, 3] - after).max() > allowed:
        return None
    return None if np.abs(before - after).max() <= allowed else found


def _affine(before, after):
    """(4, 4): the affine motion that fits best; None where these points don't tell one, or it has no inverse."""
    middle, there = before.mean(axis=0), after.mean(axis=0)
    _, extents, axes = np.linalg.svd(before - middle, full_matrices=False)
    if len(extents) < 3 or extents[1] <= _FLAT * extents[0]:
        return None
    known = 3 if extents[2] > _FLAT * extents[0] else 2
    # Along the principal axes; of a plane the third is the normal, which goes as the two in it do.
    moved = np.linalg.lstsq((before - middle) @ axes[:known].T, after - there, rcond=None)[0]
    if known == 2:
        normal = np.cross(*moved)
        size = np.linalg.norm(normal)
        moved = np.vstack([moved, np.linalg.det(axes) * normal / np.sqrt(size or 1.0)])
    result = np.eye(4)
    result[:3, :3] = moved.T @ axes
    result[:3, 3] = there - result[:3, :3] @ middle
    largest = np.linalg.norm(result[:3, :3], 2)
    return result if abs(np.linalg.det(result[:3, :3])) > (_FLAT * largest) ** 3 else None


def went_along(motion, before, now):
    """Whether places went along with the vertices, rather than stay where they were in the object's space, as where all
    vertices were moved in Edit Mode. before, now: (k, 4, 4) places in the object's space."""
    return np.linalg.norm(now - motion @ before) < np.linalg.norm(now - before)


def carry(ob, motion):
    """motion: of motion_since."""
    settings, back = ob.detail_deform, np.linalg.inv(motion)
    for handle in settings.handles:
        if handle.mirrors or handle.symmetric:
            space = np.array(handle.mirror_space, np.float64).reshape(4, 4)
            handle.mirror_space = (motion @ space if space.any() else motion).ravel().tolist()
        for name in ('rest_matrix', 'home_matrix'):
            place = np.array(getattr(handle, name), np.float64).reshape(4, 4)
            if place.any():
                # Of one that mirrors another, it is a motion and no place.
                setattr(handle, name, (motion @ place @ (back if handle.mirrors else np.eye(4))).ravel().tolist())
        if any(handle.pose_matrix):
            handle.pose_matrix = (motion @ handle_matrices.pose_of(handle) @ back).ravel().tolist()
    if any(settings.base_rest_matrix):
        place = np.array(settings.base_rest_matrix, np.float64).reshape(4, 4)
        settings.base_rest_matrix = (motion @ place).ravel().tolist()
    if settings.base_rest_mesh:
        positions = mesh_data.positions(settings.base_rest_mesh) @ motion[:3, :3].T + motion[:3, 3]
        if settings.base_rest_mesh.users > 1:  # a copy of the object has it, too
            settings.base_rest_mesh = settings.base_rest_mesh.copy()
        settings.base_rest_mesh.vertices.foreach_set('co', positions.astype(np.float32).ravel())
    for name in (NAME, KEPT, KEYED):
        if offset_attribute.find(ob.data, name) is not None:
            vectors = offset_attribute.read(ob.data, name) @ motion[:3, :3].T
            offset_attribute.put(ob.data, name, vectors.astype(np.float32).ravel())
    ob.data.update_tag()
    settings.bound_points = points(ob.data)


def places(ob, depsgraph):
    """(k, 4, 4) float64: where what moves the surface is now, in the object's space: the base object, or the empties of
    enabled handles. Raises MeshProblem."""
    if ob.detail_deform.base == 'OBJECT':
        return outside_base.place(ob, depsgraph)[None]
    return handle_matrices.places_of(ob, handle_matrices.with_empties(ob.detail_deform), depsgraph)


def rest_places(settings):
    """(k, 4, 4) float64: the same at rest."""
    if settings.base == 'OBJECT':
        return np.array(settings.base_rest_matrix, np.float64).reshape(1, 4, 4)
    return np.array([handle_matrices.rest(handle) for handle in handle_matrices.with_empties(settings)])
