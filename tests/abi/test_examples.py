# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing by example through the C ABI."""

import ctypes

import numpy as np
import pytest

from conftest import IDENTITY, Strip, rotation


def bound(native, mesh, **options):
    return native.Bind(mesh.positions, mesh.triangles, mesh.roles, 1, **options).finish()


def posed_strip(native):
    mesh = Strip(60)
    bend = rotation(-0.9, (0, 0, 0))[0]
    beyond = mesh.positions[:, 0] > 30
    bent = mesh.positions.copy()
    pivot = np.float32([30, 0, 0])
    bent[beyond] = (bent[beyond] - pivot) @ bend[:, :3].T.astype(np.float32) + pivot
    lifted = mesh.positions + np.float32([0, 0, 0.4]) * np.clip(mesh.positions[:, :1] - 2, 0, None)
    matrix = bend.copy()
    matrix[:, 3] = pivot - bend[:, :3] @ pivot
    return mesh, np.stack([lifted, bent]), matrix[None]


def split(native, mesh, examples, matrix, steps):
    deformer = bound(native, mesh, examples=examples)
    return native.Update(deformer, matrix, steps=steps, turns=np.zeros((1, 3)), method='EXAMPLES').finish()


def test_examples_are_met_and_their_weights_told(native):
    mesh, examples, matrix = posed_strip(native)
    deformer = bound(native, mesh, examples=examples)
    assert (deformer.example_weights() == 0).all() and deformer.example_weights().shape == (2,)
    offsets = deformer.offsets(matrix, method='EXAMPLES', gradients='WHOLE').reshape(-1, 3)
    assert np.abs(mesh.positions + offsets - examples[1]).max() < 1e-4 * 60
    assert np.allclose(deformer.example_weights(), [0, 1], atol=1e-3)
    # Other methods neither use the examples nor change the weights.
    assert (deformer.offsets(matrix) == bound(native, mesh).offsets(matrix)).all()
    assert np.allclose(deformer.example_weights(), [0, 1], atol=1e-3)
    for weights in ([1, 0], [0, 1], [0, 0]):
        offsets = deformer.offsets(matrix, method='EXAMPLES', gradients='WHOLE',
                                   example_weights=weights).reshape(-1, 3)
        expected = [*examples, mesh.positions][[[1, 0], [0, 1], [0, 0]].index(weights)]
        assert np.abs(mesh.positions + offsets - expected).max() < 1e-3
        assert (deformer.example_weights() == weights).all()
    stiff = deformer.offsets(2 * matrix, method='EXAMPLES', example_stiffness=1e5).copy()
    assert np.abs(deformer.offsets(2 * matrix, method='EXAMPLES') - stiff).max() > 1e-2


def test_a_rigid_motion_of_all_handles_moves_the_result_rigidly(native):
    mesh, examples, matrix = posed_strip(native)
    mesh.roles[mesh.roles == -2] = 1  # nothing is fixed
    bind = native.Bind(mesh.positions, mesh.triangles, mesh.roles, 2, examples=examples)
    deformer, present = bind.finish(), np.concatenate([0.9 * matrix + 0.1 * IDENTITY, IDENTITY])
    present[0, :, 3] += [1, 2, 3]
    once = mesh.positions + deformer.offsets(present, method='EXAMPLES').reshape(-1, 3)
    turn = rotation(np.pi / 2, (5, -3, 1))[0]
    turned = np.concatenate([turn[:, :3] @ present[:, :, :3],
                             (turn[:, :3] @ present[:, :, 3:]) + turn[:, 3:]], axis=2)
    again = mesh.positions + deformer.offsets(turned, method='EXAMPLES').reshape(-1, 3)
    assert np.abs(again - (once @ turn[:, :3].T + turn[:, 3])).max() < 1e-5 * 60


def test_beyond_the_examples_refinement_and_stiffness_matter(native):
    mesh, examples, matrix = posed_strip(native)
    deformer = bound(native, mesh, examples=examples)
    matrix = matrix.copy()
    matrix[0, :, 3] += [-4, 3, 5]
    ways = {}, {'refine': 0}, {'example_stiffness': 1e-6}, {'rim_smoothing': 0}
    results = [deformer.offsets(matrix, method='EXAMPLES', **how).copy() for how in ways]
    for other in results[1:]:
        assert np.abs(other - results[0]).max() > 1e-4 * 60


