# SPDX-License-Identifier: GPL-3.0-or-later
"""All vertices that a refusal, or a fact about a bound surface, is about. The message names one of them."""

import ctypes

import numpy as np
import pytest

FINDINGS = ('RESTING', 'LOOSE', 'DEGENERATE', 'UNREPRESENTED', 'FAR', 'TORN')


def refused(native, mesh, **changed):
    given = {'positions': mesh.positions, 'triangles': mesh.triangles, 'roles': mesh.roles, **changed}
    with pytest.raises(native.NativeError) as caught:
        native.Bind(given['positions'], given['triangles'], given['roles'], 1).finish()
    return caught.value


@pytest.mark.parametrize('value', [np.nan, -np.inf, 1e35])
def test_a_refusal_has_all_vertices_of_its_kind(native, strip, value):
    positions = strip.positions.copy()
    positions[[5, 60, 100], 1] = value
    error = refused(native, strip, positions=positions)
    assert str(error).startswith("Vertex 5 ")
    assert error.vertices.tolist() == [5, 60, 100]


def test_corners_of_all_triangles_that_use_one_twice(native, strip):
    triangles = strip.triangles.copy()
    triangles[[3, 20], 1] = triangles[[3, 20], 0]
    error = refused(native, strip, triangles=triangles)
    assert "Triangle 3 uses one vertex twice" in str(error)
    assert set(error.vertices) == set(triangles[[3, 20]].ravel())


def test_a_refusal_about_roles_lists_no_vertices(native, strip):
    assert len(refused(native, strip, roles=np.full_like(strip.roles, -2)).vertices) == 0


def test_what_a_bound_surface_found(native, strip):
    count = len(strip.positions)
    part = np.array([[50, 0, 0], [51, 0, 0], [50, 1, 0]], np.float32)
    positions = np.vstack([strip.positions, part, [[70, 0, 0], [71, 0, 0]]]).astype(np.float32)
    triangles = np.vstack([strip.triangles, [[count, count + 1, count + 2]]]).astype(np.int32)
    flat = 40
    positions[triangles[flat]] = positions[triangles[flat, 0]]
    deformer = native.Bind(positions, triangles, np.r_[strip.roles, np.full(5, -1)], 1).finish()
    info = deformer.info
    found = {finding: deformer.vertices(finding).tolist() for finding in FINDINGS}
    assert found['RESTING'] == [count, count + 1, count + 2] and info.resting_count == 3
    assert found['LOOSE'] == [count + 3, count + 4] and info.loose_count == 2
    assert set(triangles[flat]) <= set(found['DEGENERATE'])
    assert len(set(found['DEGENERATE'])) == len(found['DEGENERATE'])
    assert info.degenerate_count > 0 and info.far_count == info.torn_count == 0
    assert found['FAR'] == found['TORN'] == found['UNREPRESENTED'] == []


def test_what_is_far_from_a_base_and_between_its_parts(native, strip):
    lift = np.float32([0, 0, 20])
    base = np.vstack([strip.positions[:24] + lift, strip.positions[-24:] + lift])
    corners = strip.triangles[(strip.triangles < 24).all(1)]
    deformer = native.Bind(strip.positions, strip.triangles, strip.roles, 1, base=base,
                           base_triangles=np.vstack([corners, corners + 24])).finish()
    assert deformer.info.far_count == len(deformer.vertices('FAR')) > 0
    assert deformer.info.torn_count == len(deformer.vertices('TORN')) > 0
    assert deformer.info.far_example == deformer.vertices('FAR')[0]


def test_arguments_are_checked(native, strip, structs):
    lib, count, out = native.library(), ctypes.c_size_t(), np.zeros(1, np.int32)
    deformer = native.Bind(np.vstack([strip.positions, [[9, 9, 9]] * 2]).astype(np.float32), strip.triangles,
                           np.r_[strip.roles, -1, -1], 1).finish()
    argument = structs.STATUS['ERROR_ARGUMENT']
    loose = structs.FINDINGS['LOOSE']
    assert lib.dd_deformer_get_vertices(deformer._handle, loose, out, 1, count) == argument
    assert b"capacity is 1, but there are 2" in lib.dd_last_message()
    assert lib.dd_deformer_get_vertices(deformer._handle, 6, None, 0, count) == argument
    assert lib.dd_deformer_get_vertices(deformer._handle, loose, None, 0, None) == argument
    assert lib.dd_deformer_get_vertices(None, loose, None, 0, count) == argument
    assert lib.dd_job_get_vertices(None, None, 0, count) == argument
