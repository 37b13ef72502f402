# SPDX-License-Identifier: GPL-3.0-or-later
"""How a curve moves what lies along it: an affine motion for each of its stations, short pieces of its length.

The rotation R of a station turns the tangent at rest into the present one. Along the curve it changes as little as
that allows, as parallel transport does, and the change of the tilt turns it about the tangent. Across the curve the
motion scales by the ratio of the radii, along it by the curve's stretch, so neighbouring stations agree to first
order: between them a bend is off by κ h² / 8, with h a station's length.

Points are (n, 3) float64, in one space whose lengths are those of the scene.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from .rotations import nearest_rotations

# Stations of a curve at most. A limb that is bent by half a turn is off by κ h² / 8 = π / (8 · 64²) = 1e-4 of its
# length between two of them. An update costs the library little more than with five handles (native/bench/RESULTS.md,
# Many handles).
MOST_STATIONS = 64
_AT_ONCE = 640_000  # distances: 5 MB for each of a few arrays
# Fraction of a station by which borders are shifted: rings of a regular mesh lie on equal parts of its length, where
# rounding, which differs from processor to processor, would decide. Far above that, and far below a station.
_SHIFT = 1e-3
# Fraction of the curve's size squared: distances that differ by less count as equal, for the same reason.
_EQUAL = 1e-9
_NO_RADIUS = 1e-6  # of Blender's radii, which are 1 by default: where there was none, there is no ratio to it


class Samples(NamedTuple):
    """A curve as a sequence of points."""
    points: Any  # (n, 3)
    tilts: Any  # (n,) radians
    radii: Any  # (n,)
    is_cyclic: bool  # the last point is followed by the first
    frames: Any = None  # (n, 3, 3) rotations that lie along it, as those of bones; None: parallel transport is used


def parameters(samples, positions):
    """(m,): for each position the parameter of the nearest point of the curve: a sample's number and the fraction of
    the way to the next one."""
    begins, ways = _segments(samples)
    middle = begins.mean(axis=0)
    begins, positions = begins - middle, positions - middle
    squared = np.maximum((ways * ways).sum(axis=1), np.finfo(float).tiny)
    result = np.empty(len(positions))
    at_once, equal = max(1, _AT_ONCE // len(ways)), _EQUAL * (begins * begins).sum(axis=1).max()
    for first in range(0, len(positions), at_once):
        points = positions[first:first + at_once]
        along = points @ ways.T - (begins * ways).sum(axis=1)
        fractions = np.clip(along / squared, 0, 1)
        # |x - b - f w|², without |x|², which is the same for all segments.
        distances = (begins * begins).sum(axis=1) - 2 * points @ begins.T
        distances += fractions * (fractions * squared - 2 * along)
        nearest = (distances <= distances.min(axis=1, keepdims=True) + equal).argmax(axis=1)
        result[first:first + len(points)] = nearest + fractions[np.arange(len(points)), nearest]
    return result


def _segments(samples):
    """(points, ways to the next ones)"""
    points = np.asarray(samples.points, np.float64)
    if samples.is_cyclic:
        return points, np.roll(points, -1, axis=0) - points
    return points[:-1], np.diff(points, axis=0)


def places(samples, found):
    """(m, 3): the points of the polygon at these parameters."""
    begins, ways = _segments(samples)
    whole = np.minimum(found.astype(int), len(ways) - 1)
    return begins[whole] + (found - whole)[:, None] * ways[whole]


def length(samples):
    return _lengths(_segments(samples)[1]).sum()


def parts(samples, found, count):
    """(m,) int: which of count equal parts of the curve's length each of these parameters is in."""
    _, ways = _segments(samples)
    ends = np.append(0, np.cumsum(np.linalg.norm(ways, axis=1)))
    whole = np.minimum(found.astype(int), len(ways) - 1)
    along = ends[whole] + (found - whole) * (ends[whole + 1] - ends[whole])
    return np.minimum((along * (count / max(ends[-1], np.finfo(float).tiny)) + _SHIFT).astype(int), count - 1)


def stations(samples, found, count):
    """(k,): the parameters of the stations, those of the parts that hold any of these parameters: the mean in each."""
    _, numbers = np.unique(parts(samples, found, count), return_inverse=True)
    return np.bincount(numbers, found) / np.bincount(numbers)


