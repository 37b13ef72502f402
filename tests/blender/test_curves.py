# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles that are curves: Pull by Curve, and what moves, twists, scales and stretches along them."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from conftest import (activate, add_empty, add_handle, bind, evaluated, group, make_strip, members, moved, own, refusal,
                      select, update)

LENGTH, RADIUS, ROOT = 4.0, 0.3, 0.9  # of a tube along X; its vertices up to ROOT aren't selected
ELSEWHERE = Matrix.LocRotScale((3, -2, 1), Matrix.Rotation(0.7, 3, (1, 2, 3)).to_quaternion(), (2, 2, 2))


def tube(world=None, rings=81, around=16):
    x, angle = np.meshgrid(np.linspace(0, LENGTH, rings), np.arange(around) * 2 * np.pi / around, indexing='ij')
    places = np.stack([x, RADIUS * np.cos(angle), RADIUS * np.sin(angle)], -1).reshape(-1, 3)
    faces = [(i * around + j, i * around + (j + 1) % around, (i + 1) * around + (j + 1) % around, (i + 1) * around + j)
             for i in range(rings - 1) for j in range(around)]
    mesh = bpy.data.meshes.new("Tube")
    mesh.from_pydata(places.tolist(), [], [*faces, tuple(range(around - 1, -1, -1)),
                                           tuple(range((rings - 1) * around, rings * around))])
    ob = bpy.data.objects.new("Tube", mesh)
    bpy.context.scene.collection.objects.link(ob)
    ob.matrix_world = world or Matrix()
    update()
    return ob


def pull(ob, chosen, **options):
    """Selects these vertices, and pulls them by a curve. Returns its object."""
    select(ob, chosen)
    assert bpy.ops.object.detail_deform_pull_curve(**options) == {'FINISHED'}
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    curve = bpy.context.view_layer.objects.active
    assert curve.type == 'CURVE' and ob.detail_deform.handles[-1].target == curve
    return curve


@pytest.fixture
def limb():
    """(ob, curve, chosen): a tube, pulled by all but its root."""
    ob = tube()
    chosen = own(ob)[:, 0] > ROOT
    return ob, pull(ob, chosen, points=9, radius=0.8), chosen


def points(curve):
    return curve.data.splines[0].bezier_points


def place(curve, ob, places):
    """Puts the control points to these places in the object's space."""
    to_curve = curve.matrix_world.inverted() @ ob.matrix_world
    for point, where in zip(points(curve), places):
        point.co = to_curve @ Matrix.Translation(where).translation
    update()


def along(ob, curve):
    """(n, 3): the control points in the object's space."""
    to_ob = ob.matrix_world.inverted() @ curve.matrix_world
    return np.array([to_ob @ point.co for point in points(curve)])


def circle(positions, radius):
    """The places of positions along X where that is bent to a circle upward from ROOT on."""
    x, y, z = positions.T
    angle = np.maximum(x - ROOT, 0) / radius
    return np.stack([np.minimum(x, ROOT) + (radius - z) * np.sin(angle), y,
                     radius - (radius - z) * np.cos(angle)], axis=1)


def test_a_curve_is_made_along_the_selection(limb):
    ob, curve, _ = limb
    found = along(ob, curve)
    assert len(found) == 9 and np.abs(found[:, 1:]).max() < 0.02
    assert found[-1, 0] - found[0, 0] > 0.97 * (LENGTH - ROOT)  # it begins at the root
    assert moved(ob) < 1e-7


def follow_polygon(ob, curve, places, anew=False):
    """Gives the curve these points, in the object's space, joined by straight lines."""
    spline = None if anew else curve.data.splines[0]
    if anew or spline.type != 'POLY':
        curve.data.splines.clear()
        spline = curve.data.splines.new('POLY')
        spline.points.add(len(places) - 1)
    to_curve = curve.matrix_world.inverted() @ ob.matrix_world
    for point, place in zip(spline.points, places):
        point.co = (*(to_curve @ Vector(place)), 1)
    curve.data.update_tag()
    update()
    return spline.points


