# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface follows its handles' empties."""
import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from conftest import (activate, add_empty, add_handle, bind, evaluated, group, make_strip, members,
                      own, update, wavy)


def right(ob):
    return ob.detail_deform.handles[0].target


def lift(ob, height=0.4):
    right(ob).location.z += height
    update()
    return evaluated(ob)


def test_the_surface_follows_and_the_mesh_itself_does_not_change():
    ob = make_strip()
    rest = own(ob)
    bind(ob)
    moved = lift(ob) - rest
    fixed, handle = ~members(ob, 'region'), members(ob, 'right')
    assert np.abs(moved[fixed]).max() == 0
    assert np.allclose(moved[handle], (0, 0, 0.4), atol=1e-6)
    free = ~fixed & ~handle
    assert moved[free, 2].max() > 0.35 and moved[free, 2].min() > -0.02
    assert (own(ob) == rest).all()
    right(ob).location.z -= 0.4
    update()
    assert np.abs(evaluated(ob) - rest).max() < 1e-6


def test_details_turn_with_the_surface():
    """In the middle of the lifted strip the ridges' normals lean back with the slope."""
    ob = make_strip(61)
    bind(ob)
    lift(ob, 0.6)
    mesh = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    slope = math.atan2(0.6, 0.9)
    middle = [p for p in mesh.polygons if 0.4 < ob.data.vertices[p.vertices[0]].co.x < 0.6]
    mean = sum((p.normal for p in middle), Vector()) / len(middle)
    assert math.atan2(-mean.x, mean.z) > 0.7 * slope


def test_every_way_to_move_an_empty_is_followed():
    ob = make_strip()
    bind(ob)
    reference = lift(ob)
    right(ob).location.z -= 0.4
    update()

    parent = add_empty('Parent', (0, 0, 0))
    right(ob).parent = parent
    update()
    parent.location.z = 0.4
    update()
    assert np.abs(evaluated(ob) - reference).max() < 1e-6
    parent.location.z = 0
    right(ob).parent = None
    update()

    leader = add_empty('Leader', right(ob).location)
    constraint = right(ob).constraints.new('COPY_LOCATION')
    constraint.target = leader
    update()
    leader.location.z += 0.4
    update()
    assert np.abs(evaluated(ob) - reference).max() < 1e-6
    right(ob).constraints.remove(constraint)
    update()

    driver = right(ob).driver_add('location', 2).driver
    driver.expression = '0.4 + 0'
    update()
    assert np.abs(evaluated(ob) - reference).max() < 1e-6


def test_playback_follows_keyframes():
    ob = make_strip()
    empty = right(ob)
    for frame, z in ((1, 0.0), (10, 0.4)):
        empty.location.z = z
        empty.keyframe_insert('location', frame=frame)
    bpy.context.scene.frame_set(1)
    bind(ob)
    heights = []
    for frame in range(1, 11):
        bpy.context.scene.frame_set(frame)
        heights.append(evaluated(ob)[members(ob, 'right'), 2].mean())
    assert (np.diff(heights) > 0).all()
    assert heights[-1] - heights[0] == pytest.approx(0.4, abs=1e-5)
    bpy.context.scene.frame_set(1)
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6


@pytest.mark.parametrize('engine', ['BLENDER_WORKBENCH', 'CYCLES'])
def test_renders_show_the_frame_they_render(engine, tmp_path):
    ob = make_strip()
    empty = right(ob)
    for frame, z in ((1, 0.0), (3, 0.6), (4, 0.0)):
        empty.location.z = z
        empty.keyframe_insert('location', frame=frame)
    scene = bpy.context.scene
    scene.frame_set(1)
    bind(ob)
    camera = bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera'))
    scene.collection.objects.link(camera)
    camera.location, camera.rotation_euler = (0.5, -3, 0.3), (math.pi / 2, 0, 0)
    scene.camera = camera
    scene.render.engine = engine
    if engine == 'CYCLES':
        scene.cycles.samples, scene.cycles.use_denoising = 4, False
        shining = bpy.data.materials.new("Shining")
        shining.use_nodes = True
        nodes = shining.node_tree.nodes
        shining.node_tree.links.new(nodes.new('ShaderNodeEmission').outputs[0], nodes['Material Output'].inputs[0])
        ob.data.materials.append(shining)
    scene.render.resolution_x, scene.render.resolution_y = 96, 72
    scene.frame_start, scene.frame_end = 1, 4
    scene.render.filepath = str(tmp_path / 'frame_')
    # A raw format that numpy can read: Blender 5.2 opens no image under Wine.
    scene.render.image_settings.file_format = 'TARGA_RAW'
    bpy.ops.render.render(animation=True)

    def pixels(frame):
        return np.fromfile(tmp_path / f'frame_{frame:04d}.tga', np.uint8)[18:] / 255

    first, second, third, fourth = (pixels(frame) for frame in (1, 2, 3, 4))
    # The fourth frame has the first one's pose, so these two differ by the renderer's noise alone.
    assert np.abs(first - third).mean() > 3 * np.abs(first - fourth).mean() + 1e-3
    assert np.abs(second - third).mean() > 1e-3


