# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of broken, odd and extreme meshes."""

import numpy as np

from .kind import Kinds
from .specimen import DoesNotCombine

KINDS = kind = Kinds('mesh')


# ---- coordinates

def _set(value):
    def make(sheet):
        sheet.positions[sheet.middle()[0], 1] = value
    return make


def _scaled(factor):
    def make(sheet):
        sheet.positions = sheet.positions * factor
    return make


def _shifted(distance):
    def make(sheet):
        sheet.positions = sheet.positions + [distance, -distance, 0.3 * distance]
    return make


KINDS.each('coordinate', {f"one coordinate {value:g}": _set(value) for value in (
    float('nan'), float('inf'), -float('inf'), 3.4028234e38, 1e30, 1e20, 1e6, -1e4)})
KINDS.each('unit', {f"all of it times {factor:g}": _scaled(factor) for factor in (
    1e30, 1e20, 1e9, 1e-6, 1e-12, 1e-20, 1e-30)})
KINDS.each('unit', {f"shifted by {distance:g} sizes": _shifted(distance) for distance in (1e3, 1e6, 1e8)})
KINDS.each('unit', {"stretched to needles": lambda sheet: _stretch(sheet, 1e6),
                    "squeezed to 1e-6 across": lambda sheet: _stretch(sheet, 1e-6)})


def _stretch(sheet, factor):
    sheet.positions = sheet.positions * [1, factor, 1]


@kind("all coordinates NaN", about='unit')
def _all_nan(sheet):
    sheet.positions = sheet.positions * np.nan


@kind("all at one point", about='unit')
def _point(sheet):
    sheet.positions = sheet.positions * 0 + [0.3, 0.2, 0.1]


@kind("all on one line", about='unit')
def _line(sheet):
    sheet.positions = sheet.positions * [1, 0, 0]


@kind("flat", about='unit')
def _flat(sheet):
    sheet.positions = sheet.positions * [1, 1, 0]


@kind("free part at one point", about='coordinate')
def _collapsed(sheet):
    free = sorted(sheet.region - sheet.right)
    if not free:
        raise DoesNotCombine
    sheet.positions[free] = sheet.positions[free].mean(0)


@kind("handle at one point")
def _handle_collapsed(sheet):
    sheet.positions[sorted(sheet.right)] = [1, 0.5, 0]


@kind("noise as large as its edges", about='coordinate')
def _noise(sheet):
    sheet.positions = sheet.positions + np.random.default_rng(3).uniform(-0.1, 0.1, sheet.positions.shape)


