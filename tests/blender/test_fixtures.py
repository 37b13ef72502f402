# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes of blend_fixtures/, with 33,000 to 120,000 triangles, deformed as by the demo."""
import bpy
import numpy as np
import pytest
from mathutils import Matrix
from mathutils.bvhtree import BVHTree

from conftest import bind, evaluated, members, open_fixture, own, update


def triangles(ob):
    ob.data.calc_loop_triangles()
    values = np.empty(3 * len(ob.data.loop_triangles), np.int32)
    ob.data.loop_triangles.foreach_get('vertices', values)
    return values.reshape(-1, 3)


def normals(positions, tris):
    a, b, c = (positions[tris[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    return cross / np.linalg.norm(cross, axis=1)[:, None]


def intersecting_pairs(positions, tris):
    """Number of pairs of triangles that intersect and share no vertex, by Blender's BVHTree."""
    tree = BVHTree.FromPolygons(positions.tolist(), tris.tolist(), all_triangles=True)
    pairs = np.array(tree.overlap(tree), int).reshape(-1, 2)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    a, b = tris[pairs[:, 0]], tris[pairs[:, 1]]
    return int((~(a[:, :, None] == b[:, None, :]).any(axis=(1, 2))).sum())


def carried_normals(ob, lift, tris):
    """Rest normals, rotated as the base plane was: the normals that the lifted details should have.

    The lifted base of Fig. 1 depends nearly on x alone. So its rotation about y is taken from the mean
    height and x of each column of the grid, which shares no code with the library.
    """
    rest, now = own(ob), evaluated(ob)
    columns = np.round(rest[:, 0] * 200).astype(int)
    x, z = (np.array([now[columns == c, k].mean() for c in range(201)]) for k in (0, 2))
    angle = np.arctan2(np.gradient(z), np.gradient(x))
    smooth = np.convolve(np.pad(angle, 8, mode='edge'), np.ones(17) / 17, mode='valid')
    turn = smooth[columns[tris[:, 0]]]
    n = normals(rest, tris)
    return np.stack([np.cos(turn) * n[:, 0] - np.sin(turn) * n[:, 2], n[:, 1],
                     np.sin(turn) * n[:, 0] + np.cos(turn) * n[:, 2]], -1)


def mean_angle(a, b):
    return np.degrees(np.arccos(np.clip((a * b).sum(axis=1), -1, 1))).mean()


def test_bumpy_plane_lifted_as_in_figure_1():
    ob = bind(open_fixture('bumpy_plane'))
    tris = triangles(ob)
    assert len(tris) == 80000
    rest = own(ob)
    assert np.abs(evaluated(ob) - rest).max() < 1e-6 * np.linalg.norm(np.ptp(rest, axis=0))
    bpy.data.objects['Right'].location.z += 0.38
    update()
    lifted = evaluated(ob)
    assert np.isfinite(lifted).all()
    assert intersecting_pairs(lifted, tris) == 0

    free = members(ob, 'region')[tris].all(axis=1)
    error = mean_angle(normals(lifted, tris)[free], carried_normals(ob, 0.38, tris)[free])
    assert error < 4
    # The measure is sensitive: details that are not rotated at all are far off.
    assert mean_angle(normals(rest, tris)[free], carried_normals(ob, 0.38, tris)[free]) > 15


def test_intersections_are_counted():
    positions = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.2, 0.2, -1), (0.2, 0.2, 1), (0.9, 0.9, 0.5)])
    assert intersecting_pairs(positions, np.array([(0, 1, 2), (3, 4, 5)])) == 1
    positions[3:] += 5
    assert intersecting_pairs(positions, np.array([(0, 1, 2), (3, 4, 5)])) == 0


def test_suzanne_with_three_loose_parts(part):
    ob = bind(open_fixture('suzanne'))
    tris = triangles(ob)
    assert len(tris) >= 100000
    assert "2 loose parts ride along with what is beneath" in ob.detail_deform.status
    rest = own(ob)
    before = intersecting_pairs(rest, tris)
    ear, brow = bpy.data.objects['Ear'], bpy.data.objects['Brow']
    ear.matrix_world = ear.matrix_world @ Matrix.Translation((0, 0.1, 0.38)) @ Matrix.Rotation(0.6, 4, 'X')
    brow.matrix_world = brow.matrix_world @ Matrix.Translation((0, 0, 0.16))
    update()
    moved = evaluated(ob) - rest
    assert np.isfinite(moved).all()
    parts = part('scene.components').labels(len(rest), part('scene.mesh_data').edges(ob.data))
    eyes = parts != parts[members(ob, 'ear')][0]
    assert len(np.unique(parts[eyes])) == 2
    assert np.abs(moved[~eyes & ~members(ob, 'region') & ~members(ob, 'ear') & ~members(ob, 'brow')]).max() == 0
    assert np.linalg.norm(moved[eyes], axis=1).max() < 0.15 * np.linalg.norm(moved[members(ob, 'brow')], axis=1).max()
    assert np.linalg.norm(moved[members(ob, 'ear')], axis=1).min() > 0.1
    assert np.linalg.norm(moved, axis=1).max() < 0.7
    assert intersecting_pairs(rest + moved, tris) < before + 0.001 * len(tris)


