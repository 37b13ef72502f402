# SPDX-License-Identifier: GPL-3.0-or-later
"""The pieces of handles, which are the library's handles: one of a handle with an empty, one for each station of a
handle with a curve.

Roles, motions, turns and pivots have a row for each handle until they are passed to the library; here they get one for
each piece. What the library says of its handles, it says of pieces.
"""

import numpy as np

from . import curve_motion, handle_curves
from .mesh_data import MeshProblem
from .rotations import nearest_rotations


# Stations of all curves together, and of each at least: an update with 271 handles takes 1.5 times that with ten
# (native/bench/RESULTS.md, Many handles). Without either 300 curves would be 19,200 handles.
_MOST_OF_ALL, _FEWEST_STATIONS = 512, 8


class Pieces:
    """Those of these handles, by the rests of their curves."""

    def __init__(self, handles):
        self.rests = {number: rest for number, handle in enumerate(handles)
                      if not handle.mirrors and (rest := handle_curves.unpacked(handle.rest_curve))}
        counts = np.ones(len(handles), int)
        for number, rest in self.rests.items():
            counts[number] = len(rest.at)
        self._first = np.cumsum(counts) - counts
        self.owner = np.repeat(np.arange(len(handles)), counts)  # (p,) number of the handle that each is of

    def of_each(self, values):
        """(p, ...): the row of each piece's handle."""
        return values[self.owner] if self.rests else values

    def of_handles(self, numbers):
        """The numbers of all pieces of these handles."""
        return np.flatnonzero(np.isin(self.owner, numbers))

    def of_vertices(self, roles, subject, positions):
        """(n,): roles with pieces in place of handles. positions: (n, 3) at rest, in the subject's space."""
        if not self.rests:
            return roles
        result = np.where(roles >= 0, self._first[np.maximum(roles, 0)], roles).astype(roles.dtype)
        for number, rest in self.rests.items():
            held = np.flatnonzero(roles == number)
            if len(held):
                samples, found = _along(rest, subject, number, positions[held])
                known = curve_motion.parts(samples, rest.at, rest.count)
                numbers = np.searchsorted(known, curve_motion.parts(samples, found, rest.count))
                result[held] += np.minimum(numbers, len(known) - 1).astype(roles.dtype)
        return result

    def motions(self, subject, transforms, motions, turns, last=None):
        """(motions, turns) of all pieces, (p, 3, 4) and (p, 3), in the subject's space, of those of handles.
        transforms: (h, 4, 4) of local_transforms(). last: the previous result, if there is one, for curves that were
        deleted. Raises MeshProblem."""
        if not self.rests:
            return motions, turns
        of_pieces, turns_of_pieces = motions[self.owner], turns[self.owner]
        for number, rest in self.rests.items():
            mine = slice(self._first[number], self._first[number] + len(rest.at))
            if subject.handles[number].target is None and last is not None and len(last[0]) == len(of_pieces):
                of_pieces[mine], turns_of_pieces[mine] = last[0][mine], last[1][mine]
            if not handle_curves.has_curve(subject.handles[number]):
                continue  # an empty has taken its place
            now = handle_curves.read(subject.handles[number], subject.ob, subject.depsgraph)
            _check(subject.handles[number], rest.samples, now)
            if _are_alike(rest.samples, now):
                continue  # so they move as the curve's object does, without rounding errors
            # Its object moves the curve at rest as a whole; from there the curve goes to its present shape.
            by_object = transforms[number].astype(np.float64)
            along, rotations = curve_motion.motions(_placed(rest.samples, subject, by_object),
                                                    _placed(now, subject, by_object), rest.at)
            of_pieces[mine] = (along @ np.vstack([motions[number], [0, 0, 0, 1]]))[:, :3]
            turns_of_pieces[mine] = curve_motion.turns(
                rotations @ nearest_rotations(motions[number][:, :3]), turns[number])
        return of_pieces, turns_of_pieces


def _along(rest, subject, number, positions):
    """(Samples, parameters): a handle's curve at rest in the subject's space, and where along it positions are."""
    samples = _placed(rest.samples, subject, subject.rests[number])
    return samples, curve_motion.parameters(samples, positions.astype(np.float64))


def _placed(samples, subject, transform):
    """The Samples in the subject's space. transform: (4, 4), of the curve's object in the mesh's local space."""
    linear = subject.space.linear.astype(np.float64) @ transform[:3, :3]
    shift = subject.space.linear.astype(np.float64) @ transform[:3, 3] + subject.space.shift
    frames = samples.frames
    if frames is not None:
        frames = nearest_rotations(linear) @ frames
    return samples._replace(points=samples.points @ linear.T + shift, frames=frames)


def _check(handle, rest, now):
    if (rest.frames is None) != (now.frames is None):
        raise MeshProblem(f"Handle '{handle.name}' followed a curve or bones when it was bound, and "
                          f"'{handle.target.name}' is of the other kind: press Unbind and Bind.")
    if rest.frames is not None and len(rest.points) != len(now.points):
        raise MeshProblem(f"Handle '{handle.name}' follows another number of bones than when it was bound: undo that, "
                          "or press Unbind and Bind.")
    if (len(rest.points), rest.is_cyclic) != (len(now.points), now.is_cyclic):
        raise MeshProblem(f"Handle '{handle.name}': its curve '{handle.target.name}' has {len(now.points)} points "
                          f"along it, {len(rest.points)} when it was bound, as control points, Resolution or kinds of "
                          "handles were changed: undo that, or press Unbind and Bind.")


def _are_alike(rest, now):
    """Whether the curve has its shape of rest, but for rounding to single precision."""
    return all(np.array_equal(np.asarray(a, np.float32), np.asarray(b, np.float32))
               for a, b in zip(rest, now) if a is not None)


def present(subject):
    """{number: Samples} of the handles that have a curve. Raises MeshProblem where one can't be bound."""
    _ = subject.mirror_sources, subject.symmetric
    return {number: handle_curves.read(subject.handles[number], subject.ob, subject.depsgraph) for number in subject.own
            if handle_curves.has_curve(subject.handles[number])}


def store(subject, curves, only_new, roles, positions):
    """Stores the rests of curves, with stations for these roles of vertices, once those of handles are stored.

    curves: of present(). only_new: handles keep the rests of curves that they have. positions: (n, 3) of the shape that
    is bound, in the subject's space."""
    count = int(np.clip(_MOST_OF_ALL / max(len(curves), 1), _FEWEST_STATIONS, curve_motion.MOST_STATIONS))
    for number, handle in enumerate(subject.handles):
        rest = handle_curves.unpacked(handle.rest_curve) if only_new else None
        if rest is None and number in curves:
            rest = handle_curves.RestCurve(curves[number], count, np.zeros(1), handle_curves.controls(handle))
        held = np.flatnonzero(roles == number)
        if rest is None or handle.mirrors or not len(held):
            handle.property_unset('rest_curve')
            continue
        rest = handle_curves.unpacked(handle_curves.packed(rest))  # as it will be read
        samples, found = _along(rest, subject, number, positions[held])
        at = curve_motion.stations(samples, found, rest.count)
        handle.rest_curve = handle_curves.packed(rest._replace(at=at))
