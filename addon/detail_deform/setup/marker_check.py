# SPDX-License-Identifier: GPL-3.0-or-later
"""Detects one misplaced marker, or two exchanged ones, by the distances between markers along both surfaces.

The log ratio of such a distance on the target to that on the source is modelled as a_i + a_j, a term for each end, as
bodies differ by parts, such as necks or legs. A misplaced marker doesn't fit: it is too close to some markers and too
far from others. The removal of one marker, or the exchange of two, that reduces the residual most tells which it is.

Fewer than six markers determine that model too little. Then the shapes are registered without markers: if all other
markers are near their fitted places, one that is far from its own is wrong.
"""

import time

import numpy as np

from ..library import native
from ..scene import mesh_data, proportions
from . import markers

_MIN_MARKERS = 6  # markers for the model; k leave k (k − 3) / 2 degrees of freedom, and fewer fit nearly anything
_MIN_MARKERS_BY_SHAPE = 3
# Distances of a marker from its fitted place, as fractions of the diagonal of the target's box: up to _NEAR it is
# right, beyond _FAR wrong, and in between the fit is in doubt.
_NEAR, _FAR = 0.18, 0.3
_POLL_SECONDS = 0.02
# Least ratio of the residual of a misplaced marker to that of the others (root mean square), and of the residual before
# an exchange of two markers to that after it (mean square). Tuned on animals of random builds: a thousand random sets
# of good markers raise no alarm, nine of ten sets with two exchanged markers do, and four of five with one misplaced by
# a quarter of the body or more.
_MISPLACED, _EXCHANGED = 2.4, 1.7
_SURE_FROM = 8  # markers; with k < 8 both thresholds are multiplied by 8 / k
_NOISE = 0.01  # variance of a log ratio that marking by hand leaves at least: 10% of a distance
_CLOSE = 0.05  # of the median distance, added to each: damps the logarithms of distances between close markers
_CANDIDATES = 20  # markers with the largest residuals, of which all pairs are tried for an exchange: limits the time


def doubtful(source, target):
    """The rows in doubt: one that is misplaced, two that are exchanged, or none. source, target: (k, k) distances
    between the same markers on either mesh."""
    count = len(source)
    if count < _MIN_MARKERS:
        return ()
    if min(np.median(source), np.median(target)) <= 0:  # most markers coincide
        return ()
    caution = max(1.0, _SURE_FROM / count)
    log_source, log_target = _logarithm(source), _logarithm(target)
    factors = log_target - log_source
    residuals = _residuals(factors)
    present = _mean_square(residuals)
    removed = [_mean_square(_residuals(np.delete(np.delete(factors, k, 0), k, 1))) for k in range(count)]
    worst = int(np.argmin(removed))
    without_worst = removed[worst]
    exchanged, pair = _best_exchange(log_source, log_target, (residuals ** 2).sum(0))
    if present + _NOISE > _EXCHANGED * caution * (exchanged + _NOISE) and exchanged < without_worst:
        return pair
    error = max(present - without_worst, 0) * count / 2  # mean square residual that the worst one adds to its own pairs
    return (worst,) if error > (_MISPLACED * caution) ** 2 * (without_worst + _NOISE) else ()


def _logarithm(distances):
    return np.log(distances + _CLOSE * np.median(distances[~np.eye(len(distances), dtype=bool)]))


def _residuals(factors):
    """(k, k): the residuals of the model a_i + a_j, fitted by least squares off the diagonal; the diagonal is zero."""
    count = len(factors)
    off_diagonal = ~np.eye(count, dtype=bool)
    sums = np.where(off_diagonal, factors, 0).sum(1)
    of_place = (sums - sums.sum() / (2 * (count - 1))) / (count - 2)
    return np.where(off_diagonal, factors - of_place[:, None] - of_place, 0)


def _mean_square(residuals):
    count = len(residuals)
    return (residuals ** 2).sum() / (count * (count - 3))


