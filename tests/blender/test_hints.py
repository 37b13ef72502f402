# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings of setups that will give a wrong result: a region that is only the tip of a limb, examples that are no
poses, empties that run after themselves or that a copy shares, and modes that edit the rest shape."""

import math
import re

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import (activate, add_empty, add_handle, bind, data_blocks, evaluated, group, make_strip, members, own,
                      pull, refusal, update)

RINGS, AROUND = 33, 12


def make_limb(first, held=30):
    """A tube along z, bound by the method Examples, with a shape key that bends its middle by a right angle as example.
    The region begins at the ring `first`, the handle at `held`."""
    angles = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    p = np.array([(0.4 * math.cos(a), 0.4 * math.sin(a), z) for z in np.linspace(0, 4, RINGS) for a in angles])
    faces = [(i * AROUND + j, i * AROUND + (j + 1) % AROUND, (i + 1) * AROUND + (j + 1) % AROUND, (i + 1) * AROUND + j)
             for i in range(RINGS - 1) for j in range(AROUND)]
    mesh = bpy.data.meshes.new("Limb")
    mesh.from_pydata(p.tolist(), [], faces)
    ob = bpy.data.objects.new("Limb", mesh)
    bpy.context.scene.collection.objects.link(ob)
    ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="Bend")
    key.value = 0
    key.data.foreach_set('co', bent(p).astype(np.float32).ravel())
    rings = np.arange(len(p)) // AROUND
    group(ob, 'region', np.flatnonzero(rings >= first))
    group(ob, 'end', np.flatnonzero(rings >= held))
    ob.detail_deform.region, ob.detail_deform.method = 'region', 'EXAMPLES'
    add_handle(ob, 'end', add_empty("End", p[rings >= held].mean(0)))
    update()
    activate(ob)
    bpy.ops.object.detail_deform_examples_from_keys()
    return bind(ob)


def bent(p):
    """Positions bent by a right angle between z = 1 and 3."""
    x, y, z = p.T
    turn, radius = 0.5 * np.pi * np.clip((z - 1) / 2, 0, 1), 4 / np.pi
    beyond, below = np.maximum(z - 3, 0), np.minimum(z, 1)
    return np.stack([radius * (1 - np.cos(turn)) + beyond * np.sin(turn) + x * np.cos(turn), y,
                     below + radius * np.sin(turn) + beyond * np.cos(turn) - x * np.sin(turn)], -1)


def thickness(ob, ring):
    """The lesser half axis of a ring, as deformed."""
    p = evaluated(ob)[ring * AROUND:(ring + 1) * AROUND]
    return np.linalg.svd(p - p.mean(0))[1][1] / math.sqrt(AROUND / 2)


def to_the_bend(ob):
    """Moves the handle to the place that its vertices have in the example."""
    held = members(ob, 'end')
    empty = ob.detail_deform.handles[0].target
    empty.matrix_world = Matrix.Translation(bent(own(ob))[held].mean(0)) @ Matrix.Rotation(0.5 * np.pi, 4, 'Y')
    update()



def by_vertices(empty, ob):
    empty.parent, empty.parent_type = ob, 'VERTEX'
    empty.parent_vertices[0] = 624


def by_constraint(kind):
    def make(empty, ob):
        constraint = empty.constraints.new(kind)
        constraint.target = ob
        if hasattr(constraint, 'subtarget'):
            constraint.subtarget = 'right'
    return make


def by_another(empty, ob):
    other = add_empty("Other", (0, 0, 0))
    by_vertices(other, ob)
    empty.parent = other


def by_a_bone(empty, ob):
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    rig.data.edit_bones.new("Bone").tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode='OBJECT')
    constraint = rig.pose.bones[0].constraints.new('COPY_LOCATION')
    constraint.target, constraint.subtarget = ob, 'right'
    empty.parent, empty.parent_type, empty.parent_bone = rig, 'BONE', "Bone"


def by_a_mesh_that_goes_by_it(empty, ob):
    cage = make_strip(name="Cage")
    cage.modifiers.new("Shrinkwrap", 'SHRINKWRAP').target = ob
    by_vertices(empty, cage)


@pytest.mark.parametrize('hold', [
    by_vertices, *map(by_constraint, ('COPY_LOCATION', 'CHILD_OF', 'SHRINKWRAP', 'DAMPED_TRACK')), by_another,
    by_a_bone, by_a_mesh_that_goes_by_it])
def test_an_empty_that_goes_by_vertices_that_it_moves_runs_after_itself(hold):
    ob = bind(make_strip())
    empty = ob.detail_deform.handles[0].target
    # It may depend on the object's transform, and on meshes that don't depend on its vertices.
    empty.parent = ob
    empty.constraints.new('COPY_ROTATION').target = ob
    empty.constraints.new('SHRINKWRAP').target = make_strip(name="Elsewhere")
    update()
    assert "runs after itself" not in ob.detail_deform.status
    empty.constraints.clear()
    hold(empty, ob)
    update()
    assert "The empty of handle 'right' goes by vertices of this mesh" in ob.detail_deform.status
    for muted in empty.constraints:
        muted.mute = True
    assert ("runs after itself" in ob.detail_deform.status) == (not empty.constraints)


def test_a_region_that_is_only_a_tip_leaves_a_stub_of_an_example_and_says_so():
    whole = make_limb(first=5)
    to_the_bend(whole)
    assert "stub" not in whole.detail_deform.status and thickness(whole, 27) > 0.39
    tip = make_limb(first=25)
    status = tip.detail_deform.status
    assert "Example 'Bend' also moves what lies beside the region (such as vertex 29" in status and "stub" in status
    to_the_bend(tip)
    assert thickness(tip, 27) < 0.36  # thinner than the whole limb's 0.39, as the warning says
    tip.detail_deform.method = 'TRANSFER'
    assert "stub" not in tip.detail_deform.status


@pytest.mark.parametrize('shape, said', [
    ((-1, 1, 1), "the mirror image of the rest, inside out"), ((0, 0, 0), "a single point"),
    ((1, 0, 1), "pressed flat"), ((0, 0, 1), "pressed into a line"),
    ((-1, -1, 1), None), ((1, 0.1, 1), None), ((0.01, 0.01, 0.01), None), ('bent', None),
    ('mirrored', "the mirror image of the rest, inside out")])
def test_an_example_that_is_no_pose_is_named(shape, said):
    ob = make_limb(first=0)
    ob.detail_deform.region = ''
    rest = own(ob).astype(float)
    turn = np.array(Matrix.Rotation(1, 3, (1, 2, 3)))
    p = {'bent': bent(bent(rest)), 'mirrored': -bent(rest)}.get(shape) if isinstance(shape, str) else rest * shape
    key = ob.shape_key_add(name="Other")
    key.value = 0
    key.data.foreach_set('co', (p @ turn.T + 5).astype(np.float32).ravel())
    bpy.ops.object.detail_deform_examples_from_keys()
    status = bind(ob).detail_deform.status
    assert re.findall(r"Example '(\w+)' is ([^.]*), which is no pose", status) == ([("Other", said)] if said else [])


@pytest.mark.parametrize('segments', [12, 160])
def test_a_mirror_image_is_seen_at_any_density_and_only_of_a_closed_surface(segments):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=segments // 2)
    ball = bpy.context.active_object
    group(ball, 'end', np.flatnonzero(own(ball)[:, 2] > 0.8))
    assert "Example 'Other' is the mirror image" in mirrored_along_z(ball)
    n = segments // 4 + 4
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)))
    corners = [i * n + j for i in range(n - 1) for j in range(n - 1)]
    faces = [(k, k + 1, k + n + 1, k + n) for k in corners]
    mesh = bpy.data.meshes.new("Dome")
    mesh.from_pydata(np.stack([x, y, 0.8 - 0.4 * (x * x + y * y)], -1).tolist(), [], faces)
    dome = bpy.data.objects.new("Dome", mesh)
    bpy.context.scene.collection.objects.link(dome)
    group(dome, 'end', np.flatnonzero(x > 0.8))
    assert "Example" not in mirrored_along_z(dome)


def mirrored_along_z(ob):
    """The status with the mesh's mirror image along z as an example."""
    rest = own(ob)
    activate(ob)
    ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="Other")
    key.value = 0
    key.data.foreach_set('co', (rest * (1, 1, -1)).astype(np.float32).ravel())
    ob.detail_deform.method = 'EXAMPLES'
    add_handle(ob, 'end', add_empty("End", rest[members(ob, 'end')].mean(0)))
    bpy.ops.object.detail_deform_examples_from_keys()
    return bind(ob).detail_deform.status


