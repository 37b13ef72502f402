# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds poses that lack an example: the examples reconstruct each pose from its handles alone, and the result is
compared with the pose."""

import contextlib
import uuid
from typing import NamedTuple

import bpy
import numpy as np

from .. import session
from ..follow import binding, handle_follower, lifecycle, roles, update_options, written_offsets
from ..library import native
from ..scene import posers, start
from ..scene.mesh_data import MeshProblem
from ..scene.subject import Subject
from . import pose_frames, posed_examples
from .pose_samples import Samples, size

MOST = 10  # poses that are listed
_MIN_RMS = 1e-3  # root mean square error of a listed pose at least, as a fraction of the mesh's size
_FIRST_PASS = 0.8  # fraction of the progress that is the first pass, over all poses; the second is over the chosen ones

# {mark of a list's row: (n,) float32}: a mark stays the same when the object or the row is renamed
_errors = session.kept({}, session.Until.LOADED)


class PoseError(NamedTuple):
    """Errors of a reconstructed pose, as fractions of the mesh's size. usual: the root mean square."""
    pose: pose_frames.Pose
    mean: float
    largest: float
    rms: float


def find(context, ob, poses):
    """Generator: yields the fraction done and returns ([PoseError] of all poses, {index of a pose: (n,) errors}). The
    latter has the poses that deserve an example, the worst first. A pose that is nearer to one of these than its own
    error is left out, as that example would serve it, too. Raises MeshProblem."""
    check(ob)
    lifecycle.wait(ob, context.evaluated_depsgraph_get())
    if ob.detail_deform.stale or ob.detail_deform.problem:
        raise MeshProblem(ob.detail_deform.stale or ob.detail_deform.problem)
    by_handles, samples, found = _ByHandles(ob), Samples(ob, len(poses)), []
    whole = size(ob) or 1.0
    with contextlib.closing(pose_frames.walk(context, ob, poses)) as walk:
        for pose, positions in zip(poses, walk):
            samples.add(positions)
            errors = by_handles.errors(positions) / whole
            found.append(PoseError(pose, errors.mean(), errors.max(), np.sqrt(np.square(errors).mean())))
            yield _FIRST_PASS * len(found) / len(poses)
    chosen, of_each = _distinct(samples, found, whole), {}
    with contextlib.closing(pose_frames.walk(context, ob, [poses[number] for number in chosen])) as walk:
        for number, positions in zip(chosen, walk):
            of_each[number] = by_handles.on_all_vertices(by_handles.errors(positions) / whole)
            yield _FIRST_PASS + (1 - _FIRST_PASS) * len(of_each) / len(chosen)
    return found, of_each


def check(ob):
    """Raises MeshProblem unless the object is bound with the method Examples and has modifiers that pose it."""
    settings = ob.detail_deform
    if settings.method != 'EXAMPLES' or settings.base != 'COMPUTED':
        raise MeshProblem("Only handles that mix examples can lack one: set Method to Examples and Base to Computed.")
    if not settings.signature:
        raise MeshProblem(f"'{ob.name}' is not bound: press Bind first.")
    posers.of(ob)


def _distinct(samples, found, whole):
    chosen, served = [], np.zeros(len(found), bool)
    for number in sorted(range(len(found)), key=lambda k: -found[k].rms):
        if len(chosen) == MOST or found[number].rms < _MIN_RMS:
            break
        if not served[number]:
            chosen.append(number)
            served |= samples.distances(number) / whole < [missed.rms for missed in found]
    return chosen


class _ByHandles:
    """Reconstructs poses from the examples and the motions of the handles."""

    def __init__(self, ob):
        subject, settings = Subject(ob), ob.detail_deform
        self._subject, self._deformer = subject, handle_follower.cache.find(settings.signature).made
        of_all = roles.of(subject).of_all
        self._parts = [np.flatnonzero(of_all == number) for number in range(len(subject.pieces.owner))]
        self._free, self._is_free = subject.pieces.of_each(subject.are_free), of_all == native.ROLE_FREE
        arguments = update_options.arguments(settings)
        arguments.pop('example_weights', None)
        self._update_arguments = handle_follower.with_free(update_options.quick(arguments), subject)
        if self._deformer.fades:
            self._update_arguments['soft_border'] = update_options.soft_border(settings)
        self._bound, self._rest = start.shape(ob).astype(np.float64), start.undeformed_shape(ob)

    def errors(self, positions):
        """(k,) distances of the free vertices, as reconstructed, from a pose. positions: (n, 3), the pose."""
        motions = np.array([motion[:3] for motion in start.rigid_motions_to(self._subject.ob, self._parts, positions)])
        for number in np.flatnonzero(self._free):  # free handles: translations only
            part = self._parts[number]
            motions[number] = np.eye(4)[:3]
            motions[number, :, 3] = positions[part].mean(axis=0) - self._bound[part].mean(axis=0)
        motions = self._subject.space.motions(motions)
        found = written_offsets.offsets(self._subject, self._deformer.offsets(motions, **self._update_arguments),
                                        self._deformer.fades)
        return np.linalg.norm(self._rest + found.reshape(-1, 3) - positions, axis=1)[self._is_free]

    def on_all_vertices(self, errors):
        """(n,) float32: the errors of the free vertices, and 0 for all others."""
        result = np.zeros(len(self._is_free), np.float32)
        result[self._is_free] = errors
        return result


def errors_of(ob):
    """(n,) float32: the errors of the list's active pose; None if unknown, as after loading a file."""
    settings = ob.detail_deform
    if not 0 <= settings.missing_index < len(settings.missing_examples):
        return None
    found = _errors.get(settings.missing_examples[settings.missing_index].mark)
    return found if found is not None and len(found) == len(ob.data.vertices) else None


def is_old(ob):
    """Whether the mesh was bound to other examples or handles since the list was made."""
    return ob.detail_deform.missing_of != ob.detail_deform.signature


def store_list(ob, found, of_each):
    """Replaces the object's list by the result of find()."""
    rows = ob.detail_deform.missing_examples
    for row in rows:
        _errors.pop(row.mark, None)
    rows.clear()
    for number, errors in of_each.items():
        missed, row = found[number], rows.add()
        row.mark = uuid.uuid4().hex
        _errors[row.mark] = errors
        row.name, row.frame, row.action = missed.pose
        row.mean_error, row.largest_error = 100 * missed.mean, 100 * missed.largest
    ob.detail_deform.missing_index = 0
    ob.detail_deform.missing_of = ob.detail_deform.signature


def add(context, ob, index):
    """Makes an example of a pose on the list, removes the pose from the list and re-binds. Returns the example's name.
    Raises MeshProblem."""
    rows = ob.detail_deform.missing_examples
    row = rows[index]
    pose = pose_frames.Pose(row.name, row.frame, row.action)
    with contextlib.closing(pose_frames.walk(context, ob, [pose])) as walk:
        positions = next(walk)
    name = posed_examples.make(ob, pose.name, positions)
    _errors.pop(row.mark, None)
    rows.remove(index)
    ob.detail_deform.missing_of = ""
    ob.detail_deform.missing_index = max(0, min(index, len(rows) - 1))
    if ob.detail_deform.signature:
        binding.bind(ob, context.evaluated_depsgraph_get(), wait=bpy.app.background, keep_rest=True)
    return name