def test_tentacle_animated():
    ob = open_fixture('animated')
    scene = bpy.context.scene
    scene.frame_set(1)
    bind(ob)
    rest, tip = own(ob), bpy.data.objects['Tip']
    start = tip.matrix_world.copy()
    for frame in range(1, 25):
        scene.frame_set(frame)
        moved = evaluated(ob)
        motion = np.array(ob.matrix_world.inverted() @ tip.matrix_world @ start.inverted() @ ob.matrix_world)
        expected = rest @ motion[:3, :3].T + motion[:3, 3]
        handle = members(ob, 'tip')
        assert np.abs(moved - expected)[handle].max() < 1e-4
        assert np.isfinite(moved).all()
    assert np.linalg.norm(moved - rest, axis=1).max() > 1


# Pairs of markers at both ends of a limb, as blend_fixtures/build_creatures.py numbers them.
LIMBS = ((18, 20), (19, 21), (20, 24), (21, 25), (28, 30), (29, 31), (30, 34), (31, 35))


def directions(points, markers):
    arms = np.array([points[markers[b]] - points[markers[a]] for a, b in LIMBS])
    return arms / np.linalg.norm(arms, axis=1)[:, None]


def turned(before, after):
    return np.degrees(np.arccos(np.clip((before * after).sum(1), -1, 1)))


@pytest.mark.large
def test_the_calfs_poses_carry_over_to_the_giraffe(part):
    open_fixture('creatures')
    calf, giraffe = bpy.data.objects["Calf"], bpy.data.objects["Giraffe"]
    bpy.context.view_layer.objects.active = giraffe
    assert len(triangles(calf)) > 1.5 * len(triangles(giraffe)) > 25000
    assert bpy.ops.object.detail_deform_transfer_match() == {'FINISHED'}
    # Below 1: the giraffe's neck and legs are longer than the calf's.
    assert np.mean(giraffe.data['detail_deform_match']['arrays']['confidence']) > 0.85
    rests, marked = [own(calf), own(giraffe)], [part('setup.markers').of(ob) for ob in (calf, giraffe)]
    native, scene = part('library.native'), bpy.context.scene
    hooves = members(giraffe, "Hooves")
    for frame in (9, 17, 24):
        scene.frame_set(frame)
        name = "Calf Pose"
        for anchor in ('SOURCE', 'PINNED'):
            bpy.ops.object.detail_deform_transfer(anchor=anchor, anchor_group="Hooves", replace=True)
            poses = [evaluated(calf), evaluated(giraffe)]
            if anchor == 'PINNED':
                assert np.abs(poses[1][hooves] - rests[1][hooves]).max() < 1e-5
                continue
            # Each limb turns by the same angle as the calf's; one of these turns far.
            arms = [[directions(points, m) for points in (rest, pose)] for rest, pose, m in zip(rests, poses, marked)]
            by_calf, by_giraffe = (turned(*pair) for pair in arms)
            assert by_calf.max() > 30
            assert np.abs(by_calf - by_giraffe).max() < 8, (by_calf, by_giraffe)
            # The giraffe intersects itself no more than the calf does.
            shares = []
            for ob, rest, pose in zip((calf, giraffe), rests, poses):
                tris = triangles(ob)
                found = native.measure(rest.astype(np.float32), np.ascontiguousarray(pose, np.float32), tris,
                                       np.full(len(rest), -1, np.int32))
                shares.append(found.intersecting_triangles / len(tris))
            assert shares[1] <= shares[0] + 0.001, shares
    assert [key.name for key in giraffe.data.shape_keys.key_blocks] == ["Basis", name]


def test_52_shape_keys_take_one_factorization(part, monkeypatch):
    source = open_fixture('suzanne')
    rest = own(source)
    target = source.copy()
    target.data = source.data.copy()
    bpy.context.scene.collection.objects.link(target)
    target.data.vertices.foreach_set('co', (rest * (1, 1.3, 0.9)).astype(np.float32).ravel())
    source.shape_key_add(name="Basis", from_mix=False)
    random = np.random.default_rng(3)
    for number in range(52):
        centre = rest[random.integers(len(rest))]
        near = np.exp(-((rest - centre) ** 2).sum(1) / 0.02)[:, None]
        key = source.shape_key_add(name=f"Key {number}", from_mix=False)
        key.data.foreach_set('co', (rest + 0.1 * near * random.normal(size=3)).astype(np.float32).ravel())
    transfers = []
    kind = part('library.native').TransferJob
    monkeypatch.setattr(part('library.native'), 'TransferJob',
                        lambda *a, **k: transfers.append(kind(*a, **k)) or transfers[-1])
    bpy.context.view_layer.objects.active = target
    bpy.ops.object.detail_deform_transfer(source=source.name, what='ALL_KEYS')
    assert len(transfers) == 1
    keys = target.data.shape_keys.key_blocks
    assert [key.name for key in keys] == [key.name for key in source.data.shape_keys.key_blocks]
    # Each key moves the same vertices as the source's key, about as far.
    for key in list(keys)[1:]:
        moved = [np.empty(rest.size, np.float32) for _ in range(2)]
        for values, of in zip(moved, (source.data.shape_keys.key_blocks[key.name], key)):
            of.data.foreach_get('co', values)
        a, b = (values.reshape(-1, 3) - start for values, start in zip(moved, (rest, own(target))))
        lengths = [np.linalg.norm(m, axis=1) for m in (a, b)]
        assert lengths[1][lengths[0] < 1e-4 * lengths[0].max()].max() < 0.05 * lengths[0].max()
        assert 0.6 < lengths[1].max() / lengths[0].max() < 1.6
