# SPDX-License-Identifier: GPL-3.0-or-later
"""On a mesh that is posed by other modifiers than one plain armature, a handle's empty is placed on the displayed
surface, and the displayed vertices move and turn as the empty does."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from conftest import activate, add_from, bind, evaluated, group, make_strip, own, pull, update

LENGTH, AROUND = 3.0, 12


def make_limb():
    angles = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    heights = np.linspace(0, LENGTH, 49)
    points = [(0.2 * np.cos(a), 0.2 * np.sin(a), z) for z in heights for a in angles]
    faces = [(r * AROUND + k, r * AROUND + (k + 1) % AROUND, (r + 1) * AROUND + (k + 1) % AROUND, (r + 1) * AROUND + k)
             for r in range(len(heights) - 1) for k in range(AROUND)]
    mesh = bpy.data.meshes.new("Limb")
    mesh.from_pydata(points, [], faces)
    ob = bpy.data.objects.new("Limb", mesh)
    bpy.context.scene.collection.objects.link(ob)
    ob.matrix_world = Matrix.Translation((1, -2, 0.5)) @ Matrix.Rotation(0.7, 4, (1, 2, 3)) @ Matrix.Scale(1.5, 4)
    return ob


def in_space_of(ob, other):
    """Adds another object to the scene with the mesh's transform, so that both share a local space."""
    bpy.context.scene.collection.objects.link(other)
    other.matrix_world = ob.matrix_world
    return other


def by_curve(ob):
    data = bpy.data.curves.new("Curve", 'CURVE')
    data.dimensions = '3D'
    spline = data.splines.new('POLY')
    turns = np.linspace(0, 1.6, 33)
    spline.points.add(len(turns) - 1)
    for point, turn in zip(spline.points, turns):
        point.co = (0, 5 + 2 * np.sin(turn), 2 - 2 * np.cos(turn), 1)
    modifier = ob.modifiers.new("Curve", 'CURVE')
    modifier.object, modifier.deform_axis = in_space_of(ob, bpy.data.objects.new("Curve", data)), 'POS_Z'


def by_lattice(ob):
    """A lattice that stretches by a half and leans over. It is larger than the limb, so that the moved limb stays in
    it."""
    data = bpy.data.lattices.new("Lattice")
    lattice = in_space_of(ob, bpy.data.objects.new("Lattice", data))
    lattice.matrix_world = ob.matrix_world @ Matrix.Translation((0, 0, LENGTH / 2)) @ Matrix.Scale(2 * LENGTH, 4)
    turn = np.array(Matrix.Rotation(1.1, 3, 'X'))
    for point in data.points:
        point.co_deform = Vector(1.5 * turn @ np.array(point.co)) + Vector((0, 0.1, 0.2))
    ob.modifiers.new("Lattice", 'LATTICE').object = lattice


def by_bend(ob):
    modifier = ob.modifiers.new("Bend", 'SIMPLE_DEFORM')
    modifier.deform_method, modifier.deform_axis, modifier.angle = 'BEND', 'X', 1.5


def by_hook(ob):
    target = in_space_of(ob, bpy.data.objects.new("Hook", None))
    update()
    modifier = ob.modifiers.new("Hook", 'HOOK')
    modifier.object, modifier.vertex_group = target, group(ob, "Hooked", np.flatnonzero(own(ob)[:, 2] > 1.5)).name
    modifier.matrix_inverse = target.matrix_world.inverted() @ ob.matrix_world
    target.matrix_world = ob.matrix_world @ Matrix.Translation((0.5, 0, 0)) @ Matrix.Rotation(0.8, 4, 'X')


def add_rig(ob, name, low):
    rig = in_space_of(ob, bpy.data.objects.new(name, bpy.data.armatures.new(name)))
    activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    bone = rig.data.edit_bones.new(name)
    bone.head, bone.tail = (0, 0, low), (0, 0, LENGTH)
    bpy.ops.object.mode_set(mode='OBJECT')
    group(ob, name, np.flatnonzero(own(ob)[:, 2] > low))
    modifier = ob.modifiers.new(name, 'ARMATURE')
    modifier.object = rig
    rig.pose.bones[0].rotation_mode = 'XYZ'
    rig.pose.bones[0].rotation_euler.x = 0.6
    return modifier