@pytest.fixture(params=['plain', 'elsewhere'])
def straight(request):
    """(ob, curve, chosen, places): a tube bound to a straight curve, with places along it in the object's space."""
    ob = tube(ELSEWHERE if request.param == 'elsewhere' else None)
    chosen = own(ob)[:, 0] > ROOT
    curve = pull(ob, chosen, radius=0.8 * ob.matrix_world.median_scale)
    places = np.zeros((65, 3))
    places[:, 0] = np.linspace(own(ob)[chosen, 0].min(), LENGTH, 65)
    follow_polygon(ob, curve, places)
    bind(ob)
    assert moved(ob) < 1e-7
    return ob, curve, chosen, places


def test_a_limb_bends_along_its_curve(straight):
    ob, curve, chosen, places = straight
    follow_polygon(ob, curve, circle(places, 1.0))  # by 177 degrees
    # A station's length is 1/64 of 3.1, and the curve's derivative is found from points as far apart.
    assert np.abs(evaluated(ob) - circle(own(ob), 1.0))[chosen].max() < 1e-3


def test_a_limb_coils_by_more_than_a_turn(straight):
    """Rotations are continuous along the curve, and the result with them, beyond half a turn."""
    ob, curve, chosen, places = straight
    follow_polygon(ob, curve, circle(places, 0.4))  # by 444 degrees
    expected = circle(own(ob), 0.4)
    assert np.abs(evaluated(ob) - expected)[chosen].max() < 4e-3
    rest = ~chosen & (own(ob)[:, 0] > ROOT - 0.3)  # beside the curve its begin shows
    assert np.abs(evaluated(ob) - expected)[rest].max() < 0.1


def turned_about_x(positions, angles):
    x, y, z = positions.T
    return np.stack([x, y * np.cos(angles) - z * np.sin(angles), y * np.sin(angles) + z * np.cos(angles)], axis=1)


def test_a_tilt_twists(straight):
    ob, curve, chosen, places = straight
    share = np.clip((own(ob)[:, 0] - places[0, 0]) / np.ptp(places[:, 0]), 0, 1)
    for point, part in zip(curve.data.splines[0].points, np.linspace(0, 1, len(places))):
        point.tilt = 4 * np.pi * part
    update()
    # Within a station the turn is that of its middle: 4 pi / 64 / 2 of the radius at most.
    expected = turned_about_x(own(ob), 4 * np.pi * share)
    assert np.abs(evaluated(ob) - expected)[chosen].max() < 1.1 * RADIUS * 4 * np.pi / 128


def test_a_radius_scales_across_and_a_longer_curve_stretches_along(straight):
    ob, curve, chosen, places = straight
    longer = places * (1.5, 1, 1) - (0.5 * places[0, 0], 0, 0)
    for point in follow_polygon(ob, curve, longer):
        point.radius = 0.5
    update()
    expected = own(ob) * (1.5, 0.5, 0.5) - (0.5 * places[0, 0], 0, 0)
    assert np.abs(evaluated(ob) - expected)[chosen].max() < 1e-5


def test_its_object_moves_turns_and_scales_all(straight):
    ob, curve, chosen, places = straight
    motion = Matrix.LocRotScale((0.2, 0.5, -0.1), Matrix.Rotation(2.0, 3, (3, 1, 2)).to_quaternion(), (1.2, 1.2, 1.2))
    world = ob.matrix_world
    curve.matrix_world = world @ motion @ world.inverted() @ curve.matrix_world
    update()
    expected = own(ob) @ np.array(motion)[:3, :3].T + np.array(motion)[:3, 3]
    assert np.abs(evaluated(ob) - expected)[chosen].max() < 1e-5
    # So it does with a bent curve.
    follow_polygon(ob, curve, [motion @ Vector(place) for place in circle(places, 1.0)])
    expected = circle(own(ob), 1.0) @ np.array(motion)[:3, :3].T + np.array(motion)[:3, 3]
    assert np.abs(evaluated(ob) - expected)[chosen].max() < 1.3e-3


def ring_of(ob, at, width=1):
    """(n,): the rings of a tube around a place along it."""
    x = own(ob)[:, 0]
    order = np.unique(x.round(6))
    middle = int(np.abs(order - at).argmin())
    return np.isin(x.round(6), order[middle:middle + width])


