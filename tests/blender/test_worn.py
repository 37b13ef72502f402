# SPDX-License-Identifier: GPL-3.0-or-later
"""Clothes and props that follow a body by nearest points."""

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector
from mathutils.bvhtree import BVHTree

from conftest import activate, evaluated, own, refusal, update
from shapes import tube
from test_transfer import add_key, coordinates

transfer, live = bpy.ops.object.detail_deform_transfer, bpy.ops.object.detail_deform_transfer_live


def bent(p, curvature=0.3):
    turn, radius = curvature * p[:, 2], 1 / curvature - p[:, 0]
    return np.stack([1 / curvature - radius * np.cos(turn), p[:, 1], radius * np.sin(turn)], -1)


def flexed(p, by=0.4):
    """Positions of an arm with a raised muscle."""
    share = np.exp(-8 * ((p - (1, 0, 0)) ** 2).sum(1))[:, None]
    return p + by * share * p * (1, 1, 0) / np.linalg.norm(p[:, :2], axis=1)[:, None]


def pimpled(p):
    """Positions of an arm with three pimples, narrow enough to rise between the vertices of a coarse garment."""
    result = p.copy()
    for z in (-1.7, 0.1, 1.3):
        share = np.exp(-200 * ((p - (np.cos(z), np.sin(z), z)) ** 2).sum(1))[:, None]
        result += 0.2 * share * p * (1, 1, 0)
    return result


def place(ob, matrix):
    """Gives an object another matrix without moving its vertices in the world."""
    ob.matrix_world = matrix
    ob.data.transform(matrix.inverted())
    update()


def world(ob, points):
    matrix = np.array(ob.matrix_world)
    return points @ matrix[:3, :3].T + matrix[:3, 3]


@pytest.fixture
def dressed():
    """(arm, sleeve): an arm with shape keys, and a sleeve of another topology, which is active."""
    arm, sleeve = tube("Arm", 1, -4, 4, 48, 80), tube("Sleeve", 1.1, -2, 2, 37, 30)
    add_key(arm, "Bend", bent(own(arm)))
    add_key(arm, "Flex", flexed(own(arm)))
    add_key(arm, "Goose Pimples", pimpled(own(arm)))
    settings = sleeve.detail_deform.transfer
    settings.source, settings.correspondence = arm, 'NEAREST'
    activate(sleeve)
    return arm, sleeve


def put_elsewhere(ob):
    turn = Euler((0.3, -0.5, 1.2)).to_matrix().to_4x4()
    place(ob, Matrix.Translation((5, 1, -2)) @ turn @ Matrix.Diagonal((2.0, 2.0, 2.0, 1.0)))


def test_a_garment_follows_live_and_stays_where_it_was(dressed):
    arm, sleeve = dressed
    rest = own(sleeve)
    assert live() == {'FINISHED'}
    assert sleeve.detail_deform.transfer.correspondence == 'NEAREST'
    assert np.abs(evaluated(sleeve) - rest).max() < 1e-6
    arm.data.shape_keys.key_blocks["Bend"].value = 1
    update()
    assert np.abs(evaluated(sleeve) - bent(rest)).max() < 0.03
    assert "Follows 'Arm'" in sleeve.detail_deform.transfer.state
    # After an edit the garment still follows.
    sleeve.data.vertices[0].co *= 1.1
    sleeve.data.update()
    update()
    assert np.abs(evaluated(sleeve) - bent(own(sleeve))).max() < 0.03
    live(on=False)
    assert np.abs(evaluated(sleeve) - own(sleeve)).max() < 1e-6


