# SPDX-License-Identifier: GPL-3.0-or-later
"""A handle with its own reach moves nothing beyond it, and keeps its place while other handles move."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import (activate, add_empty, bind, choose, data_blocks, evaluated, group, members, own, pull, refusal,
                      symmetric, update)


def bumpy(n=40):
    """A square of two units with bumps."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=n, y_subdivisions=n)
    ob = bpy.context.active_object
    p = own(ob)
    p[:, 2] = 0.03 * np.cos(20 * p[:, 0]) * np.sin(20 * p[:, 1])
    ob.data.vertices.foreach_set('co', p.astype(np.float32).ravel())
    ob.data.update()
    update()
    return ob


def disk(ob, x, y, radius):
    return np.linalg.norm(own(ob)[:, :2] - (x, y), axis=1) < radius


def two_pulls(**settings):
    """(object, large empty, small empty, (n,) mask of the small one's reach): a large pull, and a small one within its
    region."""
    ob = bumpy()
    choose(ob, **settings)
    large = pull(ob, disk(ob, 0, 0, 0.2), radius=0.9)
    small = pull(ob, disk(ob, 0.45, 0, 0.1), radius=0.2)
    return ob, large, small, members(ob, "Reach")


def pose(empty, x=0.0, y=0.0, z=0.0, turn=0.0, about=(0, 0, 0)):
    back, there = Matrix.Translation(about).inverted(), Matrix.Translation(np.add((x, y, z), about))
    empty.matrix_world = there @ Matrix.Rotation(turn, 4, 'Y') @ back @ empty.matrix_world
    update()


def by_itself(region, handles, groups=(), **settings):
    """Offsets of a new sheet that is bound with this region alone. handles: [(mask, motion of its empty or None)].
    groups: [(name, vertices)] of others."""
    ob = bumpy()
    choose(ob, **settings)
    group(ob, 'region', np.flatnonzero(region))
    ob.detail_deform.region = 'region'
    for name, vertices in groups:
        group(ob, name, vertices)
    p, empties = own(ob), []
    for number, (chosen, _) in enumerate(handles):
        group(ob, f'H{number}', np.flatnonzero(chosen))
        empties.append(add_empty(f'E{number}', p[chosen].mean(axis=0)))
        handle = ob.detail_deform.handles.add()
        handle.name = handle.vertex_group = f'H{number}'
        handle.target = empties[-1]
    update()
    activate(ob)
    bind(ob)
    for empty, (_, motion) in zip(empties, handles):
        if motion:
            pose(empty, **motion)
    return evaluated(ob) - p


def test_a_handle_moves_the_vertices_within_its_reach_alone():
    ob, _, small, reach = two_pulls()
    before = evaluated(ob)
    pose(small, z=0.2, turn=0.5, about=(0.45, 0, 0))
    moved = np.linalg.norm(evaluated(ob) - before, axis=1)
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    assert not moved[~reach].any() and (moved[reach] > 1e-5).mean() > 0.9
    core = members(ob, "Handle.001")
    assert (reach & ~core).sum() > 50 and moved[core].min() > 0.14
    assert reach.sum() < 0.3 * members(ob, "Region").sum()


SETTINGS = {
    'default': {}, 'no refinement': {'refine': 0}, 'normal': {'method': 'NORMAL'}, 'gradient': {'method': 'GRADIENT'},
    'smoothness 3': {'smoothness': 3}, 'base metric': {'base_metric': 'BASE'}, 'steps': {'steps': 3},
    'volumes': {'method': 'VOLUMES'}, 'soft': {'soft_border': 0.5}, 'linear': {'base_deformer': 'LINEAR'}}


@pytest.mark.parametrize('name', SETTINGS)
def test_a_reach_deforms_like_a_region_of_its_own(name):
    ob, _, small, reach = two_pulls(**SETTINGS[name])
    p, core = own(ob), members(ob, "Handle.001")
    motion = {'z': 0.15, 'turn': -0.4, 'about': (0.45, 0, 0)}
    pose(small, **motion)
    found = evaluated(ob) - p
    # A fraction of the sheet's diagonal. Not to rounding, because the solves depend on the mean edge length and the
    # bounding box, and these are those of the part around the reach here, and of the whole sheet there.
    assert np.abs(found - by_itself(reach, [(core, motion)], **SETTINGS[name])).max() < 2e-4 * np.sqrt(8)


