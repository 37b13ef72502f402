# SPDX-License-Identifier: GPL-3.0-or-later
"""Curve objects that move handles: what Blender evaluates of them, with hooks, shape keys and constraints, and the rest
that is stored at Bind."""

from typing import Any, NamedTuple

import bpy
import numpy as np

from .curve_motion import Samples
from .mesh_data import MeshProblem

_OF_BEZIER = {'co': 3, 'handle_left': 3, 'handle_right': 3, 'tilt': 1, 'radius': 1}
_OF_POINT = {'co': 4, 'tilt': 1, 'radius': 1}


class RestCurve(NamedTuple):
    """A curve as it was at Bind, in its object's space."""
    samples: Samples
    at: Any  # (k,) float32: parameters of its stations
    controls: Any  # (c,) float32: values of its control points, to be put back


def has_curve(handle):
    """Whether a curve moves the handle's vertices, each part of them by the part of the curve that is beside it."""
    return handle.target is not None and handle.target.type == 'CURVE'


def read(handle, depsgraph):
    """The Samples of the handle's curve, in its object's space. Raises MeshProblem naming the handle."""
    curve, what = handle.target, f"Handle '{handle.name}': its curve '{handle.target.name}'"
    evaluated = curve.evaluated_get(depsgraph)
    splines = evaluated.data.splines
    if len(splines) != 1:
        raise MeshProblem(f"{what} has {len(splines)} splines: leave one, along which its vertices follow.")
    mesh = evaluated.to_mesh()
    try:
        points = np.empty(3 * len(mesh.vertices) if mesh else 0, np.float32)
        if mesh:
            mesh.vertices.foreach_get('co', points)
        has_faces = bool(mesh and mesh.polygons)
    finally:
        evaluated.to_mesh_clear()
    points = points.reshape(-1, 3).astype(np.float64)
    if has_faces:
        raise MeshProblem(f"{what} has a thickness: set Extrude, Depth and Bevel (Data > Geometry) to none, and remove "
                          "modifiers that make faces.")
    if len(points) < 2 or not np.ptp(points, axis=0).any():
        raise MeshProblem(f"{what} has no length: give it at least two points at different places.")
    if not np.isfinite(points).all():
        raise MeshProblem(f"{what} has a point whose place is not a finite number: look at what moves it.")
    tilts, radii = _along(splines[0], len(points))
    return Samples(points, tilts, radii, splines[0].use_cyclic_u)


def _along(spline, count):
    """(tilts, radii) at the evaluated points, linear between control points."""
    points = _points(spline)
    values = np.array([(point.tilt, point.radius) for point in points], np.float64)
    numbers = np.arange(len(points) + spline.use_cyclic_u)
    ends = numbers * (count - (not spline.use_cyclic_u)) / max(len(numbers) - 1, 1)
    if spline.type == 'BEZIER':
        following = list(points[1:]) + [points[0]] * spline.use_cyclic_u
        straight = np.array([a.handle_right_type == b.handle_left_type == 'VECTOR' for a, b in zip(points, following)])
        own = np.append(0, np.cumsum(np.where(straight, 1, spline.resolution_u)))
        if own[-1] + (not spline.use_cyclic_u) == count:  # else a modifier changed the number
            ends = own
    values = values[numbers % len(points)]
    return tuple(np.interp(np.arange(count), ends, values[:, k]) for k in range(2))


def _points(spline):
    return spline.bezier_points if spline.type == 'BEZIER' else spline.points


def controls(curve):
    """(c,) float32: the values of all control points of a curve object."""
    found = [np.empty(0, np.float32)]
    for points, name, size in _channels(curve):
        values = np.empty(size * len(points), np.float32)
        points.foreach_get(name, values)
        found.append(values)
    return np.concatenate(found)


def put_back(curve, values):
    """Sets the control points to values of controls(). Does nothing if it has others now."""
    channels = list(_channels(curve))
    ends = np.cumsum([size * len(points) for points, _, size in channels])
    if len(ends) and ends[-1] == len(values):
        for (points, name, _), part in zip(channels, np.split(values, ends[:-1])):
            points.foreach_set(name, part)
        curve.data.update_tag()


def _channels(curve):
    """Yields (points, name, size) of what control points have."""
    for spline in curve.data.splines:
        for name, size in (_OF_BEZIER if spline.type == 'BEZIER' else _OF_POINT).items():
            yield _points(spline), name, size


def made_of(samples, name):
    """A new curve data-block through these samples."""
    curve = bpy.data.curves.new(name, 'CURVE')
    curve.dimensions = '3D'
    spline = curve.splines.new('POLY')
    spline.points.add(len(samples.points) - 1)
    spline.points.foreach_set('co', np.column_stack([samples.points, np.ones(len(samples.points))]).ravel())
    spline.points.foreach_set('tilt', np.ascontiguousarray(samples.tilts))
    spline.points.foreach_set('radius', np.ascontiguousarray(samples.radii))
    spline.use_cyclic_u = samples.is_cyclic
    return curve


def packed(rest):
    """A text, for unpacked()."""
    values = np.column_stack([rest.samples.points, rest.samples.tilts, rest.samples.radii])
    arrays = (values, rest.at, rest.controls)
    return ' '.join([str(int(rest.samples.is_cyclic)), *(np.asarray(each, np.float32).tobytes().hex() or '-'
                                                         for each in arrays)])


def unpacked(text):
    """The RestCurve; None of '' or a text that something else has written."""
    try:
        is_cyclic, *parts = text.split(' ')
        values, at, of_controls = (np.frombuffer(bytes.fromhex(part.strip('-')), np.float32) for part in parts)
        values = values.reshape(-1, 5).astype(np.float64)
    except ValueError:
        return None
    if len(values) < 2 or not (len(at) and np.isfinite(values).all() and np.isfinite(at).all()):
        return None
    at = np.clip(at.astype(np.float64), 0, len(values) - (is_cyclic != '1'))
    return RestCurve(Samples(values[:, :3], values[:, 3], values[:, 4], is_cyclic == '1'), at, of_controls)