@pytest.mark.parametrize('mirrored', [False, True])
def test_a_garment_follows_in_the_world_whatever_the_local_spaces(dressed, mirrored):
    arm, sleeve = dressed
    wanted = bent(own(sleeve))
    put_elsewhere(sleeve)
    arm.shape_key_clear()
    place(arm, Matrix.Translation((0, 3, 0)) @ Matrix.Diagonal((-0.5 if mirrored else 0.5, 0.5, 0.5, 1.0)))
    rest, matrix = own(arm), np.array(arm.matrix_world)
    posed = (bent(world(arm, rest)) - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T
    add_key(arm, "Bend", posed, value=1.0)
    update()
    assert live() == {'FINISHED'}
    assert np.abs(world(sleeve, evaluated(sleeve)) - wanted).max() < 0.03


def sunk(shirt, points, arm):
    """The greatest height of a displayed vertex of the arm outside of a shirt with these positions, by Blender's
    BVHTree."""
    shirt.data.calc_loop_triangles()
    tree = BVHTree.FromPolygons(points.tolist(), [list(face.vertices) for face in shirt.data.loop_triangles])
    found = 0
    for vertex in evaluated(arm):
        if abs(vertex[2]) < 2.9:
            near, normal, _, _ = tree.find_nearest(Vector(vertex))
            found = max(found, (Vector(vertex) - near).dot(normal))
    return found


@pytest.fixture
def shirt(dressed):
    """A coarse shirt over the arm; active."""
    shirt = tube("Shirt", 1.06, -3, 3, 13, 17)
    settings = shirt.detail_deform.transfer
    settings.source, settings.correspondence = dressed[0], 'NEAREST'
    return activate(shirt)


def test_a_shirt_is_kept_outside_in_keys_poses_and_frames(dressed, shirt, tmp_path):
    arm, name = dressed[0], "Goose Pimples"
    transfer(what='ALL_KEYS', keep_outside=False)
    through = coordinates(shirt.data.shape_keys.key_blocks[name])
    shirt.shape_key_clear()
    transfer(what='ALL_KEYS')
    outside = coordinates(shirt.data.shape_keys.key_blocks[name])
    key = arm.data.shape_keys.key_blocks[name]
    key.value = 1
    update()
    assert sunk(shirt, through, arm) > 0.1 and sunk(shirt, outside, arm) < 0.005
    assert np.abs(outside - through).max() < 0.3
    shirt.shape_key_clear()
    transfer(what='POSE')
    assert np.abs(coordinates(shirt.data.shape_keys.key_blocks["Arm Pose"]) - outside).max() < 1e-4
    shirt.shape_key_clear()
    for frame, value in ((1, 0.0), (4, 1.0)):
        key.value = value
        key.keyframe_insert('value', frame=frame)
    transfer(what='ANIMATION', frame_start=1, frame_end=4, cache_path=str(tmp_path / "shirt.pc2"))
    bpy.context.scene.frame_set(4)
    assert np.abs(evaluated(shirt) - outside).max() < 1e-4
    for frame in (2, 3):
        bpy.context.scene.frame_set(frame)
        assert sunk(shirt, evaluated(shirt), arm) < 0.005


def test_the_gap_is_kept_live_and_its_change_applies_at_once(dressed, shirt):
    arm, settings = dressed[0], shirt.detail_deform.transfer
    live()
    arm.data.shape_keys.key_blocks["Goose Pimples"].value = 1
    settings.keep_outside = False
    update()
    assert sunk(shirt, evaluated(shirt), arm) > 0.1
    settings.keep_outside = True
    update()
    near = evaluated(shirt)
    assert sunk(shirt, near, arm) < 0.005
    settings.gap = 0.0
    update()
    assert sunk(shirt, evaluated(shirt), arm) < 0.01 < np.abs(evaluated(shirt) - near).max()


def test_props_keep_their_shape(dressed):
    arm, _ = dressed
    ring = tube("Ring", 1.2, 1, 1.5, 20, 2)
    settings = ring.detail_deform.transfer
    settings.source, settings.correspondence, settings.placing = arm, 'NEAREST', 'PARTS'
    activate(ring)
    live()
    arm.data.shape_keys.key_blocks["Bend"].value = 1
    update()
    posed, rest = evaluated(ring), own(ring)
    apart = [np.linalg.norm(p[:, None] - p[None], axis=2) for p in (posed, rest)]
    assert np.abs(apart[0] - apart[1]).max() < 1e-5
    assert np.linalg.norm(posed.mean(0) - bent(rest).mean(0)) < 0.05


def test_many_garments_each_by_its_own_panel(dressed):
    arm, sleeve = dressed
    twin = tube("Copy", 1, -4, 4, 48, 80)  # the arm's topology
    activate(arm)
    for ob in (sleeve, twin):
        ob.select_set(True)
    assert bpy.ops.object.detail_deform_transfer_many(what='ALL_KEYS') == {'FINISHED'}
    assert np.abs(coordinates(sleeve.data.shape_keys.key_blocks["Bend"]) - bent(own(sleeve))).max() < 0.03
    assert np.abs(coordinates(twin.data.shape_keys.key_blocks["Bend"]) - bent(own(twin))).max() < 1e-4


def test_the_source_of_many_garments_is_evaluated_once_a_frame(dressed, part, monkeypatch):
    """A subdivided body has to be evaluated a second time without its subdivision, which costs as much as the first."""
    arm, sleeve = dressed
    arm.modifiers.new("Subdivision", 'SUBSURF')
    other = sleeve.copy()
    other.data = sleeve.data.copy()
    bpy.context.scene.collection.objects.link(other)
    for garment in (sleeve, other):
        activate(garment)
        assert live() == {'FINISHED'}
    source_pose, asked = part('scene.source_pose'), []
    evaluated_pose = source_pose.evaluated_pose
    monkeypatch.setattr(source_pose, 'evaluated_pose', lambda *of: asked.append(of[0].name) or evaluated_pose(*of))
    for value in (0.5, 1.0):
        asked.clear()
        arm.data.shape_keys.key_blocks["Bend"].value = value
        update()
        assert set(asked) == {"Arm"}
        shown = [evaluated(garment) for garment in (sleeve, other)]
        rest = own(sleeve)
        for garment in shown:
            assert np.abs(garment - (rest + value * (bent(rest) - rest))).max() < 0.03
        updates = len(asked)
        other.detail_deform.transfer.live = False
        asked.clear()
        arm.data.shape_keys.key_blocks["Bend"].value = value - 0.2
        update()
        assert len(asked) == updates  # as many for two garments as for one
        other.detail_deform.transfer.live = True


def test_refusals_of_garments(dressed, tmp_path):
    arm, sleeve = dressed
    live()
    live(on=False)
    assert "has no list of pairs" in refusal(bpy.ops.object.detail_deform_transfer_save,
                                             filepath=str(tmp_path / "pairs.txt"))
    sleeve.location.x = 20
    update()
    assert "'Sleeve' stands farther from 'Arm' than it is large" in refusal(live)
    sleeve.location.x = 0
    arm.scale = (0, 1, 1)
    update()
    sentence = refusal(live)
    assert "is scaled to 0" in sentence and "'Arm'" in sentence


def test_a_change_of_correspondence_while_following_is_reported(dressed):
    arm, sleeve = dressed
    settings = sleeve.detail_deform.transfer
    twin = tube("Twin", 1.1, -2, 2, 37, 30)
    settings.source, settings.correspondence = twin, 'TOPOLOGY'
    live()
    settings.correspondence = 'NEAREST'
    update()
    assert "what is nearest is found only when following starts" in settings.problem
    live(on=False)
    settings.source = arm
    live()
    assert not settings.problem


def test_the_relative_place_of_garment_and_source_is_saved(dressed, tmp_path):
    arm, sleeve = dressed
    arm.data.shape_keys.key_blocks["Bend"].value = 1
    put_elsewhere(sleeve)
    live()
    before = evaluated(sleeve)
    path = str(tmp_path / "dressed.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    sleeve, arm = bpy.data.objects["Sleeve"], bpy.data.objects["Arm"]
    assert np.abs(evaluated(sleeve) - before).max() < 1e-6
    sleeve.location.x += 1  # moves the sleeve with its offsets, which don't change
    key = arm.data.shape_keys.key_blocks["Bend"]
    for value in (0, 1):
        key.value = value
        update()
        assert (np.abs(evaluated(sleeve) - before).max() < 1e-4) == bool(value)
