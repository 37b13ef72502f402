# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole garment over a body that is modelled as one half with Mirror follows both halves."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, evaluated, own, update
from shapes import tube
from test_transfer import add_key, coordinates, transfer


def belly(p):
    """A pose that is symmetric across x = 0."""
    return p + np.exp(-p[:, 2:] ** 2) * (0.5 * p * (1, 1, 0) + (0, 0.2, 0))


def half(p):
    return p[:, 0] > -1e-6


def quarter(p):
    return (p[:, 0] > -1e-6) & (p[:, 1] > -1e-6)


AXES = {'one axis': (half, (True, False)), 'two axes': (quarter, (True, True))}


def dress(keep, axes, place=None):
    """(bodies, shirts): a whole body, and a part of it with Mirror; a shirt for each; all with the matrix `place`."""
    bodies = tube("Whole", 1, -4, 4, 48, 60), tube("Part", 1, -4, 4, 48, 60, keep)
    shirts = [tube(name, 1.1, -2, 2, 37, 30) for name in ("Of Whole", "Of Part")]
    mirror = bodies[1].modifiers.new("Mirror", 'MIRROR')
    mirror.use_axis[:2] = axes
    for ob in (*bodies, *shirts):
        ob.matrix_world = place or Matrix()
    for body, shirt in zip(bodies, shirts):
        shirt.detail_deform.transfer.source, shirt.detail_deform.transfer.correspondence = body, 'NEAREST'
    update()
    return bodies, shirts


@pytest.mark.parametrize('merged', [True, False])
@pytest.mark.parametrize('kind', AXES)
def test_keys_and_followers_are_those_of_a_whole_body(kind, merged):
    def pose(p):
        return belly(p) * (1, 1, 1) if kind == 'one axis' else p * (1 + 0.5 * np.exp(-p[:, 2:]**2) * (1, 1, 0))
    bodies, shirts = dress(*AXES[kind], Matrix.Translation((1, 2, 3)) @ Matrix.Rotation(0.5, 4, (1, 2, 3)))
    bodies[1].modifiers["Mirror"].use_mirror_merge = merged
    for body in bodies:
        add_key(body, "Pose", pose(own(body)))
    keys = []
    for body, shirt in zip(bodies, shirts):
        activate(shirt)
        assert transfer(source=body.name, what='ALL_KEYS', correspondence='NEAREST') == {'FINISHED'}
        keys.append(coordinates(shirt.data.shape_keys.key_blocks["Pose"]))
        shirt.shape_key_clear()
        assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
        body.data.shape_keys.key_blocks["Pose"].value = 1
    update()
    size = np.linalg.norm(np.ptp(keys[0], axis=0))
    assert np.abs(keys[0] - own(shirts[0])).max() > 0.3
    assert np.abs(keys[1] - keys[0]).max() < 5e-3 * size
    assert np.abs(evaluated(shirts[1]) - evaluated(shirts[0])).max() < 5e-3 * size


@pytest.mark.parametrize('what', ['POSE', 'FOLLOW'])
def test_an_armature_behind_mirror_may_pose_the_halves_differently(what):
    bodies, shirts = dress(half, (True, False))
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    for name, x in (("Side.L", 0.5), ("Side.R", -0.5)):
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = (x, 0, 0), (x, 0, 1)
    bpy.ops.object.mode_set(mode='OBJECT')
    for body in bodies:
        p = own(body)
        weights = np.clip(0.5 + 0.5 * p[:, 0], 0, 1)
        for name, of_group in (("Side.L", weights), ("Side.R", 1 - weights)):
            made = body.vertex_groups.new(name=name)
            for vertex, weight in enumerate(of_group.tolist()):
                made.add([vertex], weight, 'REPLACE')
        body.modifiers.new("Armature", 'ARMATURE').object = rig
    for shirt in shirts:
        activate(shirt)
        if what == 'FOLLOW':
            assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    rig.pose.bones["Side.R"].location = (0, 0.5, 0)
    update()
    for body, shirt in zip(bodies, shirts):
        if what == 'POSE':
            activate(shirt)
            assert transfer(source=body.name, what='POSE', correspondence='NEAREST') == {'FINISHED'}
    update()
    one, other = (evaluated(shirt) for shirt in shirts)
    assert np.abs(one - own(shirts[0])).max() > 0.3
    assert np.abs(one - other).max() < 0.01


def test_a_mirror_added_while_a_garment_follows_applies():
    bodies, shirts = dress(half, (True, False))
    body, shirt = bodies[1], shirts[1]
    body.modifiers.clear()
    add_key(body, "Pose", belly(own(body)), value=1)
    activate(shirt)
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    update()
    before = evaluated(shirt)
    body.modifiers.new("Mirror", 'MIRROR')
    update()
    bpy.context.scene.frame_set(2)
    update()
    moved = evaluated(shirt) - own(shirt)
    left = own(shirt)[:, 0] < -0.5
    assert np.abs(evaluated(shirt) - before).max() > 0.05
    assert np.allclose(moved[left, 0].min(), -moved[own(shirt)[:, 0] > 0.5, 0].max(), atol=0.02)


def test_copies_by_an_array_are_not_followed_and_reported_where_a_garment_is_near_them():
    body = tube("Body", 1, -2, 2, 48, 30)
    array = body.modifiers.new("Rows", 'ARRAY')
    array.use_relative_offset, array.use_constant_offset, array.constant_offset_displace = False, True, (2.5, 0, 0)
    here, there = tube("Here", 1.1, -1, 1, 37, 10), tube("There", 1.1, -1, 1, 37, 10)
    there.data.transform(Matrix.Translation((2.5, 0, 0)))
    update()
    for shirt, is_said in ((here, False), (there, True)):
        shirt.detail_deform.transfer.source, shirt.detail_deform.transfer.correspondence = body, 'NEAREST'
        activate(shirt)
        assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
        assert ("'Rows' of 'Body' adds" in shirt.detail_deform.transfer.state) == is_said


@pytest.mark.parametrize('way', ['hidden', 'removed'])
def test_a_mirror_hidden_or_removed_while_a_garment_follows(way):
    """With an armature behind it. A mirror that a keyframe hides still counts; without one, only the side that has a
    body near it follows that body."""
    bodies, shirts = dress(half, (True, False))
    body, shirt = bodies[1], shirts[1]
    add_key(body, "Pose", belly(own(body)), value=1)
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    body.modifiers.new("Armature", 'ARMATURE').object = rig
    activate(shirt)
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    update()
    before, right = evaluated(shirt), own(shirt)[:, 0] > 0.3
    assert np.abs(before - belly(own(shirt))).max() < 0.06
    if way == 'hidden':
        body.modifiers["Mirror"].show_viewport = False
        body.modifiers["Mirror"].keyframe_insert('show_viewport', frame=2)
        body.modifiers["Mirror"].show_viewport = True
        body.modifiers["Mirror"].keyframe_insert('show_viewport', frame=3)
        for frame in (2, 3):
            bpy.context.scene.frame_set(frame)
            assert np.abs(evaluated(shirt) - before).max() < 1e-6
    else:
        body.modifiers.remove(body.modifiers["Mirror"])
        update()
        bpy.context.scene.frame_set(2)
        assert np.abs(evaluated(shirt) - belly(own(shirt)))[right].max() < 0.06
        assert np.abs(evaluated(shirt) - before)[~right].max() > 0.05
    assert not shirt.detail_deform.transfer.problem
