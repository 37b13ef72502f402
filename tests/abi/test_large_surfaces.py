# SPDX-License-Identifier: GPL-3.0-or-later
"""From 200,000 free vertices on, single precision has one factor on the surface; double precision has all of them."""

import numpy as np
import pytest
from conftest import IDENTITY, is_sanitized, rotation, sheet

MOTION = rotation(0.7, (0.1, 0.2, 0.3))


@pytest.mark.skipif(is_sanitized(), reason="a bind of 211,600 vertices takes minutes there")
def test_a_large_surface_is_near_its_result_in_double_precision(native):
    mesh = sheet(460)
    assert (mesh[2] == -1).sum() > 200_000
    box = np.linalg.norm(np.ptp(mesh[0], axis=0))
    exact = native.Bind(*mesh, 1, precision='DOUBLE').finish()
    wanted = exact.offsets(MOTION).copy()
    large = native.Bind(*mesh, 1, threads=2).finish()
    assert np.abs(large.offsets(IDENTITY)).max() < 1e-7
    found = large.offsets(MOTION).copy()
    assert np.abs(found).max() > 0.2 * box
    apart = np.linalg.norm((found - wanted).reshape(-1, 3), axis=1) / box
    assert 0 < np.quantile(apart, 0.99) < 2e-4 and apart.max() < 1e-3
    assert (native.Bind(*mesh, 1, threads=1).finish().offsets(MOTION) == found).all()