def test_a_region_of_a_single_row_is_said():
    assert "single row" in make_limb(first=29).detail_deform.status
    assert "single row" not in make_limb(first=27).detail_deform.status
    assert "single row" not in bind(make_strip()).detail_deform.status


# ---- copies

def duplicated(ob, along=3.0):
    """A copy of the object and its mesh without its empties, as by Shift D, moved along x."""
    activate(ob)
    bpy.ops.object.duplicate(linked=False)
    copy = bpy.context.active_object
    assert copy != ob and copy.data != ob.data
    copy.location.x += along
    update()
    return copy


@pytest.fixture
def pulled():
    ob = make_strip()
    ob.detail_deform.handles.clear()
    columns = np.arange(625) // 25
    empty = pull(ob, (columns >= 10) & (columns <= 14) & (np.arange(625) % 25 >= 10) & (np.arange(625) % 25 <= 14))
    empty.location.z += 0.3
    update()
    return ob


def test_a_copy_that_follows_the_firsts_empties_says_so_and_gets_its_own(pulled):
    shape = evaluated(pulled)
    copy = duplicated(pulled)
    assert "Its empties are those of 'Strip' too" in copy.detail_deform.status
    assert "Its empties" not in pulled.detail_deform.status
    assert "posed alike" in copy.detail_deform.status
    assert np.abs(evaluated(copy) - shape).max() < 1e-5  # in local space, although the copy stands elsewhere
    theirs = pulled.detail_deform.handles[0].target
    theirs.location.z += 0.1
    update()
    assert np.abs(evaluated(copy) - evaluated(pulled)).max() < 1e-5 < np.abs(evaluated(copy) - shape).max()
    theirs.location.z -= 0.1
    update()
    activate(copy)
    assert bpy.ops.object.detail_deform_own_empties() == {'FINISHED'}
    update()
    assert np.allclose(evaluated(copy), shape, atol=1e-5) and np.allclose(evaluated(pulled), shape, atol=1e-5)
    assert "Its empties" not in copy.detail_deform.status
    mine, theirs = copy.detail_deform.handles[0].target, pulled.detail_deform.handles[0].target
    assert mine != theirs and mine.parent == copy and mine.users_collection != theirs.users_collection
    mine.location.z += 0.2
    update()
    assert np.allclose(evaluated(pulled), shape, atol=1e-5) and np.abs(evaluated(copy) - shape).max() > 0.15
    assert "own already" in refusal(bpy.ops.object.detail_deform_own_empties)
    # Remove takes the copy's own empties away, and the first object keeps its own.
    before = data_blocks()
    bpy.ops.object.detail_deform_remove()
    assert np.allclose(evaluated(pulled), shape, atol=1e-5) and theirs.name in bpy.data.objects
    assert len(data_blocks()) < len(before)