@pytest.mark.parametrize('name', [name for name in SETTINGS if name != 'base metric'])  # not exact for rigid motions
def test_a_reach_goes_along_with_a_rigid_motion_of_the_large_handle(name):
    """The small handle deforms its reach, then both handles move rigidly: so does the deformed surface."""
    ob = bumpy()
    choose(ob, **SETTINGS[name])
    large = pull(ob, disk(ob, 0, 0, 0.2), radius=9.0)
    small = pull(ob, disk(ob, 0.6, 0, 0.1), radius=0.2)
    assert ob.detail_deform.handles[1].reach and members(ob, "Region").all()
    p, rest = own(ob), small.matrix_world.copy()
    pose(small, z=0.15, turn=-0.4, about=(0.6, 0, 0))
    alone = evaluated(ob)
    assert np.abs(alone - p).max() > 0.14
    whole = Matrix.Translation((0.3, 0.2, 0.5)) @ Matrix.Rotation(0.5, 4, 'X') @ Matrix.Rotation(0.3, 4, 'Z')
    for empty in (large, small):
        empty.matrix_world = whole @ empty.matrix_world
    update()
    there = np.array(whole)
    assert np.abs(evaluated(ob) - (alone @ there[:3, :3].T + there[:3, 3])).max() < 2e-4
    # With the large handle moved alone, the small one's vertices stay with their empty, and the others move.
    small.matrix_world = rest
    update()
    found, core, reach = evaluated(ob), members(ob, "Handle.001"), members(ob, "Reach")
    assert np.abs((found - p)[core]).max() < 2e-4
    assert np.abs(found - (p @ there[:3, :3].T + there[:3, 3]))[~(reach | core)].max() < 2e-4


def test_while_the_surface_bends_the_mean_of_a_handles_vertices_follows_its_empty():
    ob, large, small, _ = two_pulls()
    p, core, rest = own(ob), members(ob, "Handle.001"), small.matrix_world.copy()
    pose(large, z=0.5, turn=0.5)
    for height in (0.0, 0.2, 0.4):
        small.matrix_world = Matrix.Translation((0, 0, height)) @ rest
        update()
        assert np.abs((evaluated(ob) - p)[core].mean(axis=0) - (0, 0, height)).max() < 0.01


def test_by_examples_the_region_mixes_them_and_a_reach_does_not():
    ob = bumpy()
    p = own(ob)
    ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="Hill")
    key.value = 0.0  # Blender 5.2 adds keys with the value 1
    hill = p + np.exp(-4 * (p[:, :2] ** 2).sum(axis=1))[:, None] * (0, 0, 0.5)
    key.data.foreach_set('co', hill.astype(np.float32).ravel())
    activate(ob)
    assert bpy.ops.object.detail_deform_examples_from_keys() == {'FINISHED'}
    ob.detail_deform.method = 'EXAMPLES'
    large = pull(ob, disk(ob, 0, 0, 0.2), radius=0.9)
    small = pull(ob, disk(ob, 0.45, 0, 0.1), radius=0.2)
    reach = members(ob, "Reach")
    before = evaluated(ob)
    pose(small, z=0.2)
    assert not (evaluated(ob) - before)[~reach].any()
    pose(large, z=0.4)
    assert ob.detail_deform.examples[0].found_weight > 0.3
    core = members(ob, "Handle.001")
    assert (evaluated(ob) - p)[core, 2].mean() == pytest.approx(0.2, abs=0.01)


def test_a_pull_that_reaches_another_handle_shares_its_region():
    ob = bumpy()
    pull(ob, disk(ob, 0, 0, 0.2), radius=0.5)
    pull(ob, disk(ob, 0.45, 0, 0.1), radius=0.4)
    assert "Reach" not in ob.vertex_groups and not any(handle.reach for handle in ob.detail_deform.handles)
    assert members(ob, "Region")[disk(ob, 0.45, 0, 0.3)].all()