@pytest.mark.parametrize('width', [1, 3])
def test_a_loop_gets_a_closed_curve(width):
    ob = tube()
    curve = pull(ob, ring_of(ob, 2.0, width), points=8, radius=1.0)
    assert curve.data.splines[0].use_cyclic_u
    distances = np.linalg.norm(along(ob, curve)[:, 1:], axis=1)
    assert np.allclose(distances, RADIUS, rtol=0.06), distances
    # Wider, then turned in Edit Mode.
    chosen = ring_of(ob, 2.0, width)
    middle = Vector((own(ob)[chosen, 0].mean(), 0, 0))
    motion = Matrix.Translation(middle) @ Matrix.Rotation(0.8, 4, (2, 3, 1)) @ Matrix.Translation(-middle)
    for point in points(curve):
        for name in ('co', 'handle_left', 'handle_right'):
            to_curve = curve.matrix_world.inverted()
            setattr(point, name, to_curve @ motion @ curve.matrix_world @ getattr(point, name))
    update()
    expected = own(ob) @ np.array(motion)[:3, :3].T + np.array(motion)[:3, 3]
    assert np.abs(evaluated(ob) - expected)[chosen].max() < 1e-5


@pytest.mark.parametrize('seed', range(6))
def test_any_connected_selection_has_a_path(part, seed):
    """Patches, blobs, whole meshes, with holes and branches: a path along them, or a sentence."""
    random = np.random.default_rng(seed)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=16)
    ob = bpy.context.view_layer.objects.active
    edges, places = part('scene.mesh_data').edges(ob.data), own(ob)
    paths, problem = part('setup.handle_paths'), part('scene.mesh_data').MeshProblem
    for _ in range(25):
        chosen = np.linalg.norm(places - places[random.integers(len(places))], axis=1) < random.uniform(0.05, 2.1)
        chosen &= random.random(len(places)) > random.choice([0, 0.05, 0.3])
        vertices = np.flatnonzero(chosen)
        least = part('scene.components').labels(len(places), edges[chosen[edges].all(axis=1)])
        vertices = vertices[least[vertices] == least[random.choice(vertices)]] if len(vertices) else [0]
        try:
            path = paths.along(ob, np.array(vertices))
        except problem:
            assert len(vertices) < 2
            continue
        assert np.isfinite(path.points).all() and np.abs(path.points).max() < 1.6
        curve = path.curve("Path", ob.matrix_world, Matrix(), 5)
        assert np.isfinite([tuple(point.co) for point in curve.splines[0].bezier_points]).all()


def test_a_chain_gets_an_open_curve_through_its_ends():
    ob = tube()
    row = (np.abs(own(ob)[:, 1] - RADIUS) < 1e-6) & (own(ob)[:, 0] > 1) & (own(ob)[:, 0] < 3)
    curve = pull(ob, row, points=4, radius=0.5)
    assert not curve.data.splines[0].use_cyclic_u
    expected = np.zeros((4, 3))
    expected[:, 0], expected[:, 1] = np.linspace(*np.sort(own(ob)[row, 0])[[0, -1]], 4), RADIUS
    found = along(ob, curve)
    assert np.allclose(found if found[0, 0] < 2 else found[::-1], expected, atol=1e-5)


def test_hooks_move_a_hidden_curve(straight):
    ob, curve, chosen, places = straight
    hook = add_empty("Hook", (0, 0, 0))
    modifier = curve.modifiers.new("Hook", 'HOOK')
    modifier.object = hook
    modifier.vertex_indices_set(range(len(places)))
    curve.hide_set(True)
    update()
    hook.location.z = 0.25
    update()
    up = np.linalg.inv(np.array(ob.matrix_world)[:3, :3]) @ (0, 0, 0.25)
    assert np.abs(evaluated(ob) - own(ob) - up)[chosen].max() < 1e-5


@pytest.mark.parametrize('kind', ['HOOK', 'SHRINKWRAP', 'place'])
def test_a_curve_that_goes_by_its_own_mesh_is_said(limb, kind):
    ob, curve, _ = limb
    assert "goes by vertices of this mesh" not in ob.detail_deform.status
    if kind == 'HOOK':
        follower = add_empty("Follower", (0, 0, 0))
        follower.parent, follower.parent_type, follower.parent_vertices = ob, 'VERTEX', (5, 0, 0)
        curve.modifiers.new("Mine", kind).object = follower
    elif kind == 'SHRINKWRAP':
        curve.modifiers.new("Mine", kind).target = ob
    else:
        curve.constraints.new('SHRINKWRAP').target = ob
    update()
    reason = "constraint 'Shrinkwrap'" if kind == 'place' else "modifier 'Mine'"
    assert (f"The curve of handle '{ob.detail_deform.handles[-1].name}' goes by vertices of this mesh "
            f"({reason} of '{curve.name}')") in ob.detail_deform.status


