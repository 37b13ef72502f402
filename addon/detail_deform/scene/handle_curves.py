# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves and chains of bones that move handles: what Blender evaluates of them, with hooks, shape keys and constraints,
and the rest that is stored at Bind."""

from typing import Any, NamedTuple

import bpy
import numpy as np
from mathutils import Matrix

from . import curve_motion
from .curve_motion import Samples
from .mesh_data import MeshProblem
from .rotations import nearest_rotations

_OF_BEZIER = {'co': 3, 'handle_left': 3, 'handle_right': 3, 'tilt': 1, 'radius': 1}
_OF_POINT = {'co': 4, 'tilt': 1, 'radius': 1}
# Of each bone; even. A joint is rounded over two of them, an eighth of each bone.
_SAMPLES_OF_BONE = 8
_BONES = 'bones'


class RestCurve(NamedTuple):
    """A curve as it was at Bind, in its object's space."""
    samples: Samples
    count: int  # of equal parts of its length, those of which that hold vertices are stations
    at: Any  # (k,) float32: parameters of its stations
    controls: Any  # (c,) float32: values of its control points, to be put back


def has_curve(handle):
    """Whether a curve or a chain of bones moves the handle's vertices, each part of them by what of it is beside."""
    return not handle.mirrors and handle.target is not None and handle.target.type in {'CURVE', 'ARMATURE'}


def is_new(handle):
    """Whether the handle has got a curve since it was bound."""
    return has_curve(handle) and not handle.rest_curve


def reads(handle):
    """Yields what Blender has to evaluate for the handle, for dependency.depend_on(): (variable type, object, bone)."""
    bone = handle.last_bone if handle.target.type == 'ARMATURE' else ""
    yield 'TRANSFORMS', handle.target, bone
    if handle.target.type == 'CURVE':
        yield 'SINGLE_PROP', handle.target, ""


def read(handle, ob, depsgraph):
    """The Samples of the handle's curve or bones, in its object's space. ob: the mesh object. Raises MeshProblem naming
    the handle."""
    return _read_bones(handle, ob, depsgraph) if handle.target.type == 'ARMATURE' else _read_curve(handle, depsgraph)


def _chain(handle, bones):
    """[bone]: those from First Bone to Last Bone, of these. Raises MeshProblem."""
    what, found = f"Handle '{handle.name}'", []
    for name in filter(None, (handle.first_bone, handle.last_bone)):
        if name not in bones:
            raise MeshProblem(f"{what}: '{handle.target.name}' has no bone '{name}': choose another one.")
    if not handle.last_bone:
        raise MeshProblem(f"{what} follows bones of '{handle.target.name}': choose First Bone and Last Bone (Handles).")
    bone, first = bones[handle.last_bone], handle.first_bone or handle.last_bone
    while bone is not None:
        found.insert(0, bone)
        if bone.name == first:
            return found
        bone = bone.parent
    raise MeshProblem(f"{what}: bone '{handle.last_bone}' isn't a child, or child of a child, of '{first}': exchange "
                      "First Bone and Last Bone, or choose those of one chain.")