def test_a_reach_may_be_outside_the_first_handles_region():
    ob = bumpy()
    pull(ob, disk(ob, 0, 0, 0.2), radius=0.3)
    region = members(ob, "Region")
    small = pull(ob, disk(ob, 0.6, 0, 0.1), radius=0.2)
    assert (members(ob, "Region") == region).all() and (members(ob, "Reach") & ~region).any()
    pose(small, z=0.2)
    assert np.abs(evaluated(ob) - own(ob))[members(ob, "Handle.001"), 2] == pytest.approx(0.2, abs=1e-5)


def test_both_sides_of_a_symmetric_pull_share_one_reach():
    ob = symmetric(41)
    ob.data.use_mirror_x = True
    pull(ob, disk(ob, 0, 0.35, 0.07), radius=0.15)
    empty = pull(ob, disk(ob, 0.15, -0.15, 0.05), radius=0.1)
    assert {handle.reach for handle in list(ob.detail_deform.handles)[-2:]} == {"Reach"}
    p = own(ob)
    pose(empty, x=0.02, z=0.1, turn=0.3, about=p[disk(ob, 0.15, -0.15, 0.05)].mean(axis=0))
    found = evaluated(ob)
    order = np.lexsort((p[:, 1].round(4), p[:, 0].round(4))), np.lexsort((p[:, 1].round(4), (-p[:, 0]).round(4)))
    assert np.abs(found[order[0]] - found[order[1]] * (-1, 1, 1)).max() < 1e-5 and np.abs(found - p).max() > 0.09


def test_a_handle_mirrored_by_the_panel_reaches_as_far():
    ob = bumpy()
    pull(ob, disk(ob, 0, 0.7, 0.15), radius=0.3)
    pull(ob, disk(ob, 0.45, -0.3, 0.1), radius=0.2)
    activate(ob)
    ob.detail_deform.handle_index = 1
    assert bpy.ops.object.detail_deform_handle_mirror(axis='X') == {'FINISHED'}
    bind(ob)
    made = ob.detail_deform.handles[2]
    assert made.reach == "Reach" and members(ob, "Reach")[disk(ob, -0.45, -0.3, 0.2)].all()
    pose(made.target, z=0.2)
    moved = np.abs(evaluated(ob) - own(ob)).max(axis=1)
    assert moved[members(ob, made.vertex_group)].min() > 0.19 and not moved[own(ob)[:, 0] > 0].any()


def test_a_group_of_the_users_is_a_reach_and_stays_when_mirrored():
    ob, _, small, _ = two_pulls()
    group(ob, 'Mine', np.flatnonzero(disk(ob, 0.45, 0, 0.25)))
    activate(ob)
    ob.detail_deform.handles[1].reach = 'Mine'
    assert "Re-bind" in ob.detail_deform.status
    bind(ob, keep_rest=True)
    pose(small, z=0.2)
    moved = np.abs(evaluated(ob) - own(ob)).max(axis=1)
    assert not moved[~members(ob, 'Mine')].any()
    activate(ob)
    ob.detail_deform.handle_index = 1
    before = members(ob, 'Mine')
    bpy.ops.object.detail_deform_handle_mirror(axis='X')
    assert (members(ob, 'Mine') == before).all()
    assert {handle.reach for handle in ob.detail_deform.handles} == {"", "Reach"}
    assert members(ob, "Reach")[before].all() and members(ob, "Reach")[disk(ob, -0.45, 0, 0.2)].all()


def test_a_handle_without_its_reach_goes_by_the_region():
    ob, _, small, reach = two_pulls()
    ob.detail_deform.handles[1].reach = ''
    activate(ob)
    bind(ob, keep_rest=True)
    pose(small, z=0.2)
    moved = np.abs(evaluated(ob) - own(ob)).max(axis=1)
    assert moved[~reach].max() > 0.01