def test_a_copy_with_its_empties_has_its_own_already(pulled):
    activate(pulled)
    pulled.detail_deform.handles[0].target.select_set(True)
    bpy.ops.object.duplicate(linked=False)
    copy = bpy.context.active_object
    assert copy.detail_deform.handles[0].target != pulled.detail_deform.handles[0].target
    assert "Its empties" not in copy.detail_deform.status + pulled.detail_deform.status


def test_empties_without_a_parent_are_copied_to_where_the_copy_is(pulled):
    empty = pulled.detail_deform.handles[0].target
    place = empty.matrix_world.copy()
    empty.parent = None
    empty.matrix_world = place
    update()
    shape = evaluated(pulled)
    copy = duplicated(pulled)
    assert "Its empties" in copy.detail_deform.status and "pulled back" in copy.detail_deform.status
    activate(copy)
    bpy.ops.object.detail_deform_own_empties()
    update()
    assert np.allclose(evaluated(copy), shape, atol=1e-5)


def test_copied_empties_keep_whole_turns(pulled):
    empty = pulled.detail_deform.handles[0].target
    place = empty.matrix_world.copy()
    empty.parent = None
    empty.matrix_world = place
    empty.rotation_euler.x += 4 * np.pi
    pulled.detail_deform.base_deformer = 'MOTIONS'
    update()
    shape = evaluated(pulled)
    copy = duplicated(pulled)
    activate(copy)
    bpy.ops.object.detail_deform_own_empties()
    update()
    assert np.allclose(evaluated(copy), shape, atol=1e-4)
    assert np.abs(shape - own(pulled)).max() > 0.1