def motions(rest, now, at):
    """((k, 4, 4), (k, 3, 3)): the affine motion of each station, and its rotation. at: (k,) their parameters.
    An open curve begins without a rotation but for what turns its tangent, a closed one with the rotation that fits all
    of its points best."""
    tangents, present = _tangents(rest), _tangents(now)
    rotations = _rotations(rest, now, _unit(tangents), _unit(present))
    middles, derivatives, begins, fractions = _at(rest, tangents, at)
    moved, moved_derivatives, _, _ = _at(now, present, at)
    rotations = _between(rotations, begins, fractions)
    along = _unit(derivatives)
    stretch = _lengths(moved_derivatives) / np.maximum(_lengths(derivatives), np.finfo(float).tiny)
    before, radii = (_scalars(each.radii, begins, fractions) for each in (rest, now))
    radii = np.where(before > _NO_RADIUS, radii / np.maximum(before, _NO_RADIUS), 1)
    scales = radii[:, None, None] * np.eye(3) + (stretch - radii)[:, None, None] * along[:, :, None] * along[:, None]
    result = np.zeros((len(at), 4, 4))
    result[:, :3, :3], result[:, 3, 3] = rotations @ scales, 1
    result[:, :3, 3] = moved - np.einsum('kij,kj->ki', result[:, :3, :3], middles)
    return result, rotations


def _segment_lengths(samples):
    """(s,): at least 1e-9 of the whole, as they are divided by."""
    lengths = _lengths(_segments(samples)[1])
    return np.maximum(lengths, max(1e-9 * lengths.sum(), np.finfo(float).tiny))


def _tangents(samples):
    """(n, 3): derivatives by the length: of the parabola through three points at each, whose distances may differ."""
    lengths = _segment_lengths(samples)[:, None]
    units = _segments(samples)[1] / lengths
    if samples.is_cyclic:
        before, first = np.roll(units, 1, axis=0), np.roll(lengths, 1, axis=0)
        return (before * lengths + units * first) / (first + lengths)
    if len(units) == 1:
        return np.repeat(units, 2, axis=0)
    inside = (units[:-1] * lengths[1:] + units[1:] * lengths[:-1]) / (lengths[:-1] + lengths[1:])
    begin = units[:1] + (units[:1] - units[1:2]) * lengths[0] / (lengths[0] + lengths[1])
    end = units[-1:] + (units[-1:] - units[-2:-1]) * lengths[-1] / (lengths[-1] + lengths[-2])
    return np.concatenate([begin, inside, end])


def _lengths(vectors):
    return np.linalg.norm(vectors, axis=-1)


def _unit(vectors):
    """Unit vectors; Z in place of zero."""
    lengths = _lengths(vectors)[..., None]
    return np.where(lengths > 0, vectors / np.where(lengths > 0, lengths, 1), (0.0, 0.0, 1.0))


def _rotations(rest, now, before, after):
    """(n, 3, 3): R at each sample. before, after: unit tangents."""
    if rest.frames is not None and now.frames is not None:
        turned = now.frames @ np.swapaxes(rest.frames, 1, 2)
        return _shortest(np.einsum('kij,kj->ki', turned, before), after) @ turned
    first = _best_rotation(rest, now) if rest.is_cyclic else np.eye(3)
    first = _shortest((first @ before[0])[None], after[:1])[0] @ first
    result = _transports(after) @ first @ np.swapaxes(_transports(before), 1, 2)
    angles = np.asarray(now.tilts, np.float64) - rest.tilts
    if rest.is_cyclic:
        # Once around, R differs from the first by a twist, of which each sample takes its share.
        last = _shortest(after[-1:], after[:1])[0] @ result[-1] @ _shortest(before[:1], before[-1:])[0]
        twist = _vectors((last @ first.T)[None])[0] @ after[0]
        ends = np.cumsum(_lengths(np.diff(rest.points, axis=0)))
        whole = ends[-1] + _lengths(rest.points[0] - rest.points[-1])
        angles = angles - twist * np.append(0, ends) / max(whole, np.finfo(float).tiny)
    return _about(after, angles) @ result


def _best_rotation(rest, now):
    """(3, 3): the rotation that brings the points nearest to the present ones."""
    before, after = (np.asarray(each.points, np.float64) - each.points.mean(axis=0) for each in (rest, now))
    return nearest_rotations(after.T @ before)


def _transports(tangents):
    """(n, 3, 3): the parallel transport from the first tangent to each."""
    result = np.concatenate([np.eye(3)[None], _shortest(tangents[:-1], tangents[1:])])
    done = 1  # each entry is the product of so many steps
    while done < len(result):
        result[done:] = result[done:] @ result[:-done]
        done *= 2
    return result