def test_renamed_and_deleted_groups():
    ob, _, small, reach = two_pulls()
    ob.vertex_groups["Reach"].name = "Nose"
    update()
    pose(small, z=0.2)
    assert ob.detail_deform.handles[1].reach == "Nose" and ob.detail_deform.is_bound, ob.detail_deform.status
    assert not (evaluated(ob) - own(ob))[~reach].any()
    ob.vertex_groups.remove(ob.vertex_groups["Nose"])
    pose(small, z=0.1)
    assert "its reach refers to the vertex group 'Nose'" in ob.detail_deform.status
    assert "Handle.001" in ob.detail_deform.status


def test_removing_a_handle_removes_its_groups():
    ob, _, _, _ = two_pulls()
    activate(ob)
    ob.detail_deform.handle_index = 1
    assert bpy.ops.object.detail_deform_handle_remove() == {'FINISHED'}
    assert {g.name for g in ob.vertex_groups} == {"Handle", "Region"}


def test_remove_all_leaves_nothing():
    ob = bumpy()
    before = data_blocks()
    pull(ob, disk(ob, 0, 0, 0.2), radius=0.9)
    pull(ob, disk(ob, 0.45, 0, 0.1), radius=0.2)
    activate(ob)
    bpy.ops.object.detail_deform_remove()
    assert data_blocks() == before and not ob.vertex_groups


def test_reaches_are_saved_and_loaded(tmp_path):
    ob, large, small, _ = two_pulls()
    pose(large, z=0.3)
    pose(small, z=0.2)
    expected, name = evaluated(ob), ob.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'saved.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'saved.blend'))
    ob = bpy.data.objects[name]
    update()
    assert np.abs(evaluated(ob) - expected).max() < 1e-6
    pose(ob.detail_deform.handles[1].target, z=0.1)
    assert ob.detail_deform.is_bound and np.abs(evaluated(ob) - expected).max() == pytest.approx(0.1, abs=5e-3)


def test_all_back_to_rest_and_a_pose_of_both():
    """After the return to rest, both handles' vertices follow their empties' motions from there."""
    ob, large, small, _ = two_pulls()
    p = own(ob)
    pose(large, z=0.3)
    pose(small, z=0.2)
    activate(ob)
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert np.abs(evaluated(ob) - p).max() < 1e-5
    pose(large, z=0.3)
    pose(small, z=0.2)
    found = evaluated(ob) - p
    assert np.abs(found[members(ob, "Handle")] - (0, 0, 0.3)).max() < 1e-4
    assert np.abs(found[members(ob, "Handle.001")].mean(axis=0) - (0, 0, 0.2)).max() < 0.01


def test_a_third_within_the_second_and_many():
    ob, _, small, reach = two_pulls()
    third = pull(ob, disk(ob, 0.6, 0, 0.04), radius=0.06)
    inner = members(ob, "Reach.001")
    assert (inner & reach).any() and not (inner & members(ob, "Handle.001")).any()
    before = evaluated(ob)
    pose(third, z=0.05)
    assert not (evaluated(ob) - before)[~inner].any()
    pose(small, z=0.1)
    held = members(ob, "Handle.002")
    assert np.abs((evaluated(ob) - before)[held].mean(axis=0) - (0, 0, 0.05)).max() < 0.01


def test_the_displayed_base_includes_the_reaches():
    ob, _, small, reach = two_pulls()
    ob.detail_deform.output = 'BASE'
    update()
    rest = evaluated(ob)
    pose(small, z=0.2)
    moved = np.abs(evaluated(ob) - rest).max(axis=1)
    assert moved[reach].max() == pytest.approx(0.2, abs=1e-3) and moved[~reach].max() < 1e-6
    assert np.abs(rest - own(ob)).max() > 0.01