def hide_nothing(empty):
    pass


def hide_in_renders(empty):
    empty.hide_render = True


def hide_collection_in_renders(empty):
    collection = bpy.data.collections.new('Rig')
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(empty)
    bpy.context.scene.collection.objects.unlink(empty)
    collection.hide_render = True


@pytest.mark.parametrize('hide', [hide_nothing, hide_in_renders, hide_collection_in_renders])
def test_renders_follow_empties_that_are_hidden_in_them(hide, tmp_path):
    ob = make_strip()
    empty = right(ob)
    for frame, z in ((1, 0.0), (3, 0.6)):
        empty.location.z = z
        empty.keyframe_insert('location', frame=frame)
    hide(empty)
    scene = bpy.context.scene
    scene.frame_set(1)
    bind(ob)
    camera = bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera'))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = 'BLENDER_WORKBENCH'
    scene.render.resolution_x, scene.render.resolution_y = 16, 12
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(tmp_path / 'frame_')
    heights = {}

    def look(scene, depsgraph):
        offsets = np.empty(3 * len(ob.data.vertices), np.float32)
        ob.data.attributes['detail_deform_offset'].data.foreach_get('vector', offsets)
        if depsgraph.mode == 'RENDER':
            heights[scene.frame_current] = offsets.max()

    bpy.app.handlers.frame_change_post.append(look)
    try:
        bpy.ops.render.render(animation=True)
    finally:
        bpy.app.handlers.frame_change_post.remove(look)
    assert heights[1] == pytest.approx(0, abs=1e-6) and heights[3] == pytest.approx(0.6, abs=1e-5)


def test_empties_parented_to_the_object_make_no_dependency_cycle(capfd):
    ob = make_strip()
    bpy.ops.object.detail_deform_handle_remove()
    bpy.ops.object.detail_deform_handle_add(vertex_group='right')
    bind(ob)
    assert right(ob).parent == ob
    lifted = lift(ob)
    ob.location = (3, 2, 1)
    update()
    assert np.abs(evaluated(ob) - lifted).max() < 1e-6
    assert 'cycle' not in ''.join(capfd.readouterr()).lower()


def test_another_empty_can_take_over_a_handle():
    ob = make_strip()
    bind(ob)
    other = add_empty('Other', right(ob).location)
    ob.detail_deform.handles[0].target = other
    update()
    assert np.abs(lift(ob) - own(ob)).max() > 0.39
    driver = ob.animation_data.drivers[0].driver
    assert [v.targets[0].id for v in driver.variables] == [other]


def test_no_work_without_a_move(part):
    ob = make_strip()
    bind(ob)
    lift(ob)
    writes = []
    offset_attribute = part('scene.offset_attribute')
    original = offset_attribute.write
    offset_attribute.write = lambda *arguments: (writes.append(1), original(*arguments))[1]
    try:
        other = add_empty('Unrelated', (0, 0, 0))
        for step in range(3):
            other.location.x += 1
            update()
            bpy.context.scene.frame_set(step + 2)
        assert writes == []
        lift(ob, 0.1)
        assert writes == [1]
    finally:
        offset_attribute.write = original


def test_live_off_waits_for_update():
    ob = make_strip()
    bind(ob)
    ob.detail_deform.live = False
    assert np.abs(lift(ob) - own(ob)).max() < 1e-6
    assert bpy.ops.object.detail_deform_update() == {'FINISHED'}
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() > 0.39


def test_factor_scales_the_offsets_and_later_modifiers_see_the_result(part):
    ob = make_strip()
    bind(ob)
    full = lift(ob)
    deform_modifier, node_inputs = part('scene.deform_modifier'), part('scene.node_inputs')
    modifier = deform_modifier.find(ob)
    assert modifier.name == 'Detail Deform'
    assert deform_modifier.factor(ob, modifier) == 1
    socket = node_inputs.socket_of(modifier.node_group, 'Factor')
    inputs = getattr(getattr(modifier, 'properties', None), 'inputs', None)
    if inputs is not None:
        getattr(inputs, socket.identifier).value = 0.25
    else:
        modifier[socket.identifier] = 0.25
    ob.update_tag()
    update()
    assert deform_modifier.factor(ob, modifier) == 0.25
    assert np.allclose(evaluated(ob), own(ob) + 0.25 * (full - own(ob)), atol=1e-6)

    mirror = ob.modifiers.new('Array', 'ARRAY')
    update()
    assert len(evaluated(ob)) == 2 * len(own(ob))
    ob.modifiers.remove(mirror)


