# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies of our own: balls and limbs blended together as signed distances, and meshes of where these are zero."""

import numpy as np


NEAR = 0.05  # from a part's box: farther out the part doesn't matter


class Body:
    """A sum of parts, each blended into those before it. Lengths are metres."""

    def __init__(self):
        self.parts = []  # distance, its box, blend, paint, sign: 1 is grown on, -1 is carved out

    def ball(self, centre, radii, blend=0.03, paint=None, turn=None, carve=False):
        """radii: one or three. turn: (3, 3), whose columns are the ball's axes."""
        centre, radii = np.array(centre, float), np.broadcast_to(np.array(radii, float), 3)
        axes = np.eye(3) if turn is None else np.array(turn, float)

        def distance(p):
            q = (p - centre) @ axes
            k0, k1 = np.linalg.norm(q / radii, axis=-1), np.linalg.norm(q / radii ** 2, axis=-1)
            return k0 * (k0 - 1) / np.maximum(k1, 1e-9)

        reach = radii.max()
        self.parts.append((distance, centre - reach, centre + reach, blend, paint, -1 if carve else 1))

    def slab(self, centre, radii, half, blend=0.03, paint=None, carve=False):
        """A level slab whose outline in x and y is an ellipse. half: half of its thickness."""
        centre, radii = np.array(centre, float), np.array(radii, float)

        def distance(p):
            q = p - centre
            k0, k1 = (np.linalg.norm(q[..., :2] / r, axis=-1) for r in (radii, radii ** 2))
            return np.maximum(k0 * (k0 - 1) / np.maximum(k1, 1e-9), np.abs(q[..., 2]) - half)

        reach = np.append(radii, half)
        self.parts.append((distance, centre - reach, centre + reach, blend, paint, -1 if carve else 1))

    def limb(self, points, blend=0.03, paint=None, wide=1.0, carve=False):
        """Cones with round ends along a curve through points (x, y, z, radius). wide: width in y over height."""
        points = smooth_curve(np.array(points, float))
        scale = np.array([1, 1 / wide, 1])

        def distance(p):
            found = np.full(p.shape[:-1], np.inf)
            for a, b in zip(points[:-1], points[1:]):
                along, away = (b - a)[:3] * scale, (p - a[:3]) * scale
                t = np.clip(away @ along / max(along @ along, 1e-12), 0, 1)
                found = np.minimum(found, np.linalg.norm(away - t[..., None] * along, axis=-1)
                                   - a[3] - t * (b[3] - a[3]))
            return found * min(1, wide)

        reach = points[:, 3:] * max(1, wide)
        self.parts.append((distance, (points[:, :3] - reach).min(0), (points[:, :3] + reach).max(0), blend, paint,
                           -1 if carve else 1))

    def both(self, add, points, *others, **named):
        """A part and its mirror image: points' second coordinates change their sign."""
        for sign in (1, -1):
            mirrored = np.array(points, float)
            mirrored[..., 1] *= sign
            add(mirrored, *others, **named)

    def distance(self, p):
        """Signed distances of points (n, 3) near the surface."""
        found = np.full(len(p), 1.0)
        for distance, low, high, blend, _, sign in self.parts:
            near = ((p > low - blend - NEAR) & (p < high + blend + NEAR)).all(-1)
            found[near] = joined(found[near], distance(p[near]), blend, sign)
        return found

    def paint(self, p, colours, width):
        """(n, 3): the colour of the part nearest to each point, blended over a width. colours: {paint: colour}."""
        weights, mixed = np.zeros(len(p)), np.zeros((len(p), 3))
        nearest = {}
        for distance, _, _, _, paint, sign in self.parts:
            if sign > 0:
                nearest[paint] = np.minimum(nearest.get(paint, np.inf), distance(p))
        closest = np.min(list(nearest.values()), axis=0)
        for paint, distance in nearest.items():
            share = np.exp(-((distance - closest) / width))
            mixed += share[:, None] * np.array(colours[paint])
            weights += share
        return mixed / weights[:, None]

    def mesh(self, cell, turn=None):
        """(n, 3) points and (m, 4) quads over a grid of such cells. turn: of the grid, (3, 3), for another topology."""
        axes = np.eye(3) if turn is None else np.array(turn, float)
        low, high = np.min([part[1] for part in self.parts], 0), np.max([part[2] for part in self.parts], 0)
        corners = np.stack(np.meshgrid(*zip(low, high), indexing='ij'), -1).reshape(-1, 3) @ axes
        low, high = corners.min(0) - 3.3 * cell, corners.max(0) + 3 * cell
        lines = [np.arange(a, b, cell) for a, b in zip(low, high)]
        values = np.full([len(line) for line in lines], 1.0)
        for distance, least, most, blend, _, sign in self.parts:
            box = np.stack(np.meshgrid(*zip(least, most), indexing='ij'), -1).reshape(-1, 3) @ axes
            margin = blend + 4 * cell
            here = tuple(slice(*np.searchsorted(line, (a - margin, b + margin)))
                         for line, a, b in zip(lines, box.min(0), box.max(0)))
            p = np.stack(np.meshgrid(*(line[s] for line, s in zip(lines, here)), indexing='ij'), -1) @ axes.T
            values[here] = joined(values[here], distance(p), blend, sign)
        points, quads = surface_net(values)
        points = (low + cell * points) @ axes.T
        for _ in range(3):
            points = self.settled(relaxed(points, quads), 0.2 * cell)
        return 0.5 * points + 0.5 * relaxed(points, quads), quads  # smooths what is smaller than a cell

    def settled(self, points, step):
        """Points moved onto the surface, by Newton's method."""
        for _ in range(2):
            slope = np.stack([self.distance(points + d) - self.distance(points - d) for d in step * np.eye(3)], -1)
            slope /= 2 * step
            far = self.distance(points)[:, None] / np.maximum((slope ** 2).sum(-1, keepdims=True), 0.2)
            points = points - np.clip(far, -2 * step, 2 * step) * slope
        return points