def test_drafts_of_parts_stand_in_until_all_are_bound(part):
    """The job of all parts has a draft once each part has a draft or is done."""
    reaches, native, PartsJob = part('follow.reaches'), part('library.native'), part('follow.parts_job').PartsJob
    n = 420
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    p = np.stack([x.ravel(), y.ravel(), 0.02 * np.sin(20 * x.ravel())], axis=1).astype(np.float32)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    triangles = np.concatenate([a[:, None] + (0, 1, n), a[:, None] + (1, n + 1, n)]).astype(np.int32)
    away = [np.linalg.norm(p[:, :2] - middle, axis=1) for middle in ((0, 0), (0.5, 0))]
    whole = np.where(away[0] < 0.9, -1, -2).astype(np.int32)
    whole[away[0] < 0.2], whole[away[1] < 0.1] = 0, -2
    small = np.where(away[1] < 0.25, -1, -2).astype(np.int32)
    small[away[1] < 0.1] = 0
    moves = np.flatnonzero(small != -2)
    parts = [reaches.Part(np.array([0]), p, triangles, whole),
             reaches.Surface(p, triangles).part(np.array([1]), moves, small[moves])]
    assert len(parts[1].positions) < len(p) / 10
    jobs = [native.Bind(*each.bind_arguments(), draft=True) for each in parts]
    job, draft = PartsJob(parts, jobs, len(p)), None
    while draft is None:
        running, _, _ = job.progress()
        draft = job.draft()
        assert draft or running
    made = job.finish()
    assert draft.is_draft and not made.is_draft
    motions = np.repeat(np.eye(4)[None, :3], 2, axis=0)
    motions[:, 2, 3] = 0.4, 0.2
    quick, exact = (each.offsets(motions, turns=np.zeros((2, 3))).reshape(-1, 3) for each in (draft, made))
    assert np.abs(quick - exact).max() < 0.02 and np.abs(exact).max() == pytest.approx(0.4)
    core = away[1] < 0.1
    for moved in (exact, made.update(motions, turns=np.zeros((2, 3))).finish()[0].reshape(-1, 3)):
        assert np.abs(moved[whole == 0] - (0, 0, 0.4)).max() < 1e-6
        assert not moved[(whole == -2) & (small == -2)].any()
        assert np.abs(moved[core].mean(axis=0) - (0, 0, 0.2)).max() < 0.01  # each turns with the surface


def test_one_pull_after_the_other(part, monkeypatch):
    """Six pulls, each with its own reach: each handle's vertices stay where they were moved, and a later pull reads
    vertex groups no more often than the second."""
    ob = bumpy(50)
    pull(ob, disk(ob, -0.8, -0.8, 0.1), radius=2.0)
    mesh_data, counts = part('scene.mesh_data'), []
    entries = mesh_data.group_entries
    for number in range(6):
        x, y = (number % 3) * 0.5 - 0.4, (number // 3) * 0.6 - 0.2
        reads = []
        monkeypatch.setattr(mesh_data, 'group_entries', lambda *asked, to=reads: to.append(asked) or entries(*asked))
        empty = pull(ob, disk(ob, x, y, 0.06), radius=0.1)
        monkeypatch.undo()
        counts.append(len(reads))
        pose(empty, z=0.02 * (number + 1))
    found = [len(ob.detail_deform.handles), len({handle.reach for handle in ob.detail_deform.handles})]
    assert found == [7, 7] and ob.detail_deform.is_bound
    moved = evaluated(ob) - own(ob)
    for number in range(6):
        core = members(ob, ob.detail_deform.handles[1 + number].vertex_group)
        assert np.abs(moved[core] - (0, 0, 0.02 * (number + 1))).max() < 1e-4
    assert 0 < counts[-1] <= counts[1]


# ---- together with other settings

def with_hill(ob):
    p = own(ob)
    ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="Hill")
    key.value = 0.0
    hill = p + np.exp(-4 * (p[:, :2] ** 2).sum(axis=1))[:, None] * (0, 0, 0.5)
    key.data.foreach_set('co', hill.astype(np.float32).ravel())
    activate(ob)
    bpy.ops.object.detail_deform_examples_from_keys()
    ob.detail_deform.method = 'EXAMPLES'


@pytest.mark.parametrize('has_reach', [False, True])
def test_sliders_of_examples_deform_with_all_handles_at_rest(has_reach):
    ob = bumpy()
    with_hill(ob)
    pull(ob, disk(ob, 0, 0, 0.2), radius=0.9)
    if has_reach:
        pull(ob, disk(ob, 0.45, 0, 0.1), radius=0.2)
    ob.detail_deform.weights_by = 'SLIDERS'
    ob.detail_deform.examples[0].weight = 0.7
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() > 0.3