def by_two_armatures(ob):
    add_rig(ob, "A", 1.0)
    add_rig(ob, "B", 1.5)


def by_mixed_armatures(ob):
    by_two_armatures(ob)
    modifier = ob.modifiers["B"]
    modifier.use_multi_modifier = True
    modifier.vertex_group = group(ob, "Mixed", np.flatnonzero(own(ob)[:, 2] > 2)).name
    for vertex in range(len(ob.data.vertices)):
        ob.vertex_groups["Mixed"].add([vertex], 0.5, 'REPLACE')


def by_part_of_armature(ob):
    ob.vertex_groups.new(name="Half").add(range(len(ob.data.vertices)), 0.5, 'REPLACE')
    add_rig(ob, "A", 1.0).vertex_group = "Half"


def by_armature_that_keeps_volume(ob):
    modifier = add_rig(ob, "A", 1.0)
    modifier.use_deform_preserve_volume = True


def by_envelopes(ob):
    modifier = add_rig(ob, "A", 1.0)
    modifier.use_vertex_groups, modifier.use_bone_envelopes = False, True
    modifier.object.data.bones[0].envelope_distance = 1.0


def by_nodes(ob):
    tree = bpy.data.node_groups.new("Turn", 'GeometryNodeTree')
    if hasattr(tree, 'interface'):
        for way in ('INPUT', 'OUTPUT'):
            tree.interface.new_socket("Geometry", in_out=way, socket_type='NodeSocketGeometry')
    else:
        tree.inputs.new('NodeSocketGeometry', "Geometry")
        tree.outputs.new('NodeSocketGeometry', "Geometry")
    first, last = tree.nodes.new('NodeGroupInput'), tree.nodes.new('NodeGroupOutput')
    node = tree.nodes.new('GeometryNodeTransform')
    node.inputs['Rotation'].default_value = (0.9, 0, 0.3)
    node.inputs['Translation'].default_value = (1, 2, 3)
    tree.links.new(first.outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], last.inputs[0])
    ob.modifiers.new("Turn", 'NODES').node_group = tree


def by_curve_and_subdivision(ob):
    by_curve(ob)
    ob.modifiers.new("Subdivision", 'SUBSURF')


POSED = {f.__name__[3:]: f for f in (
    by_curve, by_lattice, by_bend, by_hook, by_two_armatures, by_mixed_armatures, by_part_of_armature,
    by_armature_that_keeps_volume, by_envelopes, by_nodes, by_curve_and_subdivision)}


def seen(ob):
    """(n, 3) float64: the displayed positions of the mesh's own vertices, in the world."""
    hidden = [m for m in ob.modifiers if m.type == 'SUBSURF' and m.show_viewport]
    for modifier in hidden:
        modifier.show_viewport = False
    update()
    world = np.array(ob.matrix_world)
    result = evaluated(ob).astype(np.float64) @ world[:3, :3].T + world[:3, 3]
    for modifier in hidden:
        modifier.show_viewport = True
    update()
    return result


def tip_of(ob):
    return own(ob)[:, 2] > LENGTH - 0.2


# Tolerances as fractions of the motion, 0.1 for other modifiers. The add-on replaces the modifiers by the similarity
# that it measured when the empty was placed. A Bend also depends on the mesh's bounding box, which the motion changes.
FIRST_ORDER = {'bend': 0.3}


def place(empty):
    return np.array(empty.matrix_world.translation)


def extent(points):
    return np.linalg.norm(np.ptp(points, axis=0))


@pytest.fixture(params=POSED)
def posed(request):
    ob = make_limb()
    POSED[request.param](ob)
    ob['kind'] = request.param
    return activate(ob)