def _shortest(before, after):
    """(n, 3, 3): the rotations by the least angle that turn unit vectors into others."""
    x, y, z = np.cross(before, after).T
    zero = np.zeros_like(x)
    skews = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    cosines = np.einsum('ki,ki->k', before, after)
    result = np.eye(3) + skews + skews @ skews / np.maximum(1 + cosines, 1e-12)[:, None, None]
    for number in np.flatnonzero(cosines < -1 + 1e-12):  # by half a turn, about any axis across
        across = _unit(np.cross(before[number], np.eye(3)[np.abs(before[number]).argmin()]))
        result[number] = 2 * np.outer(across, across) - np.eye(3)
    return result


def halfway(rotations):
    """(n - 1, 3, 3): the rotations halfway between successive ones."""
    return _between(rotations, np.arange(len(rotations) - 1), np.full(len(rotations) - 1, 0.5))


def _about(axes, angles):
    """(n, 3, 3): rotations about unit axes."""
    x, y, z = np.moveaxis(axes, -1, 0)
    zero = np.zeros_like(x)
    skews = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    sines, versines = np.sin(angles)[:, None, None], (1 - np.cos(angles))[:, None, None]
    return np.eye(3) + sines * skews + versines * (skews @ skews)


def _vectors(rotations):
    """(n, 3): rotation vectors of at most half a turn."""
    trace = np.trace(rotations, axis1=1, axis2=2)
    axes = np.stack([rotations[:, 2, 1] - rotations[:, 1, 2], rotations[:, 0, 2] - rotations[:, 2, 0],
                     rotations[:, 1, 0] - rotations[:, 0, 1]], axis=1)  # times 2 sin
    lengths = _lengths(axes)
    angles = np.arctan2(lengths, trace - 1)
    for number in np.flatnonzero((lengths < 1e-6) & (trace < 0)):  # near half a turn: R + 1 has the axis in its columns
        columns = rotations[number] + np.eye(3)
        axis = columns[:, np.abs(np.diag(columns)).argmax()]
        axes[number], lengths[number] = axis * (1.0 if axis @ axes[number] >= 0 else -1.0), np.linalg.norm(axis)
    return axes * np.where(lengths > 0, angles / np.where(lengths > 0, lengths, 1), 0)[:, None]


def _between(rotations, begins, fractions):
    """(k, 3, 3): rotations between samples."""
    following = rotations[(begins + 1) % len(rotations)]
    steps = _vectors(following @ np.swapaxes(rotations[begins], 1, 2)) * fractions[:, None]
    return _about(_unit(steps), _lengths(steps)) @ rotations[begins]


def _scalars(values, begins, fractions):
    values = np.asarray(values, np.float64)
    return values[begins] * (1 - fractions) + values[(begins + 1) % len(values)] * fractions


def _at(samples, tangents, at):
    """(places, derivatives, samples before, fractions): at these parameters, by Hermite's cubic."""
    count = len(samples.points)
    begins = np.minimum(at.astype(int), count - 1 if samples.is_cyclic else count - 2)
    t = (at - begins)[:, None]
    p, q = samples.points[begins], samples.points[(begins + 1) % count]
    scale = _segment_lengths(samples)[begins][:, None]
    u, v = scale * tangents[begins], scale * tangents[(begins + 1) % count]
    places = (1 + 2 * t) * (1 - t)**2 * p + t * (1 - t)**2 * u + t**2 * (3 - 2 * t) * q + t**2 * (t - 1) * v
    derivatives = 6 * t * (t - 1) * (p - q) + (1 - t) * (1 - 3 * t) * u + t * (3 * t - 2) * v
    return places, derivatives, begins, t[:, 0]


def turns(rotations, begin):
    """(k, 3): the rotation vectors of successive stations: of those of its rotation each is the one nearest to its
    predecessor, and the first that nearest to begin, so they have whole turns."""
    vectors, before = _vectors(rotations), tuple(begin)
    result = []
    for x, y, z in vectors.tolist():
        angle = math.sqrt(x * x + y * y + z * z)
        if angle < 1e-6:  # no rotation, or whole turns about any axis
            x, y, z = before
        size = math.sqrt(x * x + y * y + z * z) or 1.0
        angle = 0.0 if angle < 1e-6 else angle
        along = (before[0] * x + before[1] * y + before[2] * z) / size
        factor = (angle + math.tau * round((along - angle) / math.tau)) / size
        before = (x * factor, y * factor, z * factor)
        result.append(before)
    return np.array(result).reshape(-1, 3)
