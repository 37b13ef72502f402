# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice of method, the settings of each method, and the remarks in the status."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, bind, choose, evaluated, make_strip, members, open_fixture, own, update

METHODS = ('TRANSFER', 'VARIATIONAL', 'NORMAL', 'GRADIENT', 'VOLUMES')
TURN = Matrix.Translation((-0.2, 0, 0.4)) @ Matrix.Rotation(0.8, 4, 'Y')


@pytest.fixture
def strip():
    return bind(make_strip())


def pose(ob, motion=TURN):
    target = ob.detail_deform.handles[0].target
    target.matrix_world = motion @ target.matrix_world
    update()


def shown_with(ob, **settings):
    choose(ob, **settings)
    update()
    return evaluated(ob)


def test_switching_methods_shows_each_without_a_new_bind(strip):
    pose(strip)
    results = {method: shown_with(strip, method=method) for method in METHODS}
    assert strip.detail_deform.is_bound and not strip.detail_deform.stale
    for method, result in results.items():
        for other in METHODS:
            assert method == other or np.abs(result - results[other]).max() > 1e-3
        assert np.allclose(shown_with(strip, method=method), result, atol=0)


@pytest.mark.parametrize('method', METHODS)
def test_every_method_leaves_a_resting_surface_alone(strip, method):
    rest = own(strip)
    assert np.abs(shown_with(strip, method=method) - rest).max() <= 1e-6 * np.linalg.norm(np.ptp(rest, axis=0))


def test_refine_and_rotation_only_change_the_result_at_once(strip):
    pose(strip)
    refined = shown_with(strip, refine=4)
    linear = shown_with(strip, refine=0)
    assert np.abs(refined - linear).max() > 1e-3
    whole = shown_with(strip, rotation_only=False)
    assert np.abs(whole - linear).max() > 1e-3
    # Refinement carries rotations alone, so this setting doesn't matter to it.
    assert np.array_equal(shown_with(strip, refine=4), whole)
    assert np.array_equal(shown_with(strip, refine=0, rotation_only=True), linear)


def test_showing_the_base_and_back(strip):
    result = evaluated(strip)
    base = shown_with(strip, output='BASE')
    assert np.abs(base - result).max() > 1e-3
    # The base is smoother than the surface, by second differences.
    assert np.std(np.diff(base[:, 2], 2)) < 0.8 * np.std(np.diff(result[:, 2], 2))
    assert np.array_equal(shown_with(strip, output='RESULT'), result)


def test_levels_belong_to_normal_displacements(strip):
    pose(strip)
    one = shown_with(strip, method='NORMAL', levels=1)
    assert np.abs(shown_with(strip, levels=3) - one).max() > 1e-5


def test_smoothness_asks_for_a_new_bind_and_changes_the_base(strip):
    base = shown_with(strip, output='BASE')
    for order in (1, 3):
        shown_with(strip, smoothness=order)
        assert 'Re-bind' in strip.detail_deform.status
        bind(strip)
        assert np.abs(evaluated(strip) - base).max() > 1e-4
    shown_with(strip, smoothness=2)
    assert strip.detail_deform.stale  # its binding is for 3


def test_gradient_editing_says_that_a_moved_handle_turns_nothing(strip):
    strip.detail_deform.method = 'GRADIENT'
    update()
    assert 'turns nothing' not in strip.detail_deform.status
    pose(strip, Matrix.Translation((0, 0, 0.3)))
    assert "turns nothing where a handle is only moved, as 'right' is" in strip.detail_deform.status
    pose(strip)
    assert 'turns nothing' not in strip.detail_deform.status


def test_overhangs_are_counted_for_normal_displacements_only():
    ob = make_strip(n=41)
    values = own(ob)
    # A mushroom in the middle: the cap is wider than the stem.
    away = values[:, :2] - 0.5
    r = np.linalg.norm(away, axis=1) / 0.3
    s = 1 - r
    inside = s > 0
    radius = np.where(s < 0.4, 0.3 - 0.55 * s, 0.08 + 0.17 * np.sin((s - 0.4) / 0.6 * np.pi))
    scale = (radius * np.minimum(1, r / 0.1) / np.maximum(0.3 * r, 1e-9))[inside, None]
    values[inside, :2] = 0.5 + away[inside] * scale
    values[:, 2] = np.where(inside, 0.4 * s, 0)
    ob.data.vertices.foreach_set('co', values.astype(np.float32).ravel())
    ob.data.update()
    bind(ob)
    assert 'overhang' not in ob.detail_deform.status
    rest = evaluated(ob)
    assert np.abs(shown_with(ob, method='NORMAL') - rest).max() < 1e-5
    assert 'overhang the base' in ob.detail_deform.status
    shown_with(ob, method='TRANSFER')
    assert 'overhang' not in ob.detail_deform.status


def test_each_method_on_a_real_mesh_through_the_addon():
    ob = open_fixture('bumpy_plane')
    bind(ob)
    bpy.data.objects['Right'].location.z += 0.3
    update()
    held, region = members(ob, 'right'), members(ob, 'region')
    for method in METHODS:
        moved = shown_with(activate(ob), method=method) - own(ob)
        assert np.abs(moved[held] - (0, 0, 0.3)).max() < 1e-6 and not moved[~(held | region)].any(), method
        free = moved[region & ~held, 2]
        assert free.min() > -1e-3 and 0.29 < free.max() < 0.301, method


def test_the_status_says_how_well_volumes_are_kept(strip):
    pose(strip)
    shown_with(strip, method='VOLUMES')
    assert 'The result by Displacement Volumes is shown. Volumes are kept within' in strip.detail_deform.status
    shown_with(strip, volume_iterations=1, volume_tolerance=1e-5)
    assert 'stopped early' in strip.detail_deform.status
    shown_with(strip, steps=3, volume_iterations=50)
    assert 'by Displacement Volumes in 3 steps' in strip.detail_deform.status


def test_the_original_formulation_comes_close_to_the_surface_one(strip):
    pose(strip)
    surface = shown_with(strip, refine=0)
    size = np.ptp(surface)
    for formulation in ('FOURTH_POINTS', 'FOURTH_POINTS_UNWEIGHTED'):
        other = shown_with(strip, formulation=formulation)
        assert 1e-6 < np.abs(other - surface).max() / size < 0.02, formulation