def test_found_weights_are_those_of_the_present_pose():
    ob = bumpy()
    with_hill(ob)
    large = pull(ob, disk(ob, 0, 0, 0.2), radius=0.9)
    pull(ob, disk(ob, 0.45, 0, 0.1), radius=0.2)
    rest = large.matrix_world.copy()
    pose(large, z=0.4)
    assert ob.detail_deform.examples[0].found_weight > 0.3
    large.matrix_world = rest
    update()
    assert abs(ob.detail_deform.examples[0].found_weight) < 1e-4


@pytest.mark.parametrize('degrees', [170, 190, 360, 540, 720])
def test_handles_turned_together_by_more_than_half_a_turn_are_rigid(degrees):
    ob = bumpy()
    large = pull(ob, disk(ob, 0, 0, 0.2), radius=9.0)
    small = pull(ob, disk(ob, 0.6, 0, 0.1), radius=0.2)
    p, turn = own(ob), Matrix.Rotation(np.radians(degrees), 4, 'Z')
    for empty in (large, small):
        empty.matrix_world.translation = turn @ empty.matrix_world.translation
        update()
        empty.rotation_euler.z += np.radians(degrees)
    update()
    assert np.abs(evaluated(ob) - p @ np.array(turn)[:3, :3].T).max() < 2e-4


def test_a_small_one_twists_by_whole_turns_of_its_own():
    """The twist stays when the large handle is moved a little."""
    ob, large, small, reach = two_pulls()
    small.rotation_euler.z += 2 * np.pi
    update()
    twisted = evaluated(ob) - own(ob)
    assert np.abs(twisted[reach]).max() > 0.03
    pose(large, z=0.01)
    assert np.abs(evaluated(ob) - own(ob) - twisted)[reach].max() < 0.015


def test_a_turn_of_the_large_one_makes_no_jump():
    """In steps of five degrees, each of which moves the surface little more than without the small handle."""
    longest = []
    for has_reach in (True, False):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        ob = bumpy()
        large = pull(ob, disk(ob, 0, 0, 0.2), radius=0.9)
        if has_reach:
            pull(ob, disk(ob, 0.45, 0, 0.1), radius=0.2)
        before, steps = evaluated(ob), []
        for _ in range(60):
            large.rotation_euler.z += np.radians(5)
            update()
            now = evaluated(ob)
            steps.append(np.abs(now - before).max())
            before = now
        longest.append(np.array(steps))
    assert (longest[0] < 1.5 * longest[1] + 0.02).all()


# ---- shared reaches

def test_a_pull_that_reaches_a_handle_with_a_reach_shares_its_reach():
    ob = bumpy()
    pull(ob, disk(ob, -0.6, 0, 0.1), radius=0.3)
    region = members(ob, "Region")
    pull(ob, disk(ob, 0.3, 0, 0.1), radius=0.25)
    third = pull(ob, disk(ob, 0.55, 0, 0.08), radius=0.2)
    reaches = [handle.reach for handle in ob.detail_deform.handles]
    assert reaches == ["", "Reach", "Reach"] and (members(ob, "Region") == region).all()
    pose(third, z=0.3)
    moved = np.abs(evaluated(ob) - own(ob)).max(axis=1)
    assert moved[members(ob, "Handle.001")].max() < 1e-9 and moved[~members(ob, "Reach")].max() < 1e-9


