# SPDX-License-Identifier: GPL-3.0-or-later
"""Soft Border: the deformation fades towards the region's border, continuously, and is exact at handles."""

import bpy
import numpy as np
import pytest

from conftest import activate, evaluated, members, own, pull, update


def lifted(soft_border, n=120, **settings):
    """(object, way, heights): a sheet whose middle is lifted by 0.4, and the heights along a line from the handle,
    where the way is 1, to the region's border, where it is 0."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=n, y_subdivisions=n)
    ob = bpy.context.active_object
    p = own(ob)
    for name, value in {'soft_border': soft_border, **settings}.items():
        setattr(ob.detail_deform, name, value)
    empty = pull(ob, np.linalg.norm(p[:, :2], axis=1) < 0.2, radius=0.6)
    empty.location.z += 0.4
    update()
    line = (np.abs(p[:, 1]) < 1e-4) & (p[:, 0] >= 0)
    x = p[line, 0]
    held, region = (members(ob, name)[line] for name in ("Handle", "Region"))
    way = (x[region].max() - x) / (x[region].max() - x[held].max())
    return ob, way[np.argsort(x)], (evaluated(ob) - p)[line, 2][np.argsort(x)]


def at(way, heights, place):
    return float(np.interp(place, way[::-1], heights[::-1]))


def test_without_a_soft_border_the_slope_at_the_border_vanishes_with_the_edge_length():
    """Because the base is clamped at the border."""
    slopes = []
    for n in (100, 200):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        _, way, heights = lifted(0.0, n)
        inside = (way > 0) & (way < 1)
        slopes.append(abs(np.diff(heights[inside])[-1] / np.diff(way[inside])[-1]) / 0.4)
    assert slopes[1] < 0.7 * slopes[0] < 0.35


def test_the_deformation_fades_and_handles_are_exact():
    before = lifted(0.0)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    after = lifted(1.0)
    for place in (0.05, 0.1, 0.25):
        assert 0 <= at(*after[1:], place) < 0.35 * at(*before[1:], place)
    assert at(*after[1:], 0.9) > 0.9 * at(*before[1:], 0.9)
    ob = after[0]
    moved = evaluated(ob) - own(ob)
    assert np.abs(moved[members(ob, "Handle")] - (0, 0, 0.4)).max() < 1e-5
    assert not moved[~members(ob, "Region")].any()
    heights = after[2]
    assert np.abs(np.diff(heights)).max() < 0.03  # continuous: of a height of 0.4 in some 40 edges
    assert (np.diff(heights[(after[1] > 0) & (after[1] < 1)]) < 1e-6).all()


def test_only_the_given_share_of_the_way_is_changed():
    _, way, plain = lifted(0.0)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    ob, _, narrow = lifted(0.3)
    inside = way > 0.31
    assert np.abs(narrow - plain)[inside].max() < 1e-6
    assert np.abs(narrow - plain)[~inside].max() > 0.01
    ob.detail_deform.soft_border = 0.0  # applies without a new Bind
    update()
    assert ob.detail_deform.is_bound
    line = (np.abs(own(ob)[:, 1]) < 1e-4) & (own(ob)[:, 0] >= 0)
    assert np.abs(np.sort((evaluated(ob) - own(ob))[line, 2]) - np.sort(plain)).max() < 1e-6


@pytest.mark.parametrize('settings', [{'method': 'VARIATIONAL'}, {'method': 'GRADIENT'}, {'smoothness': 1},
                                      {'steps': 3}])
def test_a_soft_border_with_any_method(settings):
    _, way, heights = lifted(0.8, n=40, **settings)
    assert abs(at(way, heights, 1.0) - 0.4) < 1e-4 and at(way, heights, 0.1) < 0.02


def test_the_next_pull_moves_nothing():
    ob, _, _ = lifted(0.8, n=60)
    before = evaluated(ob)
    pull(ob, np.linalg.norm(own(ob)[:, :2] - (0.5, 0), axis=1) < 0.1, radius=0.3)
    assert np.abs(evaluated(ob) - before).max() < 1e-6


def test_the_whole_mesh_has_no_border():
    ob, _, _ = lifted(0.8, n=40)
    ob.detail_deform.region = ""
    activate(ob)
    bpy.ops.object.detail_deform_bind(wait=True, keep_rest=True)
    update()
    assert np.abs(evaluated(ob) - own(ob) - (0, 0, 0.4)).max() < 1e-4