def test_a_pull_places_its_empty_on_its_vertices_and_moves_nothing(posed):
    tip, before = tip_of(posed), seen(posed)
    empty = pull(posed, tip, radius=1.5)
    assert np.linalg.norm(place(empty) - before[tip].mean(axis=0)) < 1e-4 * extent(before)
    assert np.abs(seen(posed) - before).max() < 1e-4 * extent(before)
    assert np.allclose(empty.matrix_world.to_scale(), (1, 1, 1), atol=1e-4)


def test_displayed_vertices_move_as_the_empty_does(posed):
    tip = tip_of(posed)
    empty = pull(posed, tip, radius=1.5)
    before, step = seen(posed), np.array((0.1, 0.2, -0.1))
    empty.matrix_world = Matrix.Translation(step) @ empty.matrix_world
    moved = (seen(posed) - before)[tip].mean(axis=0)
    assert np.linalg.norm(moved - step) < FIRST_ORDER.get(posed['kind'], 0.1) * np.linalg.norm(step)


def test_displayed_vertices_turn_as_the_empty_does(posed):
    tip = tip_of(posed)
    empty = pull(posed, tip, radius=1.5)
    before, middle = seen(posed)[tip], Matrix.Translation(empty.matrix_world.translation)
    turn = Matrix.Rotation(0.4, 4, (1, 0.5, -0.2))
    empty.matrix_world = middle @ turn @ middle.inverted() @ empty.matrix_world
    after, before = (points - points.mean(axis=0) for points in (seen(posed)[tip], before))
    right = before @ np.array(turn)[:3, :3].T
    assert np.abs(after - right).max() < 0.15 * np.abs(right - before).max()


@pytest.mark.parametrize('operator', ['handle_add', 'pull'])
def test_a_single_vertex_is_posed_by_the_rotation_of_its_neighbours(operator):
    ob = make_limb()
    by_lattice(ob)
    chosen = np.arange(len(own(ob))) == 40 * AROUND
    before = seen(ob)
    if operator == 'pull':
        empty = pull(activate(ob), chosen, radius=1.5)
    else:
        empty = add_from(activate(ob), chosen).target
        update()
        group(ob, "region", np.flatnonzero(own(ob)[:, 2] > 1))
        ob.detail_deform.region = "region"
        bind(ob)
    assert np.linalg.norm(place(empty) - before[chosen].mean(axis=0)) < 1e-4 * extent(before)
    step = np.array((0.05, 0.1, -0.05))
    empty.matrix_world = Matrix.Translation(step) @ empty.matrix_world
    assert np.linalg.norm((seen(ob) - before)[chosen][0] - step) < 0.1 * np.linalg.norm(step)


def test_a_handle_that_was_there_before_the_pose_counts_from_bind():
    """Its empty stays where it was placed, and the displayed vertices move as it does."""
    ob = make_limb()
    tip = tip_of(ob)
    add_from(activate(ob), tip)
    group(ob, "region", np.flatnonzero(own(ob)[:, 2] > 1))
    ob.detail_deform.region = "region"
    by_lattice(ob)
    before = seen(bind(ob))
    empty, step = ob.detail_deform.handles[0].target, np.array((0.05, 0.1, -0.05))
    empty.matrix_world = Matrix.Translation(step) @ empty.matrix_world
    assert np.linalg.norm((seen(ob) - before)[tip].mean(axis=0) - step) < 0.1 * np.linalg.norm(step)


def test_rebind_and_set_origin_keep_the_pose():
    ob = make_limb()
    by_two_armatures(ob)
    empty = pull(activate(ob), tip_of(ob), radius=1.5)
    empty.matrix_world = Matrix.Translation((0.1, 0.3, 0)) @ empty.matrix_world
    before = seen(ob)
    activate(ob)
    assert bpy.ops.object.detail_deform_bind(wait=True, keep_rest=True) == {'FINISHED'}
    assert np.abs(seen(ob) - before).max() < 1e-4 * extent(before)
    bpy.ops.object.transform_apply(location=True, rotation=True, scale=True)
    before = seen(ob)  # anew, because an armature's effect depends on the object's local space
    activate(ob)
    assert bpy.ops.object.detail_deform_bind(wait=True, keep_rest=True) == {'FINISHED'}
    assert np.abs(seen(ob) - before).max() < 1e-4 * extent(before)