def test_it_goes_back_to_rest(limb):
    ob, curve, _ = limb
    before = along(ob, curve)
    place(curve, ob, circle(before, 1.0))
    curve.location.x += 1
    points(curve)[3].radius = 2.0
    update()
    assert moved(ob) > 0.5
    activate(ob)
    assert bpy.ops.object.detail_deform_handle_reset(everything=True) == {'FINISHED'}
    update()
    assert np.abs(along(ob, curve) - before).max() < 1e-5 and moved(ob) < 1e-5


def test_a_deleted_curve_can_be_brought_back(limb):
    ob, curve, chosen = limb
    place(curve, ob, circle(along(ob, curve), 1.0))
    bpy.data.objects.remove(curve)
    update()
    activate(ob)
    assert bpy.ops.object.detail_deform_bring_back() == {'FINISHED'}
    update()
    made = ob.detail_deform.handles[0].target
    assert made.type == 'CURVE' and moved(ob) < 1e-5
    for point in made.data.splines[0].points:
        point.co.z += 0.2
    made.data.update_tag()
    update()
    assert np.allclose((evaluated(ob) - own(ob))[chosen], (0, 0, 0.2), atol=1e-4)


def test_a_file_keeps_it(straight, tmp_path):
    ob, curve, chosen, places = straight
    name, curve_name = ob.name, curve.name
    follow_polygon(ob, curve, circle(places, 1.0))
    before = evaluated(ob)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'curve.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'curve.blend'))
    ob, curve = bpy.data.objects[name], bpy.data.objects[curve_name]
    assert np.abs(evaluated(ob) - before).max() < 1e-6
    follow_polygon(ob, curve, circle(places, 2.0))
    assert np.abs(evaluated(ob) - circle(own(ob), 2.0))[chosen].max() < 1e-3


def test_rebinding_keeps_the_pose(straight):
    ob, curve, chosen, places = straight
    follow_polygon(ob, curve, circle(places, 1.0))
    before = evaluated(ob)
    ob.vertex_groups[ob.detail_deform.region].remove([0])
    ob.vertex_groups[ob.detail_deform.handles[0].vertex_group].remove([int(np.flatnonzero(chosen)[40])])
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.object.mode_set(mode='OBJECT')
    activate(ob)
    assert bpy.ops.object.detail_deform_bind(wait=True, keep_rest=True) == {'FINISHED'}
    assert np.abs(evaluated(ob) - before)[chosen].max() < 0.02  # the vertex that was removed follows the others


def test_a_copy_can_have_a_curve_of_its_own(limb):
    ob, curve, _ = limb
    copy = ob.copy()
    copy.data = ob.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    update()
    activate(copy)
    assert bpy.ops.object.detail_deform_own_empties() == {'FINISHED'}
    own_curve = copy.detail_deform.handles[0].target
    assert own_curve != curve and own_curve.data != curve.data
    place(own_curve, copy, circle(along(copy, own_curve), 1.0))
    assert moved(copy) > 0.5 and moved(ob) < 1e-6


def test_undo_and_redo_follow(limb):
    ob, curve, _ = limb
    name = ob.name
    bpy.ops.ed.undo_push()
    place(curve, ob, circle(along(ob, curve), 1.0))
    bpy.ops.ed.undo_push()
    bent = moved(ob)
    bpy.ops.ed.undo()
    assert bent > 0.5 and moved(bpy.data.objects[name]) < 1e-6
    bpy.ops.ed.redo()
    update()
    assert abs(moved(bpy.data.objects[name]) - bent) < 1e-5


def test_applying_a_scale_keeps_the_shape(limb):
    ob, curve, _ = limb
    ob.scale = 2.0, 2.0, 2.0
    update()
    place(curve, ob, circle(along(ob, curve), 1.0))
    before = evaluated(ob) * 2
    activate(ob)
    assert bpy.ops.object.transform_apply(location=False, rotation=False, scale=True) == {'FINISHED'}
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.object.mode_set(mode='OBJECT')
    bind(ob, keep_rest=True)
    assert np.abs(evaluated(ob) - before).max() < 1e-3


