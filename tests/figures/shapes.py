# SPDX-License-Identifier: GPL-3.0-or-later
"""The surfaces of the paper's figures, as numpy arrays: positions (n, 3) and quads or triangles."""

import numpy as np


def grid_faces(columns, rows):
    """Quads of a columns × rows grid whose vertex (i, j) is i * rows + j."""
    i, j = np.meshgrid(np.arange(columns - 1), np.arange(rows - 1), indexing='ij')
    corner = (i * rows + j).ravel()
    return np.stack([corner, corner + rows, corner + rows + 1, corner + 1], -1)


def bumpy_plane(side=201, bumps=12, steepness=0.55):
    """Fig. 1 and 5: round bumps over the unit square, 80,000 triangles."""
    x, y = (a.ravel() for a in np.meshgrid(*[np.linspace(0, 1, side)] * 2, indexing='ij'))
    r = np.hypot((x * bumps) % 1 - 0.5, (y * bumps) % 1 - 0.5) / 0.47
    z = steepness * 0.47 / bumps * np.clip(1 - r ** 2.6, 0, None) ** 2
    return np.stack([x, y, z], -1), grid_faces(side, side)


def thorns(columns=273, rows=161, across=7, along=4):
    """Fig. 3: hooked thorns on a plate, no height field over it; 87,038 triangles.

    A thorn's rings run from its foot (s = 0) to its tip (s = 1) along a centre line that rises and
    then bends over towards +x."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0, 1.7, columns), np.linspace(0, 1, rows),
                                           indexing='ij'))
    cell = np.array([1.7 / across, 1 / along])
    centre = (np.floor(np.stack([x, y], -1) / cell).clip(0, [across - 1, along - 1]) + 0.5) * cell
    away = np.stack([x, y], -1) - centre
    foot = 0.42 * cell.min()
    r = np.linalg.norm(away, axis=1) / foot
    direction = away / np.maximum(np.linalg.norm(away, axis=1), 1e-12)[:, None]
    s = (1 - r).clip(0, 1)
    # The centre line: an arc that starts upwards and turns over by 130 degrees.
    turn = np.radians(130) * s
    arc = 0.105
    line = arc * np.stack([1 - np.cos(turn), np.sin(turn)], -1)  # x, z
    radius = foot * (1 - s) ** 0.6 * np.where(s < 1, 0.45 + 0.55 * (1 - s) ** 6, 0)
    ring_x = direction[:, 0] * np.cos(turn)
    ring_z = -direction[:, 0] * np.sin(turn)
    inside = r < 1
    p = np.stack([x, y, np.zeros_like(x)], -1)
    p[inside, 0] = (centre[:, 0] - 0.25 * foot + line[:, 0] + radius * ring_x)[inside]
    p[inside, 1] = (centre[:, 1] + radius * direction[:, 1])[inside]
    p[inside, 2] = (line[:, 1] + radius * ring_z)[inside]
    # The foot blends into the plate.
    blend = (np.clip(s / 0.12, 0, 1) ** 2 * (3 - 2 * np.clip(s / 0.12, 0, 1)))[:, None]
    flat = np.stack([x, y, np.zeros_like(x)], -1)
    p = np.where(inside[:, None], blend * p + (1 - blend) * flat, flat)
    # One quad less makes the paper's number of triangles.
    return p[:-1], grid_faces(columns, rows)[:-1]


def cylinder(rings=90, sides=55):
    """Fig. 4: radius 1, closed by caps, 9,900 triangles; and its base of half the radius."""
    z, angle = (a.ravel() for a in np.meshgrid(np.linspace(-4.5, 4.5, rings),
                                               2 * np.pi * np.arange(sides) / sides, indexing='ij'))
    p = np.stack([np.cos(angle), np.sin(angle), z], -1)
    p = np.concatenate([p, [[0, 0, -4.5], [0, 0, 4.5]]])
    i, j = (a.ravel() for a in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing='ij'))
    a, b = i * sides + j, i * sides + (j + 1) % sides
    j = np.arange(sides)
    last = (rings - 1) * sides
    faces = np.concatenate([
        np.stack([a, b, b + sides], -1), np.stack([a, b + sides, a + sides], -1),
        np.stack([np.full(sides, rings * sides), (j + 1) % sides, j], -1),
        np.stack([np.full(sides, rings * sides + 1), last + j, last + (j + 1) % sides], -1)])
    return p, faces


def bent(p, degrees, radius=0.7):
    """Bends about an arc of that radius towards +x, over a short length around z = 0."""
    angle = np.radians(degrees)
    along = np.clip(p[:, 2], -0.5 * radius * angle, 0.5 * radius * angle)
    rest, turn, arm = p[:, 2] - along, along / radius, radius - p[:, 0]
    return np.stack([radius - arm * np.cos(turn) + np.sin(turn) * rest, p[:, 1],
                     arm * np.sin(turn) + np.cos(turn) * rest], -1)


def sheet(side=121):
    """A flat grid over the unit square."""
    x, y = (a.ravel() for a in np.meshgrid(*[np.linspace(0, 1, side)] * 2, indexing='ij'))
    return np.stack([x, y, np.zeros_like(x)], -1), grid_faces(side, side)


def tube(rings, sides, length, outline):
    """Triangles about the x axis, closed by caps. outline: maps angles (n,) to y and z (n, 2)."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(rings), np.arange(sides), indexing='ij'))
    p = np.concatenate([(length / (rings - 1) * i)[:, None], outline(2 * np.pi * j / sides)], -1)
    p = np.concatenate([p, [[0, 0, 0], [length, 0, 0]]])
    i, j = (a.ravel() for a in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing='ij'))
    a, b = i * sides + j, i * sides + (j + 1) % sides
    j = np.arange(sides)
    last = (rings - 1) * sides
    return p, np.concatenate([
        np.stack([a, b + sides, b], -1), np.stack([a, a + sides, b + sides], -1),
        np.stack([np.full(sides, rings * sides), j, (j + 1) % sides], -1),
        np.stack([np.full(sides, rings * sides + 1), last + (j + 1) % sides, last + j], -1)])


LIMB_LENGTH = 4.0


def limb(bottom, top, relief=0.0, rings=121, sides=64):
    """A closed tapered tube along z, its faces outwards: points, faces and colours, in two tints so that twists are
    seen."""
    points, faces = tube(rings, sides, LIMB_LENGTH, lambda angle: circle(angle, 1.0))
    points = points[:, [1, 2, 0]]  # from the x axis to the z axis
    u, turn = points[:, 2] / LIMB_LENGTH, np.arctan2(points[:, 1], points[:, 0])
    points[:, :2] *= ((bottom + (top - bottom) * u) * (1 + relief * np.cos(8 * turn) * np.cos(24 * np.pi * u)))[:, None]
    stripes = (np.arange(len(points)) % sides // 8) % 2
    return points, faces[:, ::-1], np.where(stripes[:, None] > 0, (0.75, 0.42, 0.22), (0.88, 0.72, 0.52))


def square(angle, half=0.07):
    """An outline whose corners are vertices where the number of sides divides by four: the survey's bar."""
    side, along = np.divmod(4 * angle / np.pi + 1e-9, 2)
    turn = side * np.pi / 2
    y, z = half, half * (along - 1)
    return np.stack([np.cos(turn) * y - np.sin(turn) * z, np.sin(turn) * y + np.cos(turn) * z], -1)


def circle(angle, radius=0.08):
    return radius * np.stack([np.cos(angle), np.sin(angle)], -1)