def test_back_to_rest_puts_the_empty_on_the_surface_as_displayed_by_then():
    ob = make_limb()
    by_hook(ob)
    tip = tip_of(ob)
    empty = pull(activate(ob), tip, radius=1.5)
    empty.matrix_world = Matrix.Translation((0.1, 0.3, 0)) @ empty.matrix_world
    hook = bpy.data.objects["Hook"]
    hook.matrix_world = hook.matrix_world @ Matrix.Rotation(-1.5, 4, 'X')
    activate(ob)
    assert bpy.ops.object.detail_deform_handle_reset(everything=True) == {'FINISHED'}
    at_rest = seen(ob)
    assert np.linalg.norm(place(empty) - at_rest[tip].mean(axis=0)) < 1e-4 * extent(at_rest)
    step = np.array((0.05, 0.1, -0.05))
    empty.matrix_world = Matrix.Translation(step) @ empty.matrix_world
    moved = (seen(ob) - at_rest)[tip].mean(axis=0)
    assert np.linalg.norm(moved - step) < 0.1 * np.linalg.norm(step)


def test_a_second_handle_stands_on_the_surface_moved_by_the_first():
    ob = make_limb()
    by_bend(ob)
    first = pull(activate(ob), tip_of(ob), radius=1.5)
    first.matrix_world = Matrix.Translation((0.1, 0.3, 0)) @ first.matrix_world
    before, chosen = seen(ob), np.abs(own(ob)[:, 2] - 2.2) < 0.1
    empty = pull(activate(ob), chosen, radius=1.0)
    assert np.abs(seen(ob) - before).max() < 1e-3 * extent(before)
    assert np.linalg.norm(place(empty) - before[chosen].mean(axis=0)) < 1e-3 * extent(before)


def test_the_mirrored_handle_stands_on_its_vertices():
    ob = make_limb()
    by_bend(ob)
    side = (own(ob)[:, 2] > 2) & (own(ob)[:, 0] > 0.1)
    before = seen(ob)
    pull(activate(ob), side, radius=1.5)
    activate(ob)
    assert bpy.ops.object.detail_deform_handle_mirror(axis='X', symmetric=False) == {'FINISHED'}
    update()
    handle = ob.detail_deform.handles[-1]
    other = (own(ob)[:, 2] > 2) & (own(ob)[:, 0] < -0.1)
    assert np.linalg.norm(place(handle.target) - before[other].mean(axis=0)) < 1e-4 * extent(before)


@pytest.mark.parametrize('type_', ['DISPLACE', 'SMOOTH'])
def test_modifiers_that_only_add_offsets_rotate_no_handle(type_):
    """They change the displayed shape, but not the directions in which it moves."""
    ob = make_strip()
    modifier = ob.modifiers.new("Adder", type_)
    if type_ == 'DISPLACE':
        modifier.direction, modifier.strength = 'NORMAL', 0.3
    else:
        modifier.iterations = 10
    ob.detail_deform.handles.clear()
    ob.detail_deform.region = ""
    p = own(ob)
    patch = (np.abs(p[:, 0] - 0.5) < 0.12) & (np.abs(p[:, 1] - 0.5) < 0.12)
    before = seen(ob)
    empty = pull(activate(ob), patch, radius=0.3)
    assert np.linalg.norm(place(empty) - before[patch].mean(axis=0)) < 1e-4
    assert np.allclose(ob.detail_deform.handles[0].pose_matrix[:3], (1, 0, 0), atol=1e-6)


def test_modifiers_behind_one_that_makes_other_vertices_pose_no_handle():
    ob = make_limb()
    ob.modifiers.new("Remesh", 'REMESH').voxel_size = 0.1
    by_bend(ob)
    tip = tip_of(ob)
    empty = pull(activate(ob), tip, radius=1.5)
    assert not any(ob.detail_deform.handles[0].pose_matrix)
    mean = ob.matrix_world @ Vector(own(ob)[tip].mean(axis=0))  # of the vertices where the mesh has them
    assert np.linalg.norm(place(empty) - np.array(mean)) < 1e-5