def _read_bones(handle, ob, depsgraph):
    chain = _chain(handle, _pose_bones(handle.target.evaluated_get(depsgraph)))
    if any(modifier.type == 'ARMATURE' and modifier.object == handle.target and modifier.show_viewport
           for modifier in ob.modifiers):
        raise MeshProblem(f"Handle '{handle.name}': the armature '{handle.target.name}' poses this mesh by a modifier, "
                          "too, so the bones would move it twice: remove that modifier, or take an empty on a bone.")
    points, frames, radii = [], [], []
    along = np.arange(_SAMPLES_OF_BONE)[:, None] / _SAMPLES_OF_BONE
    for bone, following in zip(chain, [*chain[1:], None]):
        matrix = np.array(bone.matrix, np.float64)
        if not (np.isfinite(matrix).all() and np.isfinite(bone.tail).all()):
            raise MeshProblem(f"Handle '{handle.name}': a bone of '{handle.target.name}' has a place that is not a "
                              "finite number: look at what moves it.")
        matrix = matrix[:3, :3]
        end = following.head if following else bone.tail  # a chain may have gaps
        points.append((1 - along) * np.array(bone.head) + along * np.array(end))
        frames += [nearest_rotations(matrix)] * _SAMPLES_OF_BONE
        radii += [np.sqrt(np.linalg.norm(matrix[:, 0]) * np.linalg.norm(matrix[:, 2]))] * _SAMPLES_OF_BONE
    points, frames = np.concatenate([*points, [chain[-1].tail]]), np.array([*frames, frames[-1]])
    joints = np.arange(_SAMPLES_OF_BONE, len(points) - 1, _SAMPLES_OF_BONE)
    if len(joints):
        frames[joints] = curve_motion.halfway(frames[_SAMPLES_OF_BONE // 2::_SAMPLES_OF_BONE])
    return Samples(points, np.zeros(len(points)), np.array([*radii, radii[-1]]), False, frames)


def _pose_bones(armature):
    return armature.pose.bones if armature.pose else {}  # a new one has no pose yet


def _read_curve(handle, depsgraph):
    curve, what = handle.target, f"Handle '{handle.name}': its curve '{handle.target.name}'"
    evaluated = curve.evaluated_get(depsgraph)
    splines = evaluated.data.splines
    if len(splines) != 1:
        raise MeshProblem(f"{what} has {len(splines)} splines: leave one, along which its vertices follow.")
    in_renders = evaluated.data.render_resolution_u
    if splines[0].type != 'POLY' and in_renders not in {0, splines[0].resolution_u}:
        raise MeshProblem(f"{what} has another resolution in renders, so its points there are others: set Render U "
                          "(Data > Shape) to 0.")
    mesh = evaluated.to_mesh()
    try:
        points = np.empty(3 * len(mesh.vertices) if mesh else 0, np.float32)
        if mesh:
            mesh.vertices.foreach_get('co', points)
        has_faces = bool(mesh and mesh.polygons)
    finally:
        evaluated.to_mesh_clear()
    points = points.reshape(-1, 3).astype(np.float64)
    if mesh is None:
        raise MeshProblem(f"{what} isn't evaluated, as it is disabled in the viewport: enable it (it may be hidden).")
    if has_faces:
        raise MeshProblem(f"{what} has a thickness: set Extrude, Depth and Bevel (Data > Geometry) to none, and remove "
                          "modifiers that make faces.")
    if len(points) < 2 or not np.ptp(points, axis=0).any():
        raise MeshProblem(f"{what} has no length: give it at least two points at different places.")
    tilts, radii = _along(splines[0], len(points))
    if not all(np.isfinite(each).all() for each in (points, tilts, radii)):
        raise MeshProblem(f"{what} has a point whose place is not a finite number: look at what moves it.")
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


def controls(handle):
    """(c,) float32: the values of all control points of the handle's curve, or the own transforms of its bones."""
    found = [np.empty(0, np.float32)]
    if handle.target.type == 'ARMATURE':
        return np.array([bone.matrix_basis for bone in _chain(handle, _pose_bones(handle.target))], np.float32).ravel()
    for points, name, size in _channels(handle.target):
        values = np.empty(size * len(points), np.float32)
        points.foreach_get(name, values)
        found.append(values)
    return np.concatenate(found)


def put_back(handle, values):
    """Sets them to values of controls(). Does nothing if there are others now, or bones that are gone."""
    curve = handle.target
    if curve.type == 'ARMATURE':
        try:
            chain = _chain(handle, _pose_bones(curve))
        except MeshProblem:
            return
        if len(values) == 16 * len(chain):
            for bone, matrix in zip(chain, values.reshape(-1, 4, 4).tolist()):
                bone.matrix_basis = Matrix(matrix)
        return
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
    if rest.samples.frames is not None:
        values = np.column_stack([values, rest.samples.frames.reshape(-1, 9)])
    arrays = (values, rest.at, rest.controls)
    kind = _BONES if rest.samples.frames is not None else str(int(rest.samples.is_cyclic))
    return ' '.join([kind, str(rest.count), *(np.asarray(each, np.float32).tobytes().hex() or '-'
                                                         for each in arrays)])


def unpacked(text):
    """The RestCurve; None of '' or a text that something else has written."""
    try:
        kind, count, *parts = text.split(' ')
        values, at, of_controls = (np.frombuffer(bytes.fromhex(part.strip('-')), np.float32) for part in parts)
        values, count = values.reshape(-1, 14 if kind == _BONES else 5).astype(np.float64), int(count)
    except ValueError:
        return None
    if len(values) < 2 or not (len(at) and count > 0 and np.isfinite(values).all() and np.isfinite(at).all()):
        return None
    at = np.clip(at.astype(np.float64), 0, len(values) - (kind != '1'))
    frames = values[:, 5:].reshape(-1, 3, 3) if kind == _BONES else None
    return RestCurve(Samples(values[:, :3], values[:, 3], values[:, 4], kind == '1', frames), count, at, of_controls)
