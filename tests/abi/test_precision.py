# SPDX-License-Identifier: GPL-3.0-or-later
"""How well handles' vertices meet their handle, wherever the mesh lies."""

import numpy as np
import pytest

from conftest import Strip, rotation

METHODS = ('DETAIL', 'VARIATIONAL', 'NORMAL', 'GRADIENT')


@pytest.mark.parametrize('folded', [False, True])
@pytest.mark.parametrize('boxes_away', [0, 1e3, 1e6])
def test_handles_vertices_meet_their_handle_far_from_the_origin(native, folded, boxes_away):
    strip = Strip()
    places = strip.positions.astype(float)
    if folded:  # flat onto itself
        places[:, 0] = np.minimum(places[:, 0], 24 - places[:, 0])
        places[:, 2] = 0
    away = boxes_away * np.linalg.norm(np.ptp(places, 0))
    places = (places + away * np.array([1, 0.7, -0.3])).astype(np.float32)
    box = np.linalg.norm(np.ptp(places.astype(float), 0))
    held = strip.roles == 0
    rest = places[held].astype(float)
    matrix = rotation(0.7, (1, 2, 3))
    matrix[0, :, 3] += rest.mean(0) - matrix[0, :, :3] @ rest.mean(0)
    wanted = rest @ matrix[0, :, :3].T + matrix[0, :, 3]
    deformer = native.Bind(places, strip.triangles, strip.roles, 1).finish()
    for method in METHODS:
        # Offsets have all digits of single precision. Positions so far away would have fewer.
        offsets = deformer.offsets(matrix, method=method).reshape(-1, 3)[held]
        assert np.abs(rest + offsets - wanted).max() < 2e-8 * box


@pytest.mark.parametrize('refine', [1, 4])
def test_a_handle_scaled_to_a_point_is_the_limit_of_ever_smaller_ones(native, strip, refine):
    centre = strip.positions[strip.roles == 0].astype(float).mean(0)
    deformer = native.Bind(strip.positions, strip.triangles, strip.roles, 1).finish()

    def scaled(factor):
        matrix = np.hstack([factor * np.eye(3), (1 - factor) * centre[:, None]])[None]
        return deformer.offsets(matrix, refine=refine).copy()

    # The collapsed triangles' rotations are rounding alone, which must not show.
    for factor in (1e-12, 1e-14, 1e-16):
        assert np.abs(scaled(factor) - scaled(0)).max() < 1e-4
    assert np.abs(scaled(1e-4) - scaled(0)).max() < 0.5
