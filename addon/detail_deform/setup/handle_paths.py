# SPDX-License-Identifier: GPL-3.0-or-later
"""The path along vertices for which Pull by Curve makes a curve: an edge loop, a chain, a strip, a ring or a limb."""

from typing import Any, NamedTuple

import bpy
import numpy as np
from mathutils import Matrix

from ..scene import components, curve_motion, mesh_data, start
from ..scene.mesh_data import MeshProblem

_ROUNDS = 3  # of centring
# A part's length in mean distances of vertices from the path: parts shorter than a limb is thick lean to and fro.
_THICK = 3.0
_MOST_LEVELS = 48  # of distances along a strip or a limb; three for each of 16 control points


class Path(NamedTuple):
    points: Any  # (n, 3) in the object's space, as displayed
    is_closed: bool  # the last is followed by the first

    def curve(self, name, to_world, world, count):
        """A new curve data-block with so many control points at equal distances. to_world: the matrix of the points'
        object. world: that of the curve's."""
        curve = bpy.data.curves.new(name, 'CURVE')
        curve.dimensions = '3D'
        spline = curve.splines.new('BEZIER')
        spline.bezier_points.add(count - 1)
        matrix = np.array(Matrix(world).inverted_safe() @ to_world)
        for point, place in zip(spline.bezier_points, self._spaced(count) @ matrix[:3, :3].T + matrix[:3, 3]):
            point.co = place
            point.handle_left_type = point.handle_right_type = 'AUTO'
        spline.use_cyclic_u = self.is_closed
        return curve

    def _spaced(self, count):
        points = np.concatenate([self.points, self.points[:1]]) if self.is_closed else self.points
        ends = np.append(0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        at = np.linspace(0, ends[-1], count + self.is_closed)[:count]
        return np.stack([np.interp(at, ends, points[:, axis]) for axis in range(3)], axis=1)


def along(ob, vertices):
    """The Path along these vertices; from a limb's root to its tip. Raises MeshProblem."""
    inside = np.zeros(len(ob.data.vertices), bool)
    inside[vertices] = True
    edges = mesh_data.edges(ob.data)
    within = inside[edges]
    points = start.deformed_positions(ob)[vertices].astype(np.float64)
    path = _path(points, np.searchsorted(vertices, edges[within.all(axis=1)]))
    beside_others = np.searchsorted(vertices, edges[within & ~within.all(axis=1)[:, None]])
    return path if path.is_closed or not len(beside_others) else _from_root(path, points[beside_others])


def _from_root(path, beside_others):
    """The open path from the end that is nearer to where the vertices adjoin others, as turns are counted from its
    begin."""
    samples = curve_motion.Samples(path.points, None, None, False)
    nearest = curve_motion.parameters(samples, beside_others).mean()
    return Path(path.points[::-1], False) if nearest > (len(path.points) - 1) / 2 + 1e-6 else path


def _path(points, edges):
    """The Path along points that these edges connect."""
    degrees = np.bincount(edges.ravel(), minlength=len(points))
    first = int((degrees == 1).argmax())
    distances = _distances(points, edges, first)
    if not np.isfinite(distances).all():
        raise MeshProblem("The selected vertices aren't connected: select those along one curve, such as an edge loop.")
    if len(points) < 2 or not distances.any():
        raise MeshProblem("A curve needs a length: select an edge loop, a chain or a strip of vertices.")
    if degrees.max() <= 2:
        return _chain(points, edges, first)
    return _spine(points, edges, _distances(points, edges, int(distances.argmax())))


def _distances(points, edges, first):
    """(n,): lengths of the shortest ways along edges. All vertices that have become nearer pass it on at once."""
    begins, ends = np.concatenate([edges, edges[:, ::-1]]).T
    order = np.argsort(begins, kind='stable')
    ends, lengths = ends[order], np.linalg.norm(points[begins[order]] - points[ends[order]], axis=1)
    counts = np.bincount(begins, minlength=len(points))
    starts = np.cumsum(counts) - counts
    result, nearer = np.full(len(points), np.inf), np.array([first])
    result[first] = 0
    while len(nearer):
        # The half-edges that begin at these vertices.
        of = np.repeat(np.arange(len(nearer)), counts[nearer])
        half = starts[nearer][of] + np.arange(len(of)) - (np.cumsum(counts[nearer]) - counts[nearer])[of]
        found, targets = result[nearer][of] + lengths[half], ends[half]
        better = found < result[targets]
        np.minimum.at(result, targets[better], found[better])
        nearer = np.unique(targets[better])
    return result


def _chain(points, edges, first):
    neighbours = [[] for _ in points]
    for a, b in edges.tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    order, before, vertex = [first], -1, first
    while True:
        following = next((other for other in neighbours[vertex] if other != before), -1)
        if following in {-1, first}:
            return Path(points[order], following == first and len(order) > 2)
        order.append(following)
        before, vertex = vertex, following


def _spine(points, edges, distances):
    """Through the centres of levels of equal distance from one end; through those of both halves of each level where
    they lie around a ring."""
    mean = distances[edges]
    step = 1.5 * np.abs(mean[:, 0] - mean[:, 1]).max()  # so that a level is connected
    count = int(np.clip(distances.max() / step, 3, _MOST_LEVELS))
    level = np.minimum((distances * (count / distances.max())).astype(int), count - 1)
    within = edges[level[edges[:, 0]] == level[edges[:, 1]]]
    _, parts = np.unique(components.labels(len(level), within), return_inverse=True)
    centres, levels = [], []
    for part in range(parts.max() + 1):
        inside = parts == part
        centres.append((points[inside].mean(axis=0), inside.sum()))
        levels.append(int(level[np.flatnonzero(inside)[0]]))
    of_level = [sorted((number for number in range(len(levels)) if levels[number] == k),
                       key=lambda number: -centres[number][1])[:2] for k in range(count)]
    middle = of_level[count // 4: -(count // 4) or None]
    if all(len(found) == 2 for found in middle):
        return _around(points, centres, of_level)
    path = [points[level == k].mean(axis=0) for k in range(count) if (level == k).any()]
    return _centred(points, Path(np.array(path), False))


def _around(points, centres, of_level):
    there, back = [], []
    for found in of_level:
        places = [centres[number][0] for number in found]
        if len(places) < 2:
            continue
        if there and (np.linalg.norm(places[0] - there[-1]) + np.linalg.norm(places[1] - back[-1])
                      > np.linalg.norm(places[1] - there[-1]) + np.linalg.norm(places[0] - back[-1])):
            places.reverse()
        there.append(places[0])
        back.append(places[1])
    ends = [centres[of_level[0][0]][0]] if len(of_level[0]) == 1 else []
    others = [centres[of_level[-1][0]][0]] if len(of_level[-1]) == 1 else []
    return _centred(points, Path(np.array([*ends, *there, *others, *reversed(back)]), True))


def _centred(points, path):
    """The path through the means of what is nearest to each part of it, as a principal curve; open ones reach to the
    ends. Levels of distance from a vertex of a rim are oblique at first."""
    for _ in range(_ROUNDS):
        samples = curve_motion.Samples(path.points, None, None, path.is_closed)
        found = curve_motion.parameters(samples, points)
        apart = np.linalg.norm(points - curve_motion.places(samples, found), axis=1).mean()
        count = int(np.clip(curve_motion.length(samples) / (_THICK * apart + 1e-30), 3, len(path.points)))
        _, parts = np.unique(curve_motion.parts(samples, found, count), return_inverse=True)
        sums = np.stack([np.bincount(parts, points[:, axis]) for axis in range(3)], axis=1)
        means = sums / np.bincount(parts)[:, None]
        if len(means) < 3:  # as thick as long: there is no better middle
            break
        if not path.is_closed:
            means = np.concatenate([[_end(points, means)], means, [_end(points, means[::-1])]])
        path = Path(means, path.is_closed)
    return path


def _end(points, means):
    """(3,): the path's first point beyond its first mean, as far as the vertices reach."""
    way = means[0] - means[min(2, len(means) - 1)]
    way /= max(np.linalg.norm(way), np.finfo(float).tiny)
    near = np.linalg.norm(points - means[0], axis=1) <= np.linalg.norm(means[0] - means[1])
    return means[0] + way * max(((points[near] - means[0]) @ way).max(initial=0), 0)