def _best_exchange(log_source, log_target, errors):
    """(residual, rows): the least mean square residual after an exchange of two rows, and these. errors: (k,) sums of
    squared residuals by row, for _CANDIDATES."""
    rows = np.sort(np.argsort(errors)[-_CANDIDATES:])
    best, pair = np.inf, ()
    for number, i in enumerate(rows):
        for j in rows[number + 1:]:
            order = np.arange(len(log_target))
            order[[i, j]] = j, i
            error = _mean_square(_residuals(log_target[np.ix_(order, order)] - log_source))
            if error < best:
                best, pair = error, (int(i), int(j))
    return best, pair


def _distances(ob, vertices):
    """Generator: yields the fraction done and returns (k, k) distances between these vertices along the surface,
    Euclidean ones between components."""
    points, triangles = proportions.shape(ob), mesh_data.triangles(ob.data)
    found = []
    for vertex in vertices:
        start = np.zeros(len(points), bool)
        start[vertex] = True
        found.append(native.distances(points, triangles, start)[vertices])
        yield len(found) / len(vertices)
    found = np.array(found, float)
    straight = np.linalg.norm(points[vertices][:, None] - points[vertices], axis=2)
    return np.where(np.isfinite(found), 0.5 * (found + found.T), straight)


def doubtful_by_shape(distances):
    """The rows in doubt, as doubtful(). distances: (k, k) distances from marker i on the target to the fitted place of
    marker j of the source, as fractions of the diagonal of the target's box."""
    own, count = np.diag(distances), len(distances)
    wrong = np.flatnonzero(own > _FAR)
    if (own > _NEAR).sum() > len(wrong):  # some are neither near nor far: the fit is in doubt
        return ()
    if len(wrong) == 1 and count > 2:
        return (int(wrong[0]),)
    if len(wrong) == 2 and count > 2 and max(distances[wrong[0], wrong[1]], distances[wrong[1], wrong[0]]) < _NEAR:
        return tuple(wrong.tolist())
    return ()


def _fitted_distances(source, target, of_source, of_target):
    """Generator: yields the fraction done and returns the argument of doubtful_by_shape(), by a registration without
    markers."""
    source_shape, target_shape = proportions.shape(source), proportions.shape(target)
    match = native.Match((source_shape, mesh_data.triangles(source.data)),
                         (target_shape, mesh_data.triangles(target.data)),
                         stages=2, rounds=1, stance=proportions.relative_transform(source, target))
    try:
        running = True
        while running:
            running, fraction, _ = match.progress()
            yield fraction
            if running:
                time.sleep(_POLL_SECONDS)
        fitted = match.finish()[2]
    finally:
        match.close()
    box = max(float(np.linalg.norm(np.ptp(target_shape, axis=0))), 1e-30)
    return np.linalg.norm(target_shape[of_target][:, None] - fitted[of_source], axis=2) / box


def search(source, target, of_source=None, of_target=None):
    """Generator: yields the fraction done and returns the numbers of the markers in doubt. of_source, of_target:
    {number: vertex}, if they are known. Raises MeshProblem or native.NativeError."""
    of_source, of_target = of_source or markers.of(source), of_target or markers.of(target)
    both = sorted(of_source.keys() & of_target.keys())
    if len(both) < _MIN_MARKERS_BY_SHAPE:
        return ()
    if len(both) < _MIN_MARKERS:
        distances = yield from _fitted_distances(source, target, *([of[number] for number in both]
                                                                   for of in (of_source, of_target)))
        return tuple(both[row] for row in doubtful_by_shape(distances))
    found = []
    for ob, of in ((source, of_source), (target, of_target)):
        parts = _distances(ob, [of[number] for number in both])
        while True:
            try:
                yield 0.5 * (len(found) + next(parts))
            except StopIteration as end:
                found.append(end.value)
                break
    return tuple(both[row] for row in doubtful(*found))


def sentence(numbers, source, target):
    """The sentence about markers in doubt, and what to do; '' for no numbers."""
    if len(numbers) == 2:
        return (f"Markers {numbers[0]} and {numbers[1]} seem to be exchanged on '{source.name}' or '{target.name}': "
                "give each the other's number on one of them.")
    if numbers:
        return (f"Marker {numbers[0]} seems to be at different places on '{source.name}' and '{target.name}', as the "
                "other markers and the shapes say: correct it on one of them.")
    return ""