def test_a_pull_that_reaches_several_joins_their_reaches():
    ob = bumpy()
    pull(ob, disk(ob, -0.6, 0, 0.1), radius=0.3)
    pull(ob, disk(ob, 0.3, 0.5, 0.1), radius=0.2)
    pull(ob, disk(ob, 0.3, -0.5, 0.1), radius=0.2)
    before = members(ob, "Reach") | members(ob, "Reach.001")
    pull(ob, disk(ob, 0.5, 0, 0.08), radius=0.45)
    assert len({handle.reach for handle in list(ob.detail_deform.handles)[1:]}) == 1
    shared = members(ob, ob.detail_deform.handles[3].reach)
    assert shared[before].all() and ob.detail_deform.handles[0].reach == ""
    # With a pull that also reaches the first handle, all of them go by the region.
    pull(ob, disk(ob, -0.1, 0, 0.05), radius=0.7)
    assert not any(handle.reach for handle in ob.detail_deform.handles)
    assert members(ob, "Region")[shared].all() and ob.detail_deform.is_bound


def test_a_region_that_no_handle_goes_by_any_more_is_not_shared():
    ob, _, _, reach = two_pulls()
    activate(ob)
    ob.detail_deform.handle_index = 0
    bpy.ops.object.detail_deform_handle_remove()
    third = pull(ob, disk(ob, 0.5, 0.2, 0.05), radius=0.25)
    shared = members(ob, "Reach")
    assert [handle.reach for handle in ob.detail_deform.handles] == ["Reach", "Reach"]
    pose(third, z=0.2)
    moved = np.abs(evaluated(ob) - own(ob)).max(axis=1)
    assert not moved[~shared].any() and shared[reach].all() and shared.sum() < 2.5 * reach.sum()
    # The group of the region may be deleted, as no handle goes by it.
    ob.vertex_groups.remove(ob.vertex_groups["Region"])
    pose(third, z=0.1)
    assert ob.detail_deform.is_bound, ob.detail_deform.status


def test_a_pull_that_is_cancelled_gives_reaches_back(part):
    ob = bumpy()
    pull(ob, disk(ob, -0.6, 0, 0.1), radius=0.3)
    pull(ob, disk(ob, 0.3, 0, 0.1), radius=0.25)
    before = [(handle.reach, handle.own_reach) for handle in ob.detail_deform.handles]
    groups = {group.name: members(ob, group.name) for group in ob.vertex_groups}
    for x, radius in ((0.55, 0.2), (-0.1, 0.7)):
        for count in range(1, 6):
            activate(ob)
            bpy.ops.object.mode_set(mode='OBJECT')
            ob.data.vertices.foreach_set('select', disk(ob, x, 0, 0.06))
            bpy.ops.object.mode_set(mode='EDIT')
            stages = part('setup.pulling').Pull(bpy.context, ob, radius).stages(wait=False, watch=True)
            for _ in range(count):
                next(stages)
            stages.close()
            bpy.ops.object.mode_set(mode='OBJECT')
            update()
            assert [(handle.reach, handle.own_reach) for handle in ob.detail_deform.handles] == before
            assert {group.name for group in ob.vertex_groups} == set(groups)
            assert all((members(ob, name) == chosen).all() for name, chosen in groups.items())
            assert ob.detail_deform.is_bound, ob.detail_deform.status


def test_symmetry_of_a_further_pull_leaves_the_region_of_the_first():
    ob = bumpy()
    pull(ob, disk(ob, 0.15, 0.2, 0.1), radius=0.25)
    before = members(ob, "Region")
    ob.data.use_mirror_x = True
    pull(ob, disk(ob, 0.3, -0.5, 0.08), radius=0.1)
    assert (members(ob, "Region") == before).all() and ob.detail_deform.handles[2].reach == "Reach"


def test_a_symmetric_image_is_exact_where_both_reach():
    ob = symmetric(41)
    pull(ob, disk(ob, 0, 0.35, 0.07), radius=0.1)
    empty = pull(ob, disk(ob, 0.06, -0.1, 0.03), radius=0.05)
    group(ob, 'Mine', np.flatnonzero(disk(ob, 0.06, -0.1, 0.12)))
    activate(ob)
    ob.detail_deform.handles[1].reach = 'Mine'
    ob.detail_deform.handle_index = 1
    bpy.ops.object.detail_deform_handle_mirror(axis='X', symmetric=True)
    bind(ob)
    p = own(ob)
    pose(empty, x=0.02, z=0.06)
    found = evaluated(ob)
    order = np.lexsort((p[:, 1].round(4), p[:, 0].round(4))), np.lexsort((p[:, 1].round(4), (-p[:, 0]).round(4)))
    assert np.abs(found[order[0]] - found[order[1]] * (-1, 1, 1)).max() < 1e-5 and np.abs(found - p).max() > 0.05


