# SPDX-License-Identifier: GPL-3.0-or-later
"""Detail Deform in artists' modifier stacks, with Mirror, Subdivision and armatures: its place, closed seams of Mirror,
and empties on posed bones."""

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector

from conftest import activate, bind, evaluated, group, make_strip, own, pull, refusal, select, symmetric, update


def names(ob):
    return [m.name for m in ob.modifiers]


@pytest.mark.parametrize('kind', ['MIRROR', 'SUBSURF', 'ARMATURE', 'LATTICE', 'ARRAY', 'SOLIDIFY'])
def test_pull_places_detail_deform_first(kind):
    ob = make_strip()
    ob.modifiers.new("Theirs", kind)
    ob.modifiers.new("Another", 'BEVEL')
    pull(ob, own(ob)[:, 0] < 0.2)
    assert names(ob) == ["Detail Deform", "Theirs", "Another"]
    activate(ob)
    assert not bpy.ops.object.detail_deform_place.poll()


def test_detail_deform_is_placed_behind_a_cache():
    ob = make_strip()
    ob.modifiers.new("Cache", 'MESH_CACHE')
    ob.modifiers.new("Smooth", 'SUBSURF')
    bind(ob)
    assert names(ob) == ["Cache", "Detail Deform", "Smooth"]


def positions_from(ob, name):
    """Adds nodes that set positions from the attribute of this name: 'bound' has the mesh's present positions."""
    bound = ob.data.attributes.new('bound', 'FLOAT_VECTOR', 'POINT')
    bound.data.foreach_set('vector', own(ob).astype(np.float32).ravel())
    tree = bpy.data.node_groups.new("Theirs", 'GeometryNodeTree')
    if hasattr(tree, 'interface'):
        tree.interface.new_socket("Geometry", in_out='INPUT', socket_type='NodeSocketGeometry')
        tree.interface.new_socket("Geometry", in_out='OUTPUT', socket_type='NodeSocketGeometry')
    else:
        tree.inputs.new('NodeSocketGeometry', "Geometry")
        tree.outputs.new('NodeSocketGeometry', "Geometry")
    begin, end = tree.nodes.new('NodeGroupInput'), tree.nodes.new('NodeGroupOutput')
    moving, reading = tree.nodes.new('GeometryNodeSetPosition'), tree.nodes.new('GeometryNodeInputNamedAttribute')
    reading.data_type = 'FLOAT_VECTOR'
    reading.inputs['Name'].default_value = name
    given = next(socket for socket in reading.outputs if socket.enabled and socket.type == 'VECTOR')
    tree.links.new(begin.outputs[0], moving.inputs['Geometry'])
    tree.links.new(given, moving.inputs['Position'])
    tree.links.new(moving.outputs[0], end.inputs[0])
    ob.modifiers.new("Theirs", 'NODES').node_group = tree


def bound_to_a_cage(ob):
    cage = make_strip(name="Cage")
    cage.location.z = -0.1
    update()
    activate(ob)
    ob.modifiers.new("Theirs", 'SURFACE_DEFORM').target = cage
    assert bpy.ops.object.surfacedeform_bind(modifier="Theirs") == {'FINISHED'}


def laplacian(ob):
    activate(ob)
    modifier = ob.modifiers.new("Theirs", 'LAPLACIANDEFORM')
    group(ob, 'anchors', np.flatnonzero(own(ob)[:, 0] < 0.05))
    modifier.vertex_group = 'anchors'
    assert bpy.ops.object.laplaciandeform_bind(modifier="Theirs") == {'FINISHED'}


