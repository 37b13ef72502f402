# SPDX-License-Identifier: GPL-3.0-or-later
"""The C ABI beside binding and deforming: measures of a deformation, distances and gradients."""

import numpy as np
import pytest


def test_measures_of_a_deformation(native, strip):
    scaled = strip.positions * np.float32(2)
    found = native.measure(strip.positions, scaled, strip.triangles, strip.roles)
    assert found.intersecting_pairs == 0 and found.normal_error == 0
    assert found.stretch == pytest.approx(2 ** 0.5, rel=1e-5)
    assert found.area_ratio == pytest.approx(4, rel=1e-5)
    # Folded so that its two ends pass through each other.
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