def test_the_larger_reach_comes_first_in_any_order():
    """A large reach takes a small one along, also where the small one's handle is first in the list."""
    found = []
    for names in (("Small", "Large"), ("Large", "Small")):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        ob = bumpy()
        parts = {"Small": (0.3, 0.06, 0.15), "Large": (-0.1, 0.1, 0.7)}
        empties = {}
        for name in names:
            x, held, reach = parts[name]
            group(ob, name, np.flatnonzero(disk(ob, x, 0, held)))
            group(ob, f"{name} Reach", np.flatnonzero(disk(ob, x, 0, reach)))
            empties[name] = add_empty(name, (x, 0, 0))
            handle = ob.detail_deform.handles.add()
            handle.name = handle.vertex_group = name
            handle.target, handle.reach = empties[name], f"{name} Reach"
        update()
        bind(ob)
        pose(empties["Large"], z=0.3)
        pose(empties["Small"], z=0.3)
        found.append(evaluated(ob) - own(ob))
    assert np.abs(found[0] - found[1]).max() < 1e-6 and found[0][:, 2].max() == pytest.approx(0.3, abs=0.02)


# ---- sentences

def test_the_region_left_by_a_removed_mirror_image_is_no_loose_part():
    ob, _, _, _ = two_pulls()
    activate(ob)
    ob.detail_deform.handle_index = 1
    bpy.ops.object.detail_deform_handle_mirror(axis='X')
    ob.detail_deform.handle_index = 2
    bpy.ops.object.detail_deform_handle_remove()
    bind(ob)
    assert "loose part" not in ob.detail_deform.status


@pytest.mark.parametrize('where', ['its own vertices', 'away'])
def test_a_reach_without_a_free_vertex_beside_its_handle_is_refused_with_its_name(where):
    ob, _, _, _ = two_pulls()
    chosen = disk(ob, -0.6, 0, 0.1) if where == 'away' else members(ob, "Handle.001")
    group(ob, 'Mine', np.flatnonzero(chosen))
    ob.detail_deform.handles[1].reach = 'Mine'
    activate(ob)
    said = refusal(bpy.ops.object.detail_deform_bind)
    assert "Handle.001" in said and "that is free to follow is beside it within its reach" in said


def test_a_part_that_fails_while_another_is_bound_is_reported_with_the_meshs_vertices(part):
    reaches, native, PartsJob = part('follow.reaches'), part('library.native'), part('follow.parts_job').PartsJob

    class Job:
        def __init__(self, fails):
            self.fails, self.cancelled = fails, False

        def progress(self):
            return not (self.fails or self.cancelled), 0.5, "Starting"

        def draft(self):
            return None

        def cancel(self):
            self.cancelled = True

        def finish(self):
            raise native.NativeError("The surface can't be solved for near vertex 1." if self.fails
                                     else "It was cancelled.", vertices=[1] if self.fails else [])

        def close(self):
            pass

    p = np.float32([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (2, 0, 0)])
    triangles = np.int32([(0, 1, 2), (1, 3, 2), (1, 4, 3)])
    surface = reaches.Surface(p, triangles)
    parts = [reaches.Part(np.array([0]), p, triangles, np.int32([0, -1, -1, -1, -2])),
             surface.part(np.array([1]), np.array([3, 4]), np.int32([-1, 0]))]
    job = PartsJob(parts, [Job(fails=False), Job(fails=True)], len(p))
    assert job.draft() is None and job.progress()[0]
    job = PartsJob(parts[::-1], [Job(fails=True), Job(fails=False)], len(p))
    assert job.draft() is None and not job.progress()[0]
    with pytest.raises(native.NativeError, match=f"near vertex {parts[1].vertices[1]}") as caught:
        job.finish()
    assert list(caught.value.vertices) == [parts[1].vertices[1]]