@pytest.mark.parametrize('make', [bound_to_a_cage, laplacian, lambda ob: positions_from(ob, 'bound')])
@pytest.mark.parametrize('earlier', [False, True])
def test_detail_deform_is_placed_behind_a_modifier_that_overwrites_positions(make, earlier):
    """The deformation is displayed there, and the status doesn't ask to move the modifier."""
    ob = make_strip()
    if earlier:
        ob.modifiers.new("Bend", 'SIMPLE_DEFORM').angle = 0
    make(ob)
    ob.modifiers.new("Smooth", 'SUBSURF').levels = 0
    bind(ob)
    assert names(ob) == ["Bend"] * earlier + ["Theirs", "Detail Deform", "Smooth"]
    before = evaluated(ob)
    ob.detail_deform.handles[0].target.location.z += 0.3
    update()
    assert np.abs(evaluated(ob) - before).max() > 0.29
    assert "modifier stack" not in ob.detail_deform.status
    activate(ob)
    assert not bpy.ops.object.detail_deform_place.poll()
    # Moved in front of it by the user, it is reported, and the button moves it back.
    bpy.ops.object.modifier_move_to_index(modifier="Detail Deform", index=0)
    update()
    assert np.abs(evaluated(ob) - before).max() < 1e-3
    assert "'Theirs' comes behind Detail Deform" in ob.detail_deform.status
    assert bpy.ops.object.detail_deform_place() == {'FINISHED'}
    update()
    assert names(ob) == ["Bend"] * earlier + ["Theirs", "Detail Deform", "Smooth"]
    assert np.abs(evaluated(ob) - before).max() > 0.29


def test_nodes_that_read_the_positions_they_get_come_behind():
    ob = make_strip()
    positions_from(ob, 'position')
    bind(ob)
    assert names(ob) == ["Detail Deform", "Theirs"] and "modifier stack" not in ob.detail_deform.status


def test_multires_stays_before_and_is_reported():
    ob = make_strip()
    ob.detail_deform.show_as = 'MODIFIER'
    ob.modifiers.new("Detail", 'MULTIRES')
    ob.modifiers.new("Twin", 'MIRROR')
    bind(ob)
    assert names(ob) == ["Detail", "Detail Deform", "Twin"]
    assert "'Detail' has to come before" in ob.detail_deform.status
    assert "should stand behind" in refusal(bpy.ops.object.detail_deform_place)


def test_a_wrong_place_is_reported_and_a_button_corrects_it():
    ob = bind(make_strip())
    assert "modifier stack" not in ob.detail_deform.status
    ob.modifiers.new("Twin", 'MIRROR')
    bpy.ops.object.modifier_move_to_index(modifier="Twin", index=0)
    assert "'Twin' comes before Detail Deform" in ob.detail_deform.status
    assert bpy.ops.object.detail_deform_place() == {'FINISHED'}
    assert names(ob) == ["Detail Deform", "Twin"] and "modifier stack" not in ob.detail_deform.status