def test_two_handles_share_vertices_by_weight():
    ob = make_strip()
    columns = np.repeat(np.arange(25), 25)
    second = group(ob, 'second', np.flatnonzero(columns >= 20))
    second.add([int(v) for v in np.flatnonzero(columns >= 23)], 0.6, 'REPLACE')
    add_handle(ob, 'second', add_empty('Second', (0.9, 0.5, 0)))
    bind(ob)
    right(ob).location.z += 0.3
    ob.detail_deform.handles[1].target.location.y += 0.2
    update()
    moved = evaluated(ob) - own(ob)
    assert np.allclose(moved[columns >= 23], (0, 0, 0.3), atol=1e-6)
    assert np.allclose(moved[(columns >= 20) & (columns < 22)], (0, 0.2, 0), atol=1e-6)


def test_several_objects_each_follow_their_own_empties():
    first, second = make_strip(name="A"), make_strip(name="B")
    bind(first)
    bind(second)
    lift(first, 0.5)
    assert np.abs(evaluated(second) - own(second)).max() < 1e-6
    right(second).location.y += 0.3
    update()
    assert np.abs((evaluated(second) - own(second))[:, 1]).max() > 0.29
    assert np.abs((evaluated(first) - own(first))[:, 1]).max() < 0.1


# ---- unit, transform and parents of object and empties

WORLDS = {
    'turned': Matrix.Translation((3, -2, 1)) @ Matrix.Rotation(0.8, 4, 'X'),
    'larger': Matrix.Scale(2.5, 4),
    'all': Matrix.Translation((30, 10, -5)) @ Matrix.Rotation(1.1, 4, 'Z') @ Matrix.Diagonal((0.4, 0.4, -0.4, 1)),
}


def local_motion(ob, motion):
    """Moves the right empty so that its motion in the object's space is the given one."""
    world = ob.matrix_world
    empty = right(ob)
    empty.matrix_world = world @ motion @ world.inverted() @ empty.matrix_world
    update()
    return evaluated(ob)


MOTION = Matrix.Translation((0.1, 0, 0.35))


@pytest.mark.parametrize('name', WORLDS)
def test_the_objects_transform_changes_nothing(name):
    plain = make_strip(name="Plain")
    bind(plain)
    expected = local_motion(plain, MOTION)
    ob = make_strip(name="Placed", world=WORLDS[name])
    bind(ob)
    assert np.abs(local_motion(ob, MOTION) - expected).max() < 2e-5


def test_moving_object_and_empties_together_changes_nothing():
    ob = make_strip()
    root = add_empty('Root', (0, 0, 0))
    ob.parent = root
    right(ob).parent = root
    update()
    bind(ob)
    expected = lift(ob)
    root.matrix_world = Matrix.Translation((5, 2, 1)) @ Matrix.Rotation(2, 4, 'Y') @ Matrix.Diagonal((3, 3, 3, 1))
    update()
    assert np.abs(evaluated(ob) - expected).max() < 2e-6


@pytest.mark.parametrize('scale', [1e-4, 1e4])
def test_the_unit_changes_nothing(scale):
    plain = make_strip(name="Plain")
    bind(plain)
    expected = lift(plain, 0.4)
    ob = make_strip(name="Scaled", scale=scale)
    bind(ob)
    assert np.abs(lift(ob, 0.4 * scale) / scale - expected).max() < 1e-5


def test_the_numbering_of_vertices_changes_nothing():
    plain = make_strip(name="Plain")
    bind(plain)
    expected = lift(plain)
    n = 25
    new_of_old = np.random.default_rng(5).permutation(n * n)
    columns = np.repeat(np.arange(n), n)
    faces = [tuple(int(new_of_old[v]) for v in p.vertices) for p in plain.data.polygons]
    positions = np.empty((n * n, 3))
    positions[new_of_old] = wavy(n)
    mesh = bpy.data.meshes.new('Renumbered')
    mesh.from_pydata(positions.tolist(), [], faces)
    ob = bpy.data.objects.new('Renumbered', mesh)
    bpy.context.scene.collection.objects.link(ob)
    group(ob, 'region', new_of_old[columns >= 3])
    group(ob, 'right', new_of_old[columns >= n - 3])
    ob.detail_deform.region = 'region'
    add_handle(ob, 'right', add_empty('Right again', (1, 0.5, 0)))
    update()
    bind(activate(ob))
    assert np.abs(lift(ob)[new_of_old] - expected).max() < 1e-5
