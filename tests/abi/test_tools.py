# SPDX-License-Identifier: GPL-3.0-or-later
"""The C ABI beside binding and deforming: solids, and measures of a deformation."""
import ctypes
from itertools import permutations

import numpy as np
import pytest

from conftest import IDENTITY, rotation


class Solid:
    """A row of n cubes, six tetrahedra each; the ends held, the last by handle 0."""

    def __init__(self, n=6):
        i, j, k = np.meshgrid(np.arange(n + 1), [0, 1], [0, 1], indexing='ij')
        self.positions = np.stack([i, j, k], -1).reshape(-1, 3).astype(float)
        number = np.arange(len(self.positions)).reshape(n + 1, 2, 2)
        self.tets = []
        for cube in range(n):
            for path in permutations(range(3)):
                at = np.array([cube, 0, 0])
                corners = [number[tuple(at)]]
                for axis in path:
                    at[axis] += 1
                    corners.append(number[tuple(at)])
                self.tets.append(corners)
        self.tets = np.array(self.tets, np.int32)
        self.roles = np.full(len(self.positions), -1, np.int32)
        self.roles[i.ravel() == 0] = -2
        self.roles[i.ravel() == n] = 0


@pytest.fixture
def tets(native, structs):
    """The functions for solids; the add-on has no use for them."""
    lib, solid, handle = native.library(), Solid(), ctypes.c_void_p()

    def create(target):
        mesh = structs.TetMesh(positions=solid.positions, tets=solid.tets)
        return lib.dd_tets_create(mesh, solid.roles, len(solid.roles), 1, target)

    assert create(handle) == 0
    yield lib, solid, handle, create
    lib.dd_tets_free(handle)


def test_operators_of_solids_agree_and_have_the_constants_as_kernel(tets):
    lib, solid, handle, _ = tets
    found = []
    for which in range(3):
        count = ctypes.c_size_t()
        assert lib.dd_tets_get_operator(handle, which, None, None, None, 0, count) == 0
        rows, columns = np.empty(count.value, np.int32), np.empty(count.value, np.int32)
        values = np.empty(count.value)
        assert lib.dd_tets_get_operator(handle, which, rows, columns, values, len(values), count) == 0
        n = len(solid.positions)
        matrix = np.zeros((3 * len(solid.tets) if which < 2 else n, n))
        np.add.at(matrix, (rows, columns), values)
        found.append(matrix)
    G, other, L = found
    assert np.abs(G - other).max() < 1e-12
    assert np.allclose(L, np.repeat(1 / 6, G.shape[0])[None] * G.T @ G)
    assert np.abs(L.sum(1)).max() < 1e-12


def test_solids_follow_their_handles_and_given_gradients(tets):
    lib, solid, handle, _ = tets
    out = np.zeros_like(solid.positions)
    still = np.ascontiguousarray(IDENTITY)
    assert lib.dd_tets_update(handle, still, len(still), out, len(out)) == 0
    assert np.abs(out - solid.positions).max() < 1e-12
    motion = np.ascontiguousarray(rotation(0.6, (0, 0, 1)))
    assert lib.dd_tets_update(handle, motion, len(motion), out, len(out)) == 0
    moved = solid.positions @ motion[0, :, :3].T + motion[0, :, 3]
    assert np.allclose(out[solid.roles == 0], moved[solid.roles == 0])
    gradients = np.ascontiguousarray(np.tile(motion[0, :, :3], (len(solid.tets), 1, 1)))
    assert lib.dd_tets_solve(handle, moved, len(moved), gradients, len(gradients), out, len(out)) == 0
    assert np.allclose(out, moved)


def test_unusable_solids_are_refused(tets):
    lib, solid, _, create = tets
    target = ctypes.c_void_p()
    solid.tets[3, 1] = solid.tets[3, 0]
    assert create(target) == 2 and b'Tetrahedron 3' in lib.dd_last_message()
    solid.tets[3, 1] = 77
    assert create(target) == 2 and b'vertex 77' in lib.dd_last_message()
    solid.positions[5, 0] = np.nan
    assert create(target) == 2 and b'Vertex 5' in lib.dd_last_message()
    assert not target