def test_after_a_failed_update_there_are_no_weights(native):
    mesh, examples, matrix = posed_strip(native)
    deformer = bound(native, mesh, examples=examples)
    with pytest.raises(native.NativeError):
        deformer.offsets(np.full_like(matrix, 1e300), method='EXAMPLES')
    with pytest.raises(native.NativeError, match='no weights'):
        deformer.example_weights()
    deformer.offsets(matrix, method='EXAMPLES')
    assert np.allclose(deformer.example_weights(), [0, 1], atol=1e-2)


def test_posing_by_example_takes_one_step_only(native):
    mesh, examples, matrix = posed_strip(native)
    offsets, _ = split(native, mesh, examples, matrix, 1)
    assert (offsets == bound(native, mesh, examples=examples).offsets(matrix, method='EXAMPLES')).all()
    with pytest.raises(native.NativeError, match='one step'):
        split(native, mesh, examples, matrix, 2)


def test_unusable_examples_and_weights_are_refused(native, structs):
    mesh, examples, matrix = posed_strip(native)
    with pytest.raises(native.NativeError, match='options.examples.0. is for 472 vertices, not 480'):
        bound(native, mesh, examples=examples[:, :-8])
    broken = examples.copy()
    broken[1, 7, 2] = np.inf
    with pytest.raises(native.NativeError, match='Example 1 has a coordinate, of vertex 7,'):
        bound(native, mesh, examples=broken)
    deformer = bound(native, mesh, examples=examples)
    for weights, sentence in (([1.0], '1 example weights, but 2'), ([], '0 example weights'),
                              ([1, np.nan], 'Example 1 has a weight that is not finite')):
        with pytest.raises(native.NativeError, match=sentence):
            deformer.offsets(matrix, method='EXAMPLES', example_weights=weights)
    for limits, sentence in (([[0, 1]], 'limits of 1 examples, but 2'),
                             ([[0, 1], [0.1, 1]], 'Example 1 has limits'),
                             ([[0, -1], [0, 1]], 'Example 0 has limits'),
                             ([[0, 1], [0, np.nan]], 'Example 1 has limits'),
                             (np.zeros((1001, 2)), 'more than the examples can be')):
        with pytest.raises(native.NativeError, match=sentence):
            deformer.offsets(matrix, method='EXAMPLES', example_limits=limits)
    with pytest.raises(native.NativeError, match='options.examples.stiffness'):
        deformer.offsets(matrix, method='EXAMPLES', example_stiffness=-1.0)
    lib, out = native.library(), np.zeros(3)
    assert lib.dd_deformer_get_example_weights(deformer._handle, out, 3) == 1
    assert b'out is for 3 examples, not 2' in lib.dd_last_message()
    assert lib.dd_deformer_get_example_weights(None, out, 2) == 1
    surface, handle = structs.mesh(mesh.positions, mesh.triangles), ctypes.c_void_p()
    few = np.zeros((3, 8, 3), np.float32)
    for options in ({'example_count': 1001}, {'example_count': 2}, {'examples': few}):
        options = native.filled(structs.BindOptions, **options)
        assert lib.dd_deformer_bind_start(surface, mesh.roles, len(mesh.roles), 1, options, handle) == 1
        assert b'options.example' in lib.dd_last_message()
    assert not handle


def test_structs_from_before_examples_are_understood(native, structs, strip):
    surface = structs.mesh(strip.positions, strip.triangles)
    options = native.filled(structs.BindOptions, example_count=99)  # beyond struct_size, so ignored
    options.struct_size = structs.BindOptions.examples.offset
    job = ctypes.c_void_p()
    deformer = ctypes.c_void_p()
    lib = native.library()
    assert lib.dd_deformer_bind_start(surface, strip.roles, len(strip.roles), 1, options, job) == 0
    assert lib.dd_job_take_deformer(job, deformer) == 0
    lib.dd_job_free(job)
    broken = structs.ExamplesOptions(stiffness=-1)
    look = native.filled(structs.UpdateOptions, method='EXAMPLES', examples=broken)
    look.struct_size = structs.UpdateOptions.examples.offset
    out = np.zeros(strip.positions.size, np.float32)
    assert lib.dd_deformer_update(deformer, IDENTITY.copy(), 1, look, structs.points_out(out)) == 0
    lib.dd_deformer_free(deformer)