def test_what_a_curve_must_be_is_said(straight):
    ob, curve, _, places = straight
    settings = ob.detail_deform
    curve.data.splines[0].points.add(2)
    update()
    assert "'Tube Handle' has 67 points along it, 65 when it was bound" in settings.status
    curve.data.splines.new('POLY')
    curve.data.update_tag()
    update()
    assert "has 2 splines" in settings.status
    curve.data.splines.clear()
    follow_polygon(ob, curve, places, anew=True)
    assert "Bound" in settings.status, settings.status
    curve.data.bevel_depth = 0.1
    update()
    assert "has a thickness" in settings.status
    curve.data.bevel_depth = 0
    follow_polygon(ob, curve, places * 0)
    activate(ob)
    assert "has no length" in refusal(bpy.ops.object.detail_deform_bind, wait=True)


@pytest.mark.parametrize('keep_rest', [False, True])
def test_a_curve_in_place_of_an_empty_counts_from_the_next_bind_on(keep_rest):
    ob = make_strip()
    bind(ob)
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    curve = bpy.data.objects.new("Line", bpy.data.curves.new("Line", 'CURVE'))
    bpy.context.scene.collection.objects.link(curve)
    curve.data.dimensions = '3D'
    spline = curve.data.splines.new('POLY')
    spline.points.add(4)
    for number, point in enumerate(spline.points):
        point.co = (1, number / 4, 0, 1)
    update()
    before = evaluated(ob)
    ob.detail_deform.handles[0].target = curve
    update()
    assert "has got a curve since Bind" in ob.detail_deform.status
    assert np.array_equal(evaluated(ob), before)
    bind(ob, keep_rest=keep_rest)
    before = before if keep_rest else own(ob)
    assert np.abs(evaluated(ob) - before).max() < 1e-5
    spline.points[0].co.z = 0.5
    curve.data.update_tag()
    update()
    right = members(ob, 'right')
    raised = (evaluated(ob) - before)[right, 2]
    assert raised[own(ob)[right, 1] < 0.01].min() > 0.35 and np.abs(raised[own(ob)[right, 1] > 0.5]).max() < 0.05


def test_a_curve_added_to_a_deformed_mesh(limb):
    """All Back to Rest straightens both curves, and the mesh."""
    ob, curve, _ = limb
    rest = along(ob, curve)
    place(curve, ob, circle(rest, 2.0))
    bent = evaluated(ob)
    other = pull(ob, ring_of(ob, 0.5), points=6, radius=0.3)
    assert np.abs(evaluated(ob) - bent).max() < 1e-4
    for point in points(other):
        point.co.x += 0.05
    place(curve, ob, circle(rest, 1.5))
    activate(ob)
    assert bpy.ops.object.detail_deform_handle_reset(everything=True) == {'FINISHED'}
    update()
    assert np.abs(along(ob, curve) - rest).max() < 1e-4 and moved(ob) < 1e-3
    place(curve, ob, circle(rest, 2.0))
    assert np.abs(evaluated(ob) - bent).max() < 0.02


def test_a_mirroring_handle_needs_no_curve_of_its_own(limb):
    ob, _, chosen = limb
    empty = add_empty("Empty", (0, 0, 0))
    group(ob, "Ring", np.flatnonzero(ring_of(ob, 0.5)))
    handle = add_handle(ob, "Ring", empty)
    handle.name = "First"
    group(ob, "Other", np.flatnonzero(chosen))
    ob.detail_deform.handles[0].mirrors, ob.detail_deform.handles[0].mirror_axis = "First", 'Z'
    bind(ob)
    empty.location.z = 0.1
    update()
    assert np.allclose((evaluated(ob) - own(ob))[chosen], (0, 0, -0.1), atol=1e-5)
    assert not ob.detail_deform.stale
    ob.detail_deform.handles[0].mirrors = ""
    update()
    assert "has got a curve since Bind" in ob.detail_deform.status
    bind(ob)
    ob.detail_deform.handles[0].mirrors = "First"  # which is another number of pieces
    update()
    assert "were changed since Bind" in ob.detail_deform.status


