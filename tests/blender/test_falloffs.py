# SPDX-License-Identifier: GPL-3.0-or-later
"""Falloff: within its reach, a handle's deformation may fall off by an energy of another order than the mesh's
Smoothness."""

import bpy
import numpy as np
import pytest

from conftest import activate, bind, evaluated, members, own, pull, select, update
from test_own_reach import bumpy, by_itself, disk, pose, two_pulls

FALLOFFS = {'SHARP': 1, 'SMOOTH': 2, 'SMOOTHER': 3}
MOTION = {'z': 0.15, 'turn': -0.4, 'about': (0.45, 0, 0)}


@pytest.mark.parametrize('falloff', FALLOFFS)
@pytest.mark.parametrize('of_mesh', [1, 2])
def test_a_falloff_is_its_smoothness_within_the_reach_alone(falloff, of_mesh):
    """The small handle's reach deforms like a sheet of that smoothness with the reach as its region. The large handle
    goes by the mesh's smoothness."""
    ob, large, small, reach = two_pulls(smoothness=of_mesh)
    p, core = own(ob), members(ob, "Handle.001")
    pose(large, z=0.1)
    without = evaluated(ob)
    pose(large, z=-0.1)
    ob.detail_deform.handles[1].falloff = falloff
    bind(ob)
    pose(small, **MOTION)
    found = evaluated(ob) - p
    assert np.abs(found - by_itself(reach, [(core, MOTION)], smoothness=FALLOFFS[falloff])).max() < 2e-4 * np.sqrt(8)
    assert not found[~reach].any()
    activate(ob)
    pose(small, **{**MOTION, 'z': -0.15, 'turn': 0.4})
    pose(large, z=0.1)
    assert np.abs(evaluated(ob) - without)[~reach].max() < 1e-6


def test_each_falloff_has_another_shape():
    """Compares the heights, as fractions of the handle's, at a quarter and at three quarters of the way from the handle
    to the border of its reach."""
    heights = {}
    for falloff in ('MESH', *FALLOFFS):
        ob = bumpy(80)
        pull(ob, disk(ob, -0.8, 0, 0.1), radius=0.1)
        small = pull(ob, disk(ob, 0.3, 0, 0.1), radius=0.6)
        ob.detail_deform.handles[1].falloff = falloff
        bind(ob)
        pose(small, z=0.1)
        way = (np.linalg.norm(own(ob)[:, :2] - (0.3, 0), axis=1) - 0.1) / 0.6
        up = (evaluated(ob) - own(ob))[:, 2] / 0.1
        heights[falloff] = np.array([up[np.abs(way - part) < 0.03].mean() for part in (0.25, 0.75)])
    assert np.abs(heights['MESH'] - heights['SMOOTH']).max() < 1e-5  # the mesh's Smoothness is 2
    assert (heights['SHARP'] < heights['SMOOTH'] - 0.03)[0] and heights['SHARP'][0] < 0.7
    assert heights['SMOOTHER'][0] > heights['SMOOTH'][0] + 0.01 and heights['SMOOTHER'][1] < heights['SMOOTH'][1] - 0.01


def test_a_change_waits_for_bind_and_bind_keeps_the_pose_of_others():
    ob, large, _, reach = two_pulls()
    pose(large, z=0.1)
    before, signature = evaluated(ob), ob.detail_deform.signature
    ob.detail_deform.handles[1].falloff = 'SHARP'
    assert "were changed since Bind. Press Re-bind" in ob.detail_deform.status, ob.detail_deform.status
    bpy.ops.object.detail_deform_bind(keep_rest=True)
    assert ob.detail_deform.signature != signature
    update()
    assert np.abs(evaluated(ob) - before)[~reach].max() < 1e-6
    ob.detail_deform.handles[1].falloff = 'MESH'
    bpy.ops.object.detail_deform_bind(keep_rest=True)
    assert ob.detail_deform.signature == signature


def test_without_a_reach_a_falloff_changes_nothing():
    ob, _, _, _ = two_pulls()
    ob.detail_deform.handles[0].falloff = 'SHARP'
    bpy.ops.object.detail_deform_bind(keep_rest=True)
    assert not ob.detail_deform.stale and "Bound" in ob.detail_deform.status


def pulled(ob, x, falloff, radius=0.2):
    activate(ob)
    select(ob, disk(ob, x, 0, 0.1))
    assert bpy.ops.object.detail_deform_pull(radius=radius, falloff=falloff) == {'FINISHED'}
    return ob.detail_deform.handles[-1]


def test_pull_sets_the_falloff():
    """The first Pull's falloff becomes the mesh's Smoothness. A pull that shares another handle's reach takes that
    handle's falloff."""
    ob = bumpy()
    assert pulled(ob, -0.5, 'SHARP').falloff == 'MESH' and ob.detail_deform.smoothness == 1
    assert pulled(ob, 0.0, 'SMOOTHER').falloff == 'SMOOTHER' and ob.detail_deform.smoothness == 1
    shared = pulled(ob, 0.3, 'SMOOTH', radius=0.4)
    assert shared.falloff == 'SMOOTHER' and shared.reach == ob.detail_deform.handles[1].reach
    assert pulled(ob, 0.8, 'MESH', radius=0.1).falloff == 'MESH'
    assert pulled(ob, -0.2, 'SMOOTH', radius=0.3).reach == "" and ob.detail_deform.smoothness == 1


def test_a_mirrored_handle_falls_off_alike():
    ob = bumpy()
    pull(ob, disk(ob, 0, 0.8, 0.1), radius=0.1)
    pulled(ob, 0.5, 'SHARP')
    activate(ob)
    ob.detail_deform.handle_index = 1
    assert bpy.ops.object.detail_deform_handle_mirror(axis='X') == {'FINISHED'}
    assert ob.detail_deform.handles[2].falloff == 'SHARP'
    bpy.ops.object.detail_deform_bind(keep_rest=True)
    p = own(ob)
    for handle in list(ob.detail_deform.handles)[1:]:
        handle.target.location.z += 0.1
    update()
    moved = evaluated(ob) - p
    image = np.linalg.norm(p[:, None, :2] * (-1, 1) - p[:, :2], axis=2).argmin(1)
    assert np.abs(moved).max() > 0.09 and np.abs(moved[image][:, 2] - moved[:, 2]).max() < 0.01


def test_a_first_pull_that_is_cancelled_leaves_the_smoothness(part):
    ob = bumpy()
    for count in range(1, 5):
        select(ob, disk(ob, 0.3, 0, 0.1))
        stages = part('setup.pulling').Pull(bpy.context, ob, 0.3, falloff='SHARP').stages(wait=False, watch=True)
        for _ in range(count):
            next(stages)
        stages.close()
        bpy.ops.object.mode_set(mode='OBJECT')
        assert ob.detail_deform.smoothness == 2 and not ob.detail_deform.handles