@pytest.mark.parametrize('unit, said', [(1e-100, b'too small'), (1e100, b'too large')])
def test_solids_whose_volumes_are_no_numbers_are_refused(tets, unit, said):
    lib, solid, _, create = tets
    solid.positions *= unit
    target = ctypes.c_void_p()
    assert create(target) == 2 and said in lib.dd_last_message()
    assert not target


def test_a_solid_that_handles_take_beyond_all_numbers_is_refused_and_nothing_written(tets):
    lib, solid, handle, _ = tets
    out = np.full((len(solid.positions), 3), 7.0)
    matrix = np.full((1, 3, 4), 1e308)
    assert lib.dd_tets_update(handle, matrix, len(matrix), out, len(out)) == 4
    assert b'not finite' in lib.dd_last_message()
    assert (out == 7).all()


def test_measures_of_a_deformation(native, strip):
    scaled = strip.positions * np.float32(2)
    found = native.measure(strip.positions, scaled, strip.triangles, strip.roles)
    assert found.intersecting_pairs == 0 and found.normal_error == 0
    assert found.stretch == pytest.approx(2 ** 0.5, rel=1e-5)
    assert found.area_ratio == pytest.approx(4, rel=1e-5)
    # Pushed through itself: the two ends change sides.
    crossed = strip.positions.copy()
    crossed[:, 0] = np.abs(crossed[:, 0] - 12) * 0.9
    crossed[:, 2] += np.where(strip.positions[:, 0] > 12, strip.positions[:, 1] - 3.5, 0)
    found = native.measure(strip.positions, crossed.astype(np.float32), strip.triangles, strip.roles,
                           strip.positions, scaled)
    assert found.new_intersecting_pairs == found.intersecting_pairs > 0
    assert found.normal_error > 1
    bad = strip.positions.copy()
    bad[4, 1] = np.nan
    with pytest.raises(native.NativeError, match='ertex 4'):
        native.measure(strip.positions, bad, strip.triangles, strip.roles)
    for bases, name in [((bad, strip.positions), r'^options\.base '),
                        ((strip.positions, bad), r'^options\.deformed_base ')]:
        with pytest.raises(native.NativeError, match=name):
            native.measure(strip.positions, scaled, strip.triangles, strip.roles, *bases)


def test_gradients_at_vertices(native, strip):
    turn = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]], np.float32)
    found = native.vertex_gradients(strip.positions, strip.positions @ turn.T + 5, strip.triangles)
    assert found.shape == (len(strip.positions), 3, 3) and np.abs(found - turn).max() < 1e-5
    bad = strip.positions.copy()
    bad[4, 1] = np.nan
    with pytest.raises(native.NativeError, match='ertex 4'):
        native.vertex_gradients(strip.positions, bad, strip.triangles)
    with pytest.raises(native.NativeError, match="deformed is for 3 vertices"):
        native.vertex_gradients(strip.positions, bad[:3], strip.triangles)


def test_distances_go_over_the_surface(native):
    # A strip folded back over itself: near in space, far along it.
    n = 21
    along = np.linspace(0, 1, n)
    x = np.concatenate([along, along[::-1]])
    z = np.repeat([0.0, 0.01], n)
    points = np.stack([np.repeat(x, 2), np.tile([0, 0.1], 2 * n), np.repeat(z, 2)], -1).astype(np.float32)
    triangles = np.array([t for i in range(2 * n - 1) for t in (
        (2 * i, 2 * i + 2, 2 * i + 3), (2 * i, 2 * i + 3, 2 * i + 1))], np.int32)
    sources = np.zeros(len(points), bool)
    sources[:2] = True
    points = np.vstack([points, [[9, 9, 9]]]).astype(np.float32)  # loose
    found = native.distances(points, triangles, np.append(sources, False))
    expected = np.repeat(np.concatenate([along, 1.01 + along]), 2)
    assert np.abs(found[:-1] - expected).max() < 1e-5
    assert np.isinf(found[-1])
    with pytest.raises(native.NativeError, match="sources is for 3 vertices, not 85"):
        native.distances(points, triangles, np.ones(3, bool))