def test_mirroring_a_curve_is_refused_and_keeps_the_binding(limb):
    ob = limb[0]
    activate(ob)
    assert "can't be mirrored" in refusal(bpy.ops.object.detail_deform_handle_mirror, axis='Z')
    group(ob, "Ring", np.flatnonzero(ring_of(ob, 0.5)))
    handle = add_handle(ob, "Ring", None)
    handle.mirrors, signature = ob.detail_deform.handles[0].name, ob.detail_deform.signature
    assert "which follows a curve" in refusal(bpy.ops.object.detail_deform_bind, wait=True)
    assert ob.detail_deform.signature == signature


def test_another_resolution_in_renders_is_refused(limb):
    ob, curve, _ = limb
    curve.data.render_resolution_u = 24
    curve.data.update_tag()
    update()
    assert "another resolution in renders" in ob.detail_deform.status
    curve.data.render_resolution_u = 0
    curve.data.update_tag()
    update()
    assert ob.detail_deform.is_bound and "Bound" in ob.detail_deform.status


def test_a_deleted_curve_leaves_the_mesh_bent(limb):
    ob, curve, _ = limb
    place(curve, ob, circle(along(ob, curve), 1.0))
    bent = evaluated(ob)
    bpy.data.objects.remove(curve)
    ob.update_tag()
    update()
    assert np.abs(evaluated(ob) - bent).max() < 1e-5


def test_mirrors_and_symmetry_are_refused(straight):
    ob, _, _, _ = straight
    ob.detail_deform.handles[0].symmetric = {'Y'}
    update()
    assert "which nothing keeps symmetric" in ob.detail_deform.status


def test_removing_the_handle_removes_its_curve(limb):
    ob, _, _ = limb
    activate(ob)
    assert bpy.ops.object.detail_deform_handle_remove() == {'FINISHED'}
    assert not bpy.data.curves and len(bpy.data.objects) == 1


def test_unconnected_vertices_are_refused():
    ob = tube()
    chosen = np.zeros(len(ob.data.vertices), bool)
    chosen[[100, 700]] = True
    select(ob, chosen)
    assert "aren't connected" in refusal(bpy.ops.object.detail_deform_pull_curve)
    assert not ob.detail_deform.handles and not bpy.data.curves


def test_animated_points_are_followed(straight):
    ob, curve, chosen, places = straight
    for frame, radius in ((1, 4.0), (11, 1.0)):
        for point in follow_polygon(ob, curve, circle(places, radius)):
            point.keyframe_insert('co', frame=frame)
    bpy.context.scene.frame_set(11)
    assert np.abs(evaluated(ob) - circle(own(ob), 1.0))[chosen].max() < 1e-3
    bpy.context.scene.frame_set(1)
    assert np.abs(evaluated(ob) - circle(own(ob), 4.0))[chosen].max() < 1e-3


def test_renders_follow_a_curve_that_is_disabled_in_them(straight, rendered):
    ob, curve, chosen, places = straight
    hook = add_empty("Hook", (0, 0, 0))
    modifier = curve.modifiers.new("Hook", 'HOOK')
    modifier.object = hook
    modifier.vertex_indices_set(range(len(places)))
    curve.hide_render = hook.hide_render = True
    for frame in (1, 5):
        hook.location.z = 0.1 * frame
        hook.keyframe_insert('location', frame=frame)
    up = np.linalg.inv(np.array(ob.matrix_world)[:3, :3]) @ (0, 0, 0.1)
    seen = rendered(ob.name)
    assert np.allclose((seen[5] - seen[1])[chosen], 4 * up, atol=1e-4)


BONES = 4


def rig(ob, roll=0.3):
    """An armature with a chain of bones along a tube's pulled part, which its vertices follow."""
    armature = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(armature)
    armature.matrix_world = ob.matrix_world
    activate(armature)
    bpy.ops.object.mode_set(mode='EDIT')
    ends = np.linspace(ROOT, LENGTH, BONES + 1)
    bones = []
    for number in range(BONES):
        bone = armature.data.edit_bones.new(f"Bone {number}")
        bone.head, bone.tail, bone.roll = (ends[number], 0, 0), (ends[number + 1], 0, 0), roll * number
        if bones:
            bone.parent, bone.use_connect = bones[-1], True
        bones.append(bone)
    bpy.ops.object.mode_set(mode='OBJECT')
    group(ob, "Along", np.flatnonzero(own(ob)[:, 0] > ROOT))
    handle = add_handle(ob, "Along", armature)
    handle.first_bone, handle.last_bone = "Bone 0", f"Bone {BONES - 1}"
    group(ob, "Region", np.flatnonzero(own(ob)[:, 0] > ROOT - 0.6))
    ob.detail_deform.region = "Region"
    update()
    return armature


