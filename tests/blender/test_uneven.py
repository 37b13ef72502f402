# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles deform the shape in the world: an object whose axes are scaled differently, or that its parents shear,
deforms like the same shape with its scale applied."""

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, add_empty, bind, choose, evaluated, group, make_strip, own, pull, update
from test_transfer import add_key

SPACES = {'FLAT': Matrix.Diagonal((1, 1, 0.25, 1)), 'LONG': Matrix.Diagonal((3, 1, 1, 1)),
          'MIRRORED': Matrix.Diagonal((-1, 0.5, 1, 1)), 'SHEARED': None}  # SHEARED: by a scaled parent, in strips()


def in_world(ob, points=None):
    world = np.array(ob.matrix_world, float)
    return (evaluated(ob) if points is None else points) @ world[:3, :3].T + world[:3, 3]


def put_into(ob, space):
    """Gives an object another world matrix without changing its shape in the world."""
    ob.data.transform(space.inverted())
    ob.matrix_world = space
    update()


def strips(space):
    """(strip, an object of the same shape in the world with another local space)."""
    plain, other = make_strip(name="Plain"), make_strip(name="Other")
    for ob in (plain, other):  # before the space changes, because Blender's own triangulation depends on shape
        mesh = bmesh.new()
        mesh.from_mesh(ob.data)
        bmesh.ops.triangulate(mesh, faces=mesh.faces)
        mesh.to_mesh(ob.data)
    if SPACES[space]:
        put_into(other, SPACES[space])
    else:
        parent, turn = add_empty("Parent", (0, 0, 0)), Matrix.Rotation(0.6, 4, (1, 2, 3))
        parent.scale = (1, 2, 0.7)
        other.data.transform((Matrix.Diagonal((1, 2, 0.7, 1)) @ turn).inverted())
        other.parent, other.rotation_mode = parent, 'QUATERNION'
        other.rotation_quaternion = turn.to_quaternion()
        update()
    assert np.abs(in_world(other) - in_world(plain)).max() < 1e-5
    return plain, other


def turned(ob, turn=-1.2):
    empty = ob.detail_deform.handles[-1].target
    empty.location.z += 0.3
    empty.rotation_euler.y = turn
    update()


def assert_alike(plain, other, moves=0.09):
    there = in_world(plain)
    assert np.abs(there - in_world(plain, own(plain))).max() > moves
    assert np.abs(in_world(other) - there).max() < 2e-4


METHODS = [{'method': method} for method in ('TRANSFER', 'VARIATIONAL', 'NORMAL', 'GRADIENT', 'VOLUMES')] + [
    {'method': 'TRANSFER', 'rotation_only': True}, {'method': 'TRANSFER', 'refine': 4}, {'smoothness': 3},
    {'output': 'BASE'}, {'soft_border': 0.4}, {'base_deformer': 'MOTIONS'}]


@pytest.mark.parametrize('settings', METHODS, ids=str)
@pytest.mark.parametrize('space', SPACES)
def test_every_method_deforms_the_shape_in_the_world(space, settings):
    pair = strips(space)
    for ob in pair:
        choose(ob, **settings)
        bind(ob)
        turned(ob)
    assert_alike(*pair)
    assert "scale" not in pair[1].detail_deform.status


@pytest.mark.parametrize('space', SPACES)
def test_whole_turns_and_handles_that_turn_freely(space):
    pair = strips(space)
    for ob in pair:
        bind(ob)
        turned(ob, 2 * np.pi + 0.4)
    assert_alike(*pair)
    for ob in pair:
        ob.detail_deform.handles[0].turns = 'FREE'
        update()
    assert_alike(*pair)


@pytest.mark.parametrize('space', SPACES)
def test_base_objects(space):
    pair = strips(space)
    for ob in pair:
        bind(ob)
        activate(ob)
        assert bpy.ops.object.detail_deform_base_make() == {'FINISHED'}
        base = ob.detail_deform.base_object
        bind(activate(ob))
        points = in_world(base, own(base))
        lifted = points + np.maximum(points[:, :1] - 0.3, 0)**2 * (0.1, 0, 0.8)
        world = np.array(base.matrix_world, float)
        lifted = (lifted - world[:3, 3]) @ np.linalg.inv(world[:3, :3]).T
        add_key(base, "Lift", lifted, value=1)
        update()
    assert_alike(*pair)


@pytest.mark.parametrize('space', SPACES)
def test_examples(space):
    pair = strips(space)
    for ob in pair:
        points, world = in_world(ob), np.array(ob.matrix_world, float)
        bent = points + np.maximum(points[:, :1] - 0.2, 0)**2 * (-0.2, 0, 0.7)
        add_key(ob, "Bent", (bent - world[:3, 3]) @ np.linalg.inv(world[:3, :3]).T)
        ob.detail_deform.examples.add().name = "Bent"
        ob.detail_deform.method = 'EXAMPLES'
        bind(ob)
        turned(ob, -0.6)
    assert_alike(*pair)


@pytest.mark.parametrize('space', SPACES)
def test_a_second_pull_starts_from_the_first_ones_pose(space):
    pair = strips(space)
    for ob in pair:
        bind(ob)
        turned(ob)
        before = in_world(ob)
        middle = np.abs(in_world(ob, own(ob))[:, :2] - (0.5, 0.5)).max(axis=1) < 0.1
        ob.detail_deform.pulled_region = False
        empty = pull(ob, middle)
        assert np.abs(in_world(ob) - before).max() < 1e-3
        empty.matrix_world = Matrix.Translation((0, 0, 0.1)) @ empty.matrix_world
        update()
    assert np.abs(in_world(pair[0]) - in_world(pair[1])).max() < 1e-3


def test_a_change_of_scale_is_reported_until_re_bind():
    _, ob = strips('LONG')
    bind(ob)
    turned(ob)
    assert "scaled along other directions" not in ob.detail_deform.status
    ob.scale.x = 1
    update()
    assert "scaled along other directions" in ob.detail_deform.status
    assert "Bound to" in ob.detail_deform.status
    bind(ob, keep_rest=True)
    assert "scaled along other directions" not in ob.detail_deform.status


@pytest.mark.parametrize('space', ['FLAT', 'LONG', 'MIRRORED'])
def test_apply_scale_and_re_bind_move_nothing(space):
    _, ob = strips(space)
    bind(ob)
    turned(ob)
    before = in_world(ob)
    activate(ob)
    assert bpy.ops.object.transform_apply(location=False, rotation=False, scale=True) == {'FINISHED'}
    update()
    bind(ob, keep_rest=True)
    assert np.abs(in_world(ob) - before).max() < 2e-4
    assert "scale" not in ob.detail_deform.status


def test_a_uniform_scale_has_the_identity_as_proportions():
    ob = make_strip(world=Matrix.Scale(3, 4))
    group(ob, "unused", [0])
    bind(ob)
    assert np.array_equal(np.array(ob.detail_deform.proportions).reshape(3, 3), np.eye(3))