def half(n=30):
    """A rough half sphere, x ≥ 0, to be mirrored across x = 0."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=2 * n, ring_count=n)
    ob = bpy.context.active_object
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.ops.mesh.bisect(plane_co=(0, 0, 0), plane_no=(1, 0, 0), clear_inner=True)
    bpy.ops.object.mode_set(mode='OBJECT')
    ob.modifiers.new("Mirror", 'MIRROR')
    return ob


def on_seam(ob):
    return np.abs(own(ob)[:, 0]) < 1e-4


def shown_offsets(ob):
    values = np.empty(3 * len(ob.data.vertices), np.float32)
    ob.data.attributes['detail_deform_offset'].data.foreach_get('vector', values)
    return values.reshape(-1, 3)


@pytest.mark.parametrize('across', [False, True])
@pytest.mark.parametrize('refine', [0, 4])
def test_the_seam_of_a_mirror_stays_closed(across, refine):
    """For a handle beside the plane, and for one on the plane that is moved away from it."""
    ob = half()
    ob.detail_deform.refine = refine
    p, seam = own(ob), on_seam(ob)
    assert seam.sum() > 20
    place = np.array((0, -1, 0)) if across else np.array((0.3, -0.95, 0))
    chosen = np.linalg.norm(p - place, axis=1) < 0.15
    assert (chosen & seam).any() == across
    empty = pull(ob, chosen, radius=1.2)
    empty.location += Vector((0.2, -0.5, 0.1))
    update()
    moved = shown_offsets(ob)
    assert np.abs(moved[seam, 0]).max() < 1e-6
    assert np.abs(moved[seam]).max() > 0.05
    if not across:
        assert np.abs(moved[chosen] - (0.2, -0.5, 0.1)).max() < 1e-5  # exact at the handle
    # No vertex crosses the plane.
    assert (np.abs(own(ob)[:, 0] + moved[:, 0])[~seam] > 1e-4).all()
    seen = evaluated(ob)
    assert len(seen) == 2 * len(p) - seam.sum()  # Mirror has merged the whole seam


def test_the_seam_stays_closed_in_an_extreme_unit():
    """Squares of lengths, 1e40, leave the range of single precision."""
    ob = half()
    seam, unit = on_seam(ob), 1e20
    places = unit * own(ob)
    places[seam, 0] = 0
    ob.data.vertices.foreach_set('co', places.astype(np.float32).ravel())
    update()
    chosen = np.linalg.norm(own(ob) / unit - (0.3, -0.95, 0), axis=1) < 0.15
    empty = pull(ob, chosen, radius=1.2 * unit)
    empty.location += unit * Vector((0.2, -0.5, 0.1))
    update()
    moved = shown_offsets(ob) / unit
    assert np.isfinite(moved).all() and np.abs(moved[seam, 0]).max() < 1e-6
    assert np.abs(moved[seam]).max() > 0.05


@pytest.mark.parametrize('pulls', [1, 2])
def test_a_mirror_added_after_pulls_closes_the_seam_that_was_not_held(pulls):
    ob = half()
    ob.modifiers.clear()
    seam = on_seam(ob)
    empty = pull(ob, np.linalg.norm(own(ob) - (0.3, -0.95, 0), axis=1) < 0.15, radius=1.2)
    empty.location.x += 0.2
    update()
    if pulls == 2:
        pull(ob, np.linalg.norm(own(ob) - (0.5, -0.85, 0.3), axis=1) < 0.1, radius=1.2)
    assert np.abs(shown_offsets(ob)[seam, 0]).max() > 1e-3
    ob.modifiers.new("Mirror", 'MIRROR')
    empty.location.x += 0.001
    update()
    assert np.abs(shown_offsets(ob)[seam, 0]).max() < 1e-6


def test_the_seam_of_another_objects_plane():
    ob = half()
    ob.matrix_world = Matrix.Translation((1, 2, 3)) @ Euler((0.4, 0.2, 0.9)).to_matrix().to_4x4()
    plane = bpy.data.objects.new("Plane", None)
    bpy.context.scene.collection.objects.link(plane)
    plane.matrix_world = ob.matrix_world.copy()
    ob.modifiers["Mirror"].mirror_object = plane
    update()
    seam = on_seam(ob)
    empty = pull(ob, np.linalg.norm(own(ob) - (0.3, -0.95, 0), axis=1) < 0.15, radius=1.2)
    empty.location.x += 0.2
    update()
    assert np.abs(shown_offsets(ob)[seam, 0]).max() < 1e-5


def test_the_seam_of_a_small_mesh_far_away(part):
    """Blender 5.2 gives matrices to numpy in single precision. Inverted in that, the plane's error would be larger than
    the distance within which Mirror merges."""
    ob = half()
    ob.matrix_world = (Matrix.Translation((1000, 500, 300)) @ Euler((0.4, 0.2, 0.9)).to_matrix().to_4x4()
                       @ Matrix.Scale(0.01, 4))
    plane = bpy.data.objects.new("Plane", None)
    bpy.context.scene.collection.objects.link(plane)
    plane.matrix_world = ob.matrix_world.copy()
    ob.modifiers["Mirror"].mirror_object = plane
    update()
    (point, normal, distance), = part('scene.mirror_plane')._planes(ob)
    assert abs(point @ normal) < 1e-3 * distance and np.abs(normal - (1, 0, 0)).max() < 1e-6


# ---- armatures

def rigged(bend=0.0):
    """(mesh object, armature object): a column with two bones, the upper of which is bent."""
    bpy.ops.mesh.primitive_cylinder_add(vertices=24, radius=0.3, depth=0.1)
    ob = bpy.context.active_object
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.ops.mesh.delete(type='ONLY_FACE')
    bpy.ops.object.mode_set(mode='OBJECT')
    rings, around = 41, 24
    z, a = np.meshgrid(np.linspace(0, 4, rings), np.arange(around) * 2 * np.pi / around, indexing='ij')
    p = np.stack([0.3 * np.cos(a), 0.3 * np.sin(a), z], -1).reshape(-1, 3)
    faces = [(i * around + j, i * around + (j + 1) % around, (i + 1) * around + (j + 1) % around, (i + 1) * around + j)
             for i in range(rings - 1) for j in range(around)]
    mesh = bpy.data.meshes.new("Column")
    mesh.from_pydata(p.tolist(), [], faces)
    ob.data = mesh
    bones = bpy.data.armatures.new("Bones")
    rig = bpy.data.objects.new("Rig", bones)
    bpy.context.scene.collection.objects.link(rig)
    activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    for name, low, high in (("lower", 0, 2), ("upper", 2, 4)):
        bone = bones.edit_bones.new(name)
        bone.head, bone.tail = (0, 0, low), (0, 0, high)
    bones.edit_bones["upper"].parent = bones.edit_bones["lower"]
    bpy.ops.object.mode_set(mode='OBJECT')
    weight = np.clip((p[:, 2] - 1.5) / 1.0, 0, 1)
    for name, values in (("lower", 1 - weight), ("upper", weight)):
        made = ob.vertex_groups.new(name=name)
        for vertex, value in enumerate(values.tolist()):
            if value > 0:
                made.add([vertex], value, 'REPLACE')
    ob.modifiers.new("Armature", 'ARMATURE').object = rig
    turn(rig, bend)
    return activate(ob), rig


def turn(rig, bend):
    bone = rig.pose.bones["upper"]
    bone.rotation_mode = 'XYZ'
    bone.rotation_euler = (bend, 0, 0)
    update()


@pytest.mark.parametrize('height', [3.5, 2.0])
def test_on_a_posed_bone_the_empty_stands_on_the_skin_and_goes_along(height):
    ob, rig = rigged(bend=1.2)
    p = own(ob)
    chosen = (np.abs(p[:, 2] - height) < 0.15) & (p[:, 1] < -0.2)
    before = evaluated(ob)
    empty = pull(ob, chosen, radius=0.8)
    assert names(ob) == ["Detail Deform", "Armature"]
    assert empty.parent == rig and empty.parent_type == 'BONE'
    assert np.abs(evaluated(ob) - before).max() < 1e-5
    place = np.array(empty.matrix_world.translation)
    assert np.linalg.norm(evaluated(ob)[chosen].mean(0) - place) < 0.02

    # The empty is moved along the world's X axis, and the skin moves so.
    empty.matrix_world = Matrix.Translation((0.3, 0, 0)) @ empty.matrix_world
    update()
    moved = evaluated(ob) - before
    # At 2.0 both bones have weights, and their blended motion isn't the rigid one of the empty's bone.
    tolerance = 1e-4 if height > 3 else 0.15
    assert np.abs(moved[chosen] - (0.3, 0, 0)).max() < tolerance
    # When the bone turns, the offsets before the armature stay, and the empty goes along with the skin.
    at_rest = shown_offsets(ob).copy()
    turn(rig, -0.5)
    assert np.abs(shown_offsets(ob) - at_rest).max() < 1e-4
    if height > 3:
        place = np.array(empty.matrix_world.translation)
        assert np.linalg.norm(evaluated(ob)[chosen].mean(0) - place) < 0.02


def test_back_to_rest_on_a_posed_bone():
    ob, rig = rigged(bend=0.8)
    p = own(ob)
    before = evaluated(ob)
    empty = pull(ob, (np.abs(p[:, 2] - 3.5) < 0.15) & (p[:, 1] < -0.2), radius=0.8)
    place = empty.matrix_world.copy()
    empty.location.x += 0.3
    update()
    turn(rig, -0.5)
    activate(ob)
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    turn(rig, 0.8)
    assert np.abs(evaluated(ob) - before).max() < 1e-5
    assert np.abs(np.array(empty.matrix_world) - np.array(place)).max() < 1e-5


def test_a_second_pull_on_a_posed_bone():
    ob, _ = rigged(bend=0.8)
    p = own(ob)
    empty = pull(ob, (np.abs(p[:, 2] - 3.5) < 0.15) & (p[:, 1] < -0.2), radius=1.5)
    empty.matrix_world = Matrix.Translation((0.3, 0, 0)) @ empty.matrix_world
    update()
    before = evaluated(ob)
    spot = (np.abs(p[:, 2] - 2.9) < 0.15) & (p[:, 1] < -0.2)
    second = pull(ob, spot, radius=1.5)
    assert np.abs(evaluated(ob) - before).max() < 1e-4
    assert np.linalg.norm(evaluated(ob)[spot].mean(0) - np.array(second.matrix_world.translation)) < 0.05


@pytest.mark.parametrize('pulled_again', [False, True])
def test_hiding_the_armature_changes_no_shape(pulled_again):
    ob, _ = rigged(bend=1.2)
    p = own(ob)
    empty = pull(ob, (np.abs(p[:, 2] - 3.5) < 0.15) & (p[:, 1] < -0.2), radius=1.5)
    empty.matrix_world = Matrix.Translation((0.3, 0, 0)) @ empty.matrix_world
    update()
    before, seen = shown_offsets(ob).copy(), evaluated(ob)
    ob.modifiers["Armature"].show_viewport = False
    update()
    assert np.abs(shown_offsets(ob) - before).max() < 1e-4
    if pulled_again:
        pull(ob, (np.abs(p[:, 2] - 2.9) < 0.15) & (p[:, 1] < -0.2), radius=1.5)
    ob.modifiers["Armature"].show_viewport = True
    update()
    assert np.abs(evaluated(ob) - seen).max() < 1e-4


def test_a_bone_that_is_gone_is_named():
    ob, rig = rigged(bend=1.2)
    p = own(ob)
    empty = pull(ob, (np.abs(p[:, 2] - 3.5) < 0.15) & (p[:, 1] < -0.2), radius=1.5)
    before = shown_offsets(ob).copy()
    activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    rig.data.edit_bones.remove(rig.data.edit_bones["upper"])
    bpy.ops.object.mode_set(mode='OBJECT')
    empty.location.x += 0.1
    update()
    assert "'upper' of 'Rig'" in ob.detail_deform.status
    assert np.abs(shown_offsets(ob) - before).max() < 1e-6


@pytest.mark.parametrize('parented', [True, False])
def test_of_two_armatures_the_posing_one_is_the_parent(parented):
    ob, rig = rigged(bend=1.2)
    other = bpy.data.objects.new("Other", bpy.data.armatures.new("Other"))
    bpy.context.scene.collection.objects.link(other)
    first = ob.modifiers.new("First", 'ARMATURE')
    first.object = other
    bpy.ops.object.modifier_move_to_index(modifier="First", index=0)
    chosen = (np.abs(own(ob)[:, 2] - 3.5) < 0.15) & (own(ob)[:, 1] < -0.2)
    select(ob, chosen)
    bpy.ops.object.detail_deform_handle_add(parented=parented)
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    empty = ob.detail_deform.handles[0].target
    assert empty.parent == (rig if parented else None)
    assert np.linalg.norm(evaluated(ob)[chosen].mean(0) - np.array(empty.matrix_world.translation)) < 0.02


def test_a_soft_body_stays_before_and_is_reported():
    ob = make_strip()
    ob.detail_deform.show_as = 'MODIFIER'
    ob.modifiers.new("Soft", 'SOFT_BODY')
    bind(ob)
    assert names(ob) == ["Soft", "Detail Deform"] and "'Soft' has to come before" in ob.detail_deform.status


# ---- Edit Mode's symmetry

def test_symmetry_makes_no_second_handle_on_the_middle_or_on_a_half():
    ob = symmetric(41)
    ob.data.use_mirror_x = True
    pull(ob, np.linalg.norm(own(ob)[:, :2], axis=1) < 0.06, radius=0.3)
    assert len(ob.detail_deform.handles) == 1
    ob = half()
    ob.data.use_mirror_x = True
    pull(ob, np.linalg.norm(own(ob) - (0.3, -0.95, 0), axis=1) < 0.15, radius=0.5)
    assert len(ob.detail_deform.handles) == 1


def test_a_symmetric_pull_that_fails_adds_neither_handle():
    ob = symmetric(41)
    ob.data.use_mirror_x = True
    chosen = own(ob)[:, 0] > 0.4
    pull(ob, chosen, radius=0.3)
    select(ob, own(ob)[:, 0] > 0.45)
    assert "larger weight" in refusal(bpy.ops.object.detail_deform_pull)
    assert len(ob.detail_deform.handles) == 2