@pytest.fixture(params=['plain', 'elsewhere'])
def boned(request):
    """(ob, armature): a tube bound to a chain of bones."""
    ob = tube(ELSEWHERE if request.param == 'elsewhere' else None)
    armature = rig(ob)
    bind(ob)
    assert moved(ob) < 1e-7
    return ob, armature


def turn(armature, number, axis, angle):
    """Turns a bone about an axis through its head, in the armature's space."""
    bone = armature.pose.bones[f"Bone {number}"]
    head = Matrix.Translation(bone.head)
    bone.matrix = head @ Matrix.Rotation(angle, 4, axis) @ head.inverted() @ bone.matrix
    update()


def test_bones_move_what_is_along_them(boned):
    ob, armature = boned
    turn(armature, 2, 'Y', -1.0)
    x = own(ob)[:, 0]
    length = (LENGTH - ROOT) / BONES
    # Away from the joint, which is rounded over an eighth of both bones, all moves as its bone does.
    before, after = (x > ROOT) & (x < ROOT + 1.8 * length), x > ROOT + 2.2 * length
    joint = np.array([ROOT + 2 * length, 0, 0])
    turned = joint + (own(ob) - joint) @ np.array(Matrix.Rotation(-1.0, 3, 'Y')).T
    assert np.abs(evaluated(ob) - own(ob))[before].max() < 1e-4
    assert np.abs(evaluated(ob) - turned)[after].max() < 1e-4


def test_bones_twist_and_scale(boned):
    ob, armature = boned
    turn(armature, 0, 'X', 2.5)
    after = own(ob)[:, 0] > ROOT
    assert np.abs(evaluated(ob) - turned_about_x(own(ob), np.full(len(own(ob)), 2.5)))[after].max() < 1e-4
    armature.pose.bones["Bone 0"].matrix_basis = Matrix.Scale(1.5, 4)
    update()
    root = np.array([ROOT, 0, 0])
    assert np.abs(evaluated(ob) - root - 1.5 * (own(ob) - root))[after].max() < 1e-4


def test_bones_go_back_to_rest_and_are_followed_in_renders(boned, rendered):
    ob, armature = boned
    turn(armature, 1, 'Z', 0.8)
    assert moved(ob) > 0.5
    activate(ob)
    assert bpy.ops.object.detail_deform_handle_reset(everything=True) == {'FINISHED'}
    update()
    assert moved(ob) < 1e-4
    armature.hide_render = True
    bone = armature.pose.bones["Bone 0"]
    for frame in (1, 5):
        bone.location.y = 0.1 * frame
        bone.keyframe_insert('location', frame=frame)
    seen = rendered(ob.name)
    assert np.allclose((seen[5] - seen[1])[own(ob)[:, 0] > ROOT], (0.4, 0, 0), atol=1e-4)


def test_which_bones_can_not_be_followed_is_said(boned):
    ob, armature = boned
    handle = ob.detail_deform.handles[0]
    for first, last, sentence in (("Bone 3", "Bone 0", "exchange First Bone and Last Bone"),
                                  ("Bone 0", "Bone 9", "has no bone 'Bone 9'"),
                                  ("", "", "choose First Bone and Last Bone"),
                                  ("Bone 1", "Bone 3", "follows another number of bones")):
        handle.first_bone, handle.last_bone = first, last
        armature.location.x += 0.1
        update()
        assert sentence in ob.detail_deform.status, (first, last, ob.detail_deform.status)
    handle.first_bone = "Bone 0"
    ob.modifiers.new("Armature", 'ARMATURE').object = armature
    update()
    activate(ob)
    assert "would move it twice" in refusal(bpy.ops.object.detail_deform_bind, wait=True)