def smooth_curve(points, between=5):
    """The spline of Catmull and Rom through points, with so many new ones between each and the next."""
    if len(points) < 3:
        return points
    before, after = np.vstack([points[:1], points[:-1]]), np.vstack([points[1:], points[-1:]])
    slope, t = (after - before) / 2, (np.arange(between + 1) / (between + 1))[:, None, None]
    a, b, m, n = points[:-1], points[1:], slope[:-1], slope[1:]
    found = (2 * t**3 - 3 * t**2 + 1) * a + (t**3 - 2 * t**2 + t) * m + (3 * t**2 - 2 * t**3) * b + (t**3 - t**2) * n
    found = np.vstack([found.swapaxes(0, 1).reshape(-1, 4), points[-1:]])
    found[:, 3] = np.maximum(found[:, 3], points[:, 3].min())
    return found


def joined(a, b, blend, sign):
    """The union (sign 1) of two distances, or a without b (-1), rounded over the blend."""
    b = sign * b
    h = np.clip(0.5 + 0.5 * sign * (a - b) / blend, 0, 1)
    return a + h * (b - a) - sign * blend * h * (1 - h)


def surface_net(values):
    """Where a grid of values changes its sign: a point in each such cell, in cells, a quad across each such edge."""
    inside = values < 0
    cells = np.zeros([n - 1 for n in values.shape], bool)
    corners = [tuple(slice(d, n - 1 + d) for d, n in zip(corner, values.shape)) for corner in np.ndindex(2, 2, 2)]
    count = sum(inside[corner].astype(np.int8) for corner in corners)
    cells = (count > 0) & (count < 8)
    number = np.full(cells.shape, -1)
    number[cells] = np.arange(cells.sum())
    place = np.argwhere(cells)
    at = [values[corner][cells] for corner in corners]
    total, hits = np.zeros((len(place), 3)), np.zeros(len(place))
    for i, a in enumerate(np.ndindex(2, 2, 2)):
        for j, b in enumerate(np.ndindex(2, 2, 2)):
            if j > i and sum(np.abs(np.subtract(a, b))) == 1:
                crosses = (at[i] < 0) != (at[j] < 0)
                t = np.where(crosses, at[i] / np.where(crosses, at[i] - at[j], 1), 0)[:, None]
                total += np.where(crosses[:, None], np.array(a) + t * np.subtract(b, a), 0)
                hits += crosses
    quads = []
    for axis in range(3):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        begin = [slice(1, n - 1) for n in values.shape]
        begin[axis] = slice(0, values.shape[axis] - 1)
        end = list(begin)
        end[axis] = slice(1, values.shape[axis])
        first = inside[tuple(begin)]
        edges = np.argwhere(first != inside[tuple(end)])
        is_out = first[tuple(edges.T)]
        edges[:, one] += 1
        edges[:, other] += 1
        around = []
        for da, db in ((1, 1), (0, 1), (0, 0), (1, 0)):
            cell = edges.copy()
            cell[:, one] -= da
            cell[:, other] -= db
            around.append(number[tuple(cell.T)])
        quad = np.stack(around, -1)
        quad[~is_out] = quad[~is_out][:, ::-1]
        quads.append(quad)
    return place + total / hits[:, None], np.concatenate(quads)


def relaxed(points, quads):
    """Each point at the middle of its neighbours."""
    total, count = np.zeros_like(points), np.zeros(len(points))
    for k in range(4):
        np.add.at(total, quads[:, k], points[quads[:, (k + 1) % 4]])
        np.add.at(count, quads[:, k], 1)
    return total / np.maximum(count, 1)[:, None]
