# SPDX-License-Identifier: GPL-3.0-or-later
"""Transforms the data stored in an object's local space after Set Origin or Apply has changed that space.

Both transform all vertices by one affine map and the object by its inverse, so nothing moves in the world. Rest
transforms of handles, offsets and the base's rest are stored in local space and must be transformed too. The map is
recovered from sample vertices whose positions are stored at Bind, as text that is saved and undone with the object.
"""

import numpy as np

from . import handle_rests, handle_transforms, mesh_data, offset_attribute, outside_base
from .subject import with_empties
from .offset_attribute import DISPLAYED_OFFSETS, PREVIOUS_OFFSETS, SHAPE_KEY_OFFSETS

_SAMPLES = 64  # vertices, evenly spaced by index; an affine map needs four in general position, more reveal edits
# Fraction of the samples' largest extent (along an axis): residuals below it count as single-precision rounding of an
# affine map, residuals above it as an edit.
_EXACT = 1e-5
# Fraction of the samples' largest singular value: along a direction with a smaller one the scale can't be recovered.
# Its cube bounds |det| of the map, as a fraction of its largest singular value cubed: below, it counts as singular.
_FLAT = 1e-5


def sample_points(mesh):
    """The sample positions as hexadecimal text, for space_change()."""
    return _samples(mesh).tobytes().hex()


def _samples(mesh):
    positions = mesh_data.positions(mesh)
    return positions[np.linspace(0, len(positions) - 1, min(_SAMPLES, len(positions))).astype(np.intp)] + 0  # −0 is 0


def space_change(mesh, stored):
    """(4, 4): the affine map from the positions in stored, of sample_points(), to the present ones. None where that is
    the identity up to rounding, where the vertices were edited, or where stored is unreadable or too flat to tell
    it."""
    try:
        before = np.frombuffer(bytes.fromhex(stored), np.float32).reshape(-1, 3).astype(np.float64)
    except (TypeError, ValueError):  # the file was modified by something else
        return None
    after = _samples(mesh).astype(np.float64)
    if not len(before) or len(before) != len(after) or not (np.isfinite(before).all() and np.isfinite(after).all()):
        return None
    found = _affine(before, after)
    if found is None:
        return None
    # Rounding errors grow with the distance from the origin, before and after. 1e-6: some 10 float32 epsilons.
    linear = np.abs(found[:3, :3]).sum(axis=1).max()
    rounded = 1e-6 * (np.abs(after).max() + linear * np.abs(before).max())
    allowed = _EXACT * np.ptp(after, axis=0).max() + rounded
    if np.abs(before @ found[:3, :3].T + found[:3, 3] - after).max() > allowed:
        return None
    return None if np.abs(before - after).max() <= allowed else found


def _affine(before, after):
    """(4, 4): the least-squares affine map; None where the points are collinear or the map is singular."""
    middle, image_middle = before.mean(axis=0), after.mean(axis=0)
    _, extents, axes = np.linalg.svd(before - middle, full_matrices=False)
    if len(extents) < 3 or extents[1] <= _FLAT * extents[0]:
        return None
    known = 3 if extents[2] > _FLAT * extents[0] else 2
    # In principal axes. For planar points the image of the normal is not determined: it is taken as the normal of the
    # image plane, scaled by the square root of the change of area in the plane.
    images = np.linalg.lstsq((before - middle) @ axes[:known].T, after - image_middle, rcond=None)[0]
    if known == 2:
        normal = np.cross(*images)
        size = np.linalg.norm(normal)
        images = np.vstack([images, np.linalg.det(axes) * normal / np.sqrt(size or 1.0)])
    result = np.eye(4)
    result[:3, :3] = images.T @ axes
    result[:3, 3] = image_middle - result[:3, :3] @ middle
    largest = np.linalg.norm(result[:3, :3], 2)
    return result if abs(np.linalg.det(result[:3, :3])) > (_FLAT * largest) ** 3 else None


def moved_with_space(change, before, now):
    """Whether empties moved with the vertices by change, as after Set Origin, or stayed where they were in the object's
    space, as where all vertices were moved in Edit Mode. before, now: (k, 4, 4) transforms in the object's space."""
    return np.linalg.norm(now - change @ before) < np.linalg.norm(now - before)


def carry(ob, change):
    """Transforms everything stored in the object's space by change, (4, 4) of space_change(), and takes new sample
    points."""
    settings, back = ob.detail_deform, np.linalg.inv(change)
    for handle in settings.handles:
        if handle.mirrors or handle.symmetric:
            space = np.array(handle.mirror_space, np.float64).reshape(4, 4)
            handle.mirror_space = (change @ space if space.any() else change).ravel().tolist()
        for name in ('rest_matrix', 'home_matrix'):
            transform = np.array(getattr(handle, name), np.float64).reshape(4, 4)
            if transform.any():
                # For a handle that mirrors another it is a motion, not a transform: conjugated.
                setattr(handle, name, (change @ transform @ (back if handle.mirrors else np.eye(4))).ravel().tolist())
        if any(handle.pose_matrix):
            handle.pose_matrix = (change @ handle_transforms.pose_matrix_of(handle) @ back).ravel().tolist()
    if any(settings.base_rest_matrix):
        transform = np.array(settings.base_rest_matrix, np.float64).reshape(4, 4)
        settings.base_rest_matrix = (change @ transform).ravel().tolist()
    if settings.base_rest_mesh:
        positions = mesh_data.positions(settings.base_rest_mesh) @ change[:3, :3].T + change[:3, 3]
        if settings.base_rest_mesh.users > 1:  # shared with a copy of the object
            settings.base_rest_mesh = settings.base_rest_mesh.copy()
        settings.base_rest_mesh.vertices.foreach_set('co', positions.astype(np.float32).ravel())
    for name in (DISPLAYED_OFFSETS, PREVIOUS_OFFSETS, SHAPE_KEY_OFFSETS):
        if offset_attribute.find(ob.data, name) is not None:
            vectors = offset_attribute.read(ob.data, name) @ change[:3, :3].T
            offset_attribute.put(ob.data, name, vectors.astype(np.float32).ravel())
    ob.data.update_tag()
    settings.bound_points = sample_points(ob.data)


def transforms(ob, depsgraph):
    """(k, 4, 4) float64: the present transforms, in the object's space, of the base object or of the empties of the
    enabled handles. Raises MeshProblem."""
    if ob.detail_deform.base == 'OBJECT':
        return outside_base.transform(ob, depsgraph)[None]
    return handle_transforms.transforms_of(ob, with_empties(ob.detail_deform), depsgraph)


def rest_transforms(settings):
    """(k, 4, 4) float64: the rest transforms of the same."""
    if settings.base == 'OBJECT':
        return np.array(settings.base_rest_matrix, np.float64).reshape(1, 4, 4)
    return np.array([handle_rests.rest_transform(handle) for handle in with_empties(settings)])