def test_own_empties_refer_to_the_copy(pulled):
    """The copied empties' parents, constraints and drivers refer to the copy and its empties, and their actions are
    copies."""
    first = pulled.detail_deform.handles[0].target
    group(pulled, 'middle', [70, 71])
    second = add_handle(pulled, 'middle', add_empty("Second", own(pulled)[70])).target
    update()
    second.parent, second.matrix_parent_inverse = first, first.matrix_world.inverted()
    constraint = first.constraints.new('LIMIT_DISTANCE')
    constraint.target, constraint.distance = pulled, 100
    variable = second.driver_add('location', 2).driver.variables.new()
    variable.type, variable.targets[0].id = 'TRANSFORMS', first
    first.keyframe_insert('location', frame=1)
    update()
    copy = duplicated(pulled)
    activate(copy)
    bpy.ops.object.detail_deform_own_empties()
    mine = [handle.target for handle in copy.detail_deform.handles]
    assert not {*mine} & {first, second}
    assert mine[1].parent == mine[0] and mine[0].constraints[0].target == copy
    assert mine[1].animation_data.drivers[0].driver.variables[0].targets[0].id == mine[0]
    assert mine[0].animation_data.action != first.animation_data.action
    mine[0].location.z += 1
    mine[0].keyframe_insert('location', frame=1)
    place = first.location.copy()
    for frame in (2, 1):
        bpy.context.scene.frame_set(frame)
    assert first.location == place and abs(mine[0].location.z - place.z - 1) < 1e-5


def test_two_handles_with_one_empty_have_one_on_the_copy(pulled):
    group(pulled, 'middle', [70, 71])
    add_handle(pulled, 'middle', pulled.detail_deform.handles[0].target)
    copy = duplicated(pulled)
    activate(copy)
    bpy.ops.object.detail_deform_own_empties()
    mine = [handle.target for handle in copy.detail_deform.handles]
    assert mine[0] == mine[1] != pulled.detail_deform.handles[0].target


# ---- modes that edit the rest shape

@pytest.mark.parametrize('mode', ['EDIT', 'SCULPT'])
def test_apply_first_in_the_mode_that_works_on_the_rest_shape(pulled, part, mode):
    activate(pulled)
    deformed = evaluated(pulled)
    is_deformed = part('follow.frame_results').is_deformed
    bpy.ops.object.mode_set(mode=mode)
    assert is_deformed(pulled.data)
    assert bpy.ops.object.detail_deform_apply(mode='MESH') == {'FINISHED'}
    assert pulled.mode == mode and not is_deformed(pulled.data)
    bpy.ops.object.mode_set(mode='OBJECT')
    assert np.allclose(own(pulled), deformed, atol=1e-6) and not pulled.detail_deform.signature


def test_a_mode_that_blender_does_not_change_is_said(pulled):
    """Blender refuses to change the mode of an object that is disabled in viewports, except out of Edit Mode."""
    activate(pulled)
    rest = own(pulled)
    bpy.ops.object.mode_set(mode='SCULPT')
    pulled.hide_viewport = True
    with pytest.raises(RuntimeError, match="'Strip' is disabled in viewports"):
        bpy.ops.object.detail_deform_apply(mode='MESH')
    assert pulled.mode == 'SCULPT' and np.array_equal(own(pulled), rest)
    pulled.hide_viewport = False
    bpy.ops.object.mode_set(mode='OBJECT')
    pulled.hide_viewport = True
    with pytest.raises(RuntimeError, match="'Strip' is disabled in viewports"):
        bpy.ops.object.detail_deform_handle_select()
    assert pulled.mode == 'OBJECT'


def test_at_rest_there_is_nothing_to_apply_first(part):
    ob = bind(make_strip())
    assert not part('follow.frame_results').is_deformed(ob.data)
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    assert part('follow.frame_results').is_deformed(ob.data)
