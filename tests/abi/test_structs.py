# SPDX-License-Identifier: GPL-3.0-or-later
"""What the Python layer hands to the library: arrays are checked before ctypes passes their addresses."""

import numpy as np
import pytest

from conftest import IDENTITY, Strip


@pytest.fixture
def strip():
    return Strip(8)


def test_indices_are_whole_numbers_that_fit(native, strip):
    """A cast would take 1.5 for 1, and 2³² + 1 for 1."""
    mesh = strip.positions, strip.triangles
    with pytest.raises(native.NativeError, match="roles has numbers of the type float64, where whole ones are needed"):
        native.Bind(*mesh, strip.roles + 0.5, 1)
    with pytest.raises(native.NativeError, match="triangles has a number that doesn't fit into 32 bits"):
        native.Bind(strip.positions, strip.triangles.astype(np.int64) + 2**32, strip.roles, 1)
    bound = native.Bind(*mesh, strip.roles.astype(np.int8), 1).finish()
    wide = native.Bind(strip.positions, strip.triangles.astype(np.uint64), strip.roles.tolist(), 1).finish()
    motion = IDENTITY + np.float64([0, 0, 0, 0.3])
    assert (bound.offsets(motion) == wide.offsets(motion)).all()


def test_positions_may_be_of_any_type(native, strip):
    bound = native.Bind(np.round(strip.positions).astype(np.int16), strip.triangles, strip.roles, 1).finish()
    assert np.isfinite(bound.offsets(IDENTITY)).all()


def test_a_field_that_there_is_not_is_named(native, strip, structs):
    with pytest.raises(TypeError, match="dd_bind_options has no field 'treads'"):
        native.Bind(strip.positions, strip.triangles, strip.roles, 1, treads=2)
    bound = native.Bind(strip.positions, strip.triangles, strip.roles, 1).finish()
    with pytest.raises(TypeError, match="dd_update_options has no field 'iterations'"):
        bound.offsets(IDENTITY, iterations=2)


def test_a_struct_shows_its_fields(native, strip):
    shown = repr(native.Bind(strip.positions, strip.triangles, strip.roles, 1).finish().info)
    assert shown.startswith("dd_deformer_info(") and f"vertex_count={len(strip.positions)}," in shown