@kind("a part of size 1e-6", about='coordinate')
def _tiny_part(sheet):
    some = sheet.middle(min(12, max(1, len(sheet.region - sheet.right) // 3)))
    middle = sheet.positions[some].mean(0)
    sheet.positions[some] = middle + 1e-6 * (sheet.positions[some] - middle)


# ---- faces

@kind("a face without area")
def _no_area(sheet):
    face = sheet.faces[sheet.inner_faces()[0]]
    sheet.positions[list(face)] = sheet.positions[face[0]]


@kind("a row of faces without area")
def _no_area_row(sheet):
    inner = sheet.inner_faces()
    for f in inner[:max(1, len(inner) // 7)]:
        face = sheet.faces[f]
        sheet.positions[face[1]] = sheet.positions[face[0]]
        sheet.positions[face[-2]] = sheet.positions[face[-1]]


@kind("needles")
def _needles(sheet):
    for f in sheet.inner_faces()[::3]:
        face = sheet.faces[f]
        sheet.positions[face[0]] = sheet.positions[face[1]] + [1e-9, 1e-9, 0]


@kind("a seam of doubled vertices")
def _seam(sheet):
    inner = sheet.inner_faces()
    sheet.duplicate(inner[len(inner) // 2:])


@kind("no vertex welded")
def _soup(sheet):
    for f in range(len(sheet.faces)):
        sheet.duplicate([f])


@kind("a part twice, at the same place")
def _coincident(sheet):
    faces = [sheet.faces[f] for f in sheet.inner_faces()[::2]]
    start = len(sheet.faces)
    sheet.faces += faces
    sheet.duplicate(range(start, len(sheet.faces)))


@kind("faces twice")
def _twice(sheet):
    sheet.faces += [face[1:] + face[:1] for face in sheet.faces[::3]]


@kind("faces twice, of both windings")
def _twice_both(sheet):
    sheet.faces += [face[::-1] for face in sheet.faces[::3]]


@kind("all faces twice, of both windings")
def _all_twice(sheet):
    sheet.faces += [face[::-1] for face in sheet.faces]


@kind("winding flipped here and there")
def _flipped(sheet):
    sheet.faces = [face[::-1] if f % 3 == 1 else face for f, face in enumerate(sheet.faces)]


@kind("an edge of three faces")
def _fin(sheet):
    a, b = sheet.faces[sheet.inner_faces()[0]][:2]
    sheet.add(sheet.positions[[a]] + [0, 0, 0.1], [(a, b, -1)])


@kind("an edge of forty faces")
def _brush(sheet):
    a, b = sheet.faces[sheet.inner_faces()[0]][:2]
    angle = np.linspace(0, 3, 38)
    sheet.add(sheet.positions[a] + 0.1 * np.c_[0 * angle, np.cos(angle), np.sin(angle)],
              [(a, b, -1 - k) for k in range(38)])


@kind("a bow-tie vertex")
def _bow_tie(sheet):
    a = sheet.middle()[0]
    sheet.add(sheet.positions[a] + [[0.1, 0, 0.2], [0, 0.1, 0.2], [-0.1, 0, 0.2]], [(a, -1, -2), (a, -2, -3)])


@kind("faces that touch at vertices only")
def _checkers(sheet):
    if len(sheet.faces) < 4:
        raise DoesNotCombine
    sheet.faces = [face for face in sheet.faces if (face[0] // 11 + face[0]) % 2 == 0]
    if not sheet.faces:
        raise DoesNotCombine


@kind("loose vertices")
def _loose(sheet):
    sheet.add([[0.5, 0.5, 1], [0.2, 0.1, -1]])


@kind("loose edges")
def _wires(sheet):
    sheet.add([[0.5, 0.5, 1], [0.5, 0.6, 1], [0.5, 0.7, 1]], edges=[(-1, -2), (-2, -3)])


@kind("an edge from the surface to a loose vertex")
def _whisker(sheet):
    sheet.add([[0.5, 0.5, 1]], edges=[(sheet.middle()[0], -1)])


@kind("isolated triangles")
def _islands(sheet):
    for k in range(3):
        sheet.add(np.array([[0, 0, 1], [0.1, 0, 1], [0, 0.1, 1]]) + 0.2 * k, [(-1, -2, -3)])


@kind("a thousand isolated triangles")
def _many_islands(sheet):
    at = np.random.default_rng(1).uniform(0, 1, (1000, 1, 3))
    sheet.add(at + 0.02 * np.eye(3), [(-1 - 3 * k, -2 - 3 * k, -3 - 3 * k) for k in range(1000)])


@kind("holes")
def _holes(sheet):
    inner = set(sheet.inner_faces()[::4])
    sheet.faces = [face for f, face in enumerate(sheet.faces) if f not in inner]
    if not sheet.faces:
        raise DoesNotCombine


@kind("a hole beside the handle")
def _cut_free(sheet):
    kept = [face for face in sheet.faces
            if not (any(v in sheet.right for v in face) and any(v not in sheet.right for v in face))]
    if not kept or len(kept) == len(sheet.faces):
        raise DoesNotCombine
    sheet.faces = kept


@kind("T-junctions")
def _t_junctions(sheet):
    for f in sheet.inner_faces()[::3]:
        a, b = sheet.faces[f][:2]
        first = sheet.add(sheet.positions[[a, b]].mean(0))
        sheet.faces[f] = (a, first, *sheet.faces[f][1:])


@kind("a face with a corner twice")
def _corner_twice(sheet):
    f = sheet.inner_faces()[0]
    sheet.faces[f] = (*sheet.faces[f], sheet.faces[f][1])


@kind("two crossing sheets")
def _crossing(sheet):
    count, faces = len(sheet.positions), list(sheet.faces)
    right, region = set(sheet.right), set(sheet.region)
    if not count:
        raise DoesNotCombine
    middle = np.nan_to_num(sheet.positions).mean(0)
    first = sheet.add(middle + (sheet.positions - middle)[:, [0, 2, 1]] * [1, -1, 1])
    sheet.faces += [tuple(v + first for v in face) for face in faces]
    sheet.right |= {v + first for v in right}
    sheet.region = region | {v + first for v in region}


@kind("a second part without a handle")
def _second_part(sheet):
    count, faces = len(sheet.positions), list(sheet.faces)
    region = set(sheet.region)
    if not count:
        raise DoesNotCombine
    first = sheet.add(sheet.positions + [0, 0, 1])
    sheet.faces += [tuple(v + first for v in face) for face in faces]
    sheet.region = region | set(range(first, first + count))


# ---- faces of many corners

@kind("n-gons only")
def _ngons(sheet):
    sheet.become(*_rows_of_ngons(lambda x, y: (x, y, 0.02 * np.sin(20 * x))))


def _rows_of_ngons(place, n=9):
    """(positions, faces): a grid in which each row is one face."""
    positions = [place(i / (n - 1), j / (n - 1)) for i in range(n) for j in range(n)]
    faces = [[*range(i * n, i * n + n), *range((i + 1) * n + n - 1, (i + 1) * n - 1, -1)] for i in range(n - 1)]
    return positions, faces


KINDS[-1] = KINDS[-1]._replace(whole=True)


@kind("concave n-gons", whole=True)
def _concave(sheet):
    sheet.become(*_rows_of_ngons(lambda x, y: (x + 0.1 * (round(8 * y) % 2), y, 0.05 * np.sin(9 * y))))


@kind("n-gons that cross themselves", whole=True)
def _figure_eight(sheet):
    positions, faces = _rows_of_ngons(lambda x, y: (x, y, 0.02 * np.sin(20 * x)))
    sheet.become(positions, [face[:4] + face[4:9][::-1] + face[9:] for face in faces])


@kind("n-gons with corners on a line", whole=True)
def _collinear(sheet):
    sheet.become(*_rows_of_ngons(lambda x, y: (x, y, 0)))


@kind("n-gons without area", whole=True)
def _flat_ngons(sheet):
    sheet.become(*_rows_of_ngons(lambda x, y: (x, 0, 0)))


@kind("a face of 300 corners", whole=True)
def _large_ngon(sheet):
    angle = np.linspace(0, 2 * np.pi, 301)[:-1]
    sheet.become(np.c_[np.cos(angle), np.sin(angle), 0.1 * np.sin(5 * angle)], [range(300)])


# ---- other meshes

@kind("no vertices", whole=True)
def _nothing(sheet):
    sheet.become([], [])


@kind("one vertex", whole=True)
def _vertex(sheet):
    sheet.become([[0.1, 0.2, 0.3]], [])


@kind("vertices alone", whole=True)
def _cloud(sheet):
    sheet.become(sheet.positions, [])


@kind("edges alone", whole=True)
def _edges(sheet):
    sheet.become(sheet.positions, [], [(v, v + 1) for v in range(len(sheet.positions) - 1)])


@kind("one triangle", whole=True)
def _triangle(sheet):
    sheet.become([[0, 0, 0], [1, 0, 0], [0.5, 1, 0]], [(0, 1, 2)])


@kind("two triangles", whole=True)
def _two(sheet):
    sheet.become([[0, 0, 0], [0.4, -1, 0], [0.6, 1, 0], [1, 0, 0]], [(0, 1, 2), (1, 3, 2)])


@kind("a tetrahedron", whole=True)
def _tetrahedron(sheet):
    sheet.become([[0, 0, 0], [0.5, 1, 0], [0.5, 0, 1], [1, 0, 0]], [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)])


@kind("a strip one face wide", whole=True)
def _ribbon(sheet):
    x = np.linspace(0, 1, 30)
    sheet.become([(a, b, 0.05 * np.sin(20 * a)) for a in x for b in (0, 0.05)],
                 [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(29)])


@kind("a fan about one vertex", whole=True)
def _fan(sheet):
    angle = np.linspace(0, 2 * np.pi, 201)[:-1]
    sheet.become(np.vstack([[0, 0, 0.2], np.c_[np.cos(angle), np.sin(angle), 0 * angle]]),
                 [(0, 1 + k, 1 + (k + 1) % 200) for k in range(200)])


def _wrapped(place, n, m, twisted):
    """(positions, faces) of an n × m grid that is closed in both directions. twisted: where the first direction closes,
    the second one is reversed."""
    faces = []
    for i in range(n):
        for j in range(m):
            corners = [(i, j), (i + 1, j), (i + 1, (j + 1) % m), (i, (j + 1) % m)]
            faces.append([(a % n) * m + (b if a < n or not twisted else -b % m) for a, b in corners])
    return [place(2 * np.pi * i / n, 2 * np.pi * j / m) for i in range(n) for j in range(m)], faces


@kind("a torus", whole=True)
def _torus(sheet):
    sheet.become(*_wrapped(lambda u, v: ((2 + np.cos(v)) * np.cos(u), (2 + np.cos(v)) * np.sin(u), np.sin(v)),
                           20, 8, False))


@kind("a Klein bottle", whole=True)
def _klein(sheet):
    def place(u, v):
        r = 2 + np.cos(u / 2) * np.sin(v) - np.sin(u / 2) * np.sin(2 * v)
        return r * np.cos(u), r * np.sin(u), np.sin(u / 2) * np.sin(v) + np.cos(u / 2) * np.sin(2 * v)
    sheet.become(*_wrapped(place, 24, 12, True))


@kind("a Möbius strip", whole=True)
def _moebius(sheet):
    n, m = 30, 5
    positions = [((1 + w * np.cos(u / 2)) * np.cos(u), (1 + w * np.cos(u / 2)) * np.sin(u), w * np.sin(u / 2))
                 for u in 2 * np.pi * np.arange(n) / n for w in np.linspace(-0.3, 0.3, m)]

    def number(i, j):
        return i * m + j if i < n else m - 1 - j

    sheet.become(positions, [(number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1))
                             for i in range(n) for j in range(m - 1)])


@kind("a sphere with poles", whole=True)
def _sphere(sheet):
    n, m = 12, 16
    u = np.pi * np.arange(1, n) / n
    ring = 2 * np.pi * np.arange(m) / m
    positions = [(0, 0, 1), *((np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)) for a in u for b in ring),
                 (0, 0, -1)]
    last = len(positions) - 1
    faces = [(0, 1 + j, 1 + (j + 1) % m) for j in range(m)]
    faces += [(1 + i * m + j, 1 + (i + 1) * m + j, 1 + (i + 1) * m + (j + 1) % m, 1 + i * m + (j + 1) % m)
              for i in range(n - 2) for j in range(m)]
    faces += [(last, last - m + (j + 1) % m, last - m + j) for j in range(m)]
    sheet.become(positions, faces)


@kind("nested shells", whole=True)
def _shells(sheet):
    _sphere(sheet)
    inner, faces = sheet.positions * 0.9, list(sheet.faces)
    count = len(inner)
    sheet.become(np.vstack([sheet.positions, inner]),
                 faces + [tuple(v + count for v in face[::-1]) for face in faces])


@kind("a hundred thin spikes", whole=True)
def _spikes(sheet):
    fresh = type(sheet)()
    for f in fresh.inner_faces():
        face = fresh.faces[f]
        tip = fresh.positions[list(face)].mean(0) + [0, 0, 3]
        fresh.add(tip, [(a, b, -1) for a, b in zip(face, face[1:] + face[:1])])
    sheet.become(fresh.positions, fresh.faces)
