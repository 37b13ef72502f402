# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles mirrored to the object's other side: with their own empties, or following the other handle's motion."""

import bpy
import numpy as np
from mathutils import Matrix, Vector

from conftest import (activate, add_from, bind, evaluated, members,
                      own, refusal, select, symmetric, update)


def test_a_mirrored_handle_bends_the_other_side_alike():
    ob = symmetric()
    p = own(ob)
    handle = add_from(ob, (p[:, 0] > 0.4) & (p[:, 1] > 0.2))
    handle.name = "ear.L"
    handle.target.rotation_euler = (0.3, 0.2, 0.1)
    add_from(ob, p[:, 1] < -0.4)
    ob.detail_deform.handle_index = 0
    assert bpy.ops.object.detail_deform_handle_mirror(axis='X') == {'FINISHED'}
    mirrored = ob.detail_deform.handles[-1]
    assert mirrored.name == "ear.R"
    assert (members(ob, mirrored.vertex_group) == ((p[:, 0] < -0.4) & (p[:, 1] > 0.2))).all()
    bind(ob)
    # Mirror-image motions of both empties give a symmetric surface.
    flip = Matrix.Diagonal((-1, 1, 1, 1))
    motion = Matrix.Translation((0.1, 0.05, 0.3)) @ Matrix.Rotation(0.5, 4, 'Y')
    left, right = (h.target for h in (ob.detail_deform.handles[0], mirrored))
    left.matrix_world = motion @ left.matrix_world
    right.matrix_world = flip @ motion @ flip @ right.matrix_world
    update()
    moved = evaluated(ob)
    assert np.abs(moved - p).max() > 0.1
    order = {tuple(np.round(point, 4)): number for number, point in enumerate(p[:, :2])}
    image = [order[tuple(np.round((-x, y), 4) + 0.0)] for x, y in p[:, :2]]
    assert np.abs(moved[image] * (-1, 1, 1) - moved).max() < 1e-4


def test_the_mirror_image_of_a_posed_handle_is_placed_on_the_deformed_surface():
    ob = symmetric()
    p = own(ob)
    handle = add_from(ob, (p[:, 0] > 0.4) & (p[:, 1] > 0.2))
    bind(ob)
    update()
    rest = handle.target.matrix_world.copy()
    handle.target.location.z += 1  # the only handle and no region: the whole surface moves along
    update()
    bpy.ops.object.detail_deform_handle_mirror(axis='X')
    update()
    place = ob.detail_deform.handles[-1].target.matrix_world.translation
    assert (place - Vector((-rest.translation.x, rest.translation.y, rest.translation.z + 1))).length < 1e-5


def test_mirroring_is_refused_where_it_makes_no_sense():
    ob = symmetric()
    p = own(ob)
    add_from(ob, np.abs(p[:, 0]) < 0.1)
    assert "its mirror image is itself" in refusal(bpy.ops.object.detail_deform_handle_mirror, axis='X')
    add_from(ob, p[:, 0] > 0.4)
    p[p[:, 0] < 0, 2] += 5
    ob.data.vertices.foreach_set('co', p.astype(np.float32).ravel())
    assert "not symmetric" in refusal(bpy.ops.object.detail_deform_handle_mirror, axis='X')


def test_a_symmetric_handle_mirrors_every_motion():
    ob = symmetric()
    p = own(ob)
    add_from(ob, (p[:, 0] > 0.4) & (p[:, 1] > 0.2)).name = "ear.L"
    add_from(ob, p[:, 1] < -0.4)
    assert bpy.ops.object.detail_deform_handle_mirror(index=0, axis='X', symmetric=True) == {'FINISHED'}
    follower = ob.detail_deform.handles[-1]
    assert (follower.name, follower.mirrors, follower.target) == ("ear.R", "ear.L", None)
    bind(ob)
    target = ob.detail_deform.handles[0].target
    target.location += Vector((0.1, 0.05, 0.3))
    target.rotation_euler.y += 0.5
    update()
    moved = evaluated(ob)
    order = {tuple(np.round(point, 4)): number for number, point in enumerate(p[:, :2])}
    image = [order[tuple(np.round((-x, y), 4) + 0.0)] for x, y in p[:, :2]]
    assert np.abs(moved - p).max() > 0.2
    assert np.abs(moved[image] * (-1, 1, 1) - moved).max() < 1e-4

    # Whole turns are mirrored too, in several steps.
    ob.detail_deform.steps = 4
    target.rotation_euler.y += 2 * np.pi
    update()
    bpy.ops.object.detail_deform_update()
    wound = evaluated(ob)
    assert np.abs(wound - moved).max() > 0.1
    assert np.abs(wound[image] * (-1, 1, 1) - wound).max() < 1e-3

    follower.mirrors = "nobody"
    update()
    assert "mirrors 'nobody', which is not there" in ob.detail_deform.status
    follower.mirrors = "ear.L"
    ob.detail_deform.handles[0].name = "left ear"
    assert follower.mirrors == "left ear"
    bpy.ops.object.detail_deform_update()
    assert ob.detail_deform.is_bound and np.abs(evaluated(ob) - wound).max() < 1e-5


def test_a_handle_made_symmetric_while_the_other_is_posed_takes_its_pose():
    ob = symmetric()
    p = own(ob)
    add_from(ob, (p[:, 0] > 0.4) & (p[:, 1] > 0.2))
    add_from(ob, p[:, 1] < -0.4)
    bind(ob)
    ob.detail_deform.handles[0].target.location.z += 0.3
    update()
    bpy.ops.object.detail_deform_handle_mirror(index=0, axis='X', symmetric=True)
    bind(ob, keep_rest=True)
    moved = evaluated(ob) - p
    assert np.allclose(moved[(p[:, 0] < -0.4) & (p[:, 1] > 0.2)], (0, 0, 0.3), atol=1e-5)


def test_the_region_of_pull_is_mirrored_with_its_handle():
    bpy.ops.mesh.primitive_monkey_add()
    ob = bpy.context.active_object
    p = own(ob)
    select(ob, p[:, 0] > 1.2)
    bpy.ops.object.detail_deform_pull(radius=0.4)
    activate(ob)
    one_side = members(ob, "Region").sum()
    bpy.ops.object.detail_deform_handle_mirror(axis='X', symmetric=True)
    assert members(ob, "Region").sum() == 2 * one_side
