# SPDX-License-Identifier: GPL-3.0-or-later
"""A source with modifiers that make vertices, such as Subdivision Surface, is followed by its shape below them: the
pose that the other modifiers give to the vertices of its own mesh."""

import bpy
import numpy as np
import pytest

from conftest import activate, data_blocks, evaluated, has_voxels, own, update
from rigs import make_rigged
from test_transfer import add_key, bent, coordinates, copy_of_rest, raw_strip

transfer = bpy.ops.object.detail_deform_transfer
live = bpy.ops.object.detail_deform_transfer_live


def nodes_that_subdivide(ob):
    modifier = ob.modifiers.new("Nodes", 'NODES')
    group = bpy.data.node_groups.new("Subdivide", 'GeometryNodeTree')
    if hasattr(group, 'interface'):
        for way in ('INPUT', 'OUTPUT'):
            group.interface.new_socket('Geometry', in_out=way, socket_type='NodeSocketGeometry')
    else:
        group.inputs.new('NodeSocketGeometry', 'Geometry')
        group.outputs.new('NodeSocketGeometry', 'Geometry')
    ends = [group.nodes.new(kind) for kind in ('NodeGroupInput', 'GeometryNodeSubdivideMesh', 'NodeGroupOutput')]
    for one, other in zip(ends, ends[1:]):
        group.links.new(one.outputs[0], other.inputs[0])
    modifier.node_group = group
    return modifier


def a_modifier(kind, **values):
    def add(ob):
        modifier = ob.modifiers.new(kind.title(), kind)
        for name, value in values.items():
            setattr(modifier, name, value)
        return modifier
    return add


MAKERS = {'SUBSURF': a_modifier('SUBSURF', levels=2), 'MIRROR': a_modifier('MIRROR'), 'ARRAY': a_modifier('ARRAY'),
          'SOLIDIFY': a_modifier('SOLIDIFY', thickness=0.1), 'REMESH': a_modifier('REMESH', voxel_size=0.1),
          'BEVEL': a_modifier('BEVEL', affect='VERTICES', width=0.01), 'DECIMATE': a_modifier('DECIMATE', ratio=0.5),
          'BUILD': a_modifier('BUILD', frame_start=-5, frame_duration=40), 'NODES': nodes_that_subdivide,
          'WELD': a_modifier('WELD', merge_threshold=0.1)}


def twisting(ob, angle=1.0):
    modifier = ob.modifiers.new("Twist", 'SIMPLE_DEFORM')
    modifier.deform_method, modifier.angle = 'TWIST', angle
    return modifier


@pytest.fixture
def pair():
    source, target = raw_strip("Source"), raw_strip("Target")
    add_key(source, "Bend", bent(own(source)), value=0.5)
    twisting(source)
    update()
    target.detail_deform.transfer.source = source
    activate(target)
    return source, target


@pytest.mark.parametrize('kind', [pytest.param(kind, marks=has_voxels if kind == 'REMESH' else ()) for kind in MAKERS])
def test_followed_below(pair, kind):
    source, target = pair
    pose = evaluated(source)
    MAKERS[kind](source)
    update()
    shown = evaluated(source)
    assert len(shown) != len(pose)
    before = data_blocks()
    assert live() == {'FINISHED'}, target.detail_deform.transfer.state
    assert np.abs(evaluated(target) - pose).max() < 1e-4
    assert target.detail_deform.transfer.state == "Follows 'Source'."
    # The source looks as before, and the file has no new data-blocks but the node group that shows the result.
    assert np.array_equal(evaluated(source), shown)
    assert {block for block in data_blocks() - before if block[0] != 'node_groups'} == set()
    source.modifiers["Twist"].angle = -0.5
    update()
    source.modifiers[1].show_viewport = False
    update()
    assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-4
    without = evaluated(target)
    source.modifiers[1].show_viewport = True
    update()
    assert np.abs(evaluated(target) - without).max() < 1e-6


@pytest.mark.parametrize('kind', ['SUBSURF', 'NODES'])
def test_pose_and_animation_below(pair, tmp_path, kind):
    source, target = pair
    twist = source.modifiers["Twist"]
    for frame, angle in ((1, 0.0), (5, 1.0)):
        twist.angle = angle
        twist.keyframe_insert('angle', frame=frame)
    scene, poses = bpy.context.scene, []
    for frame in range(1, 6):
        scene.frame_set(frame)
        poses.append(evaluated(source))
    MAKERS[kind](source)
    transfer()
    assert np.abs(coordinates(target.data.shape_keys.key_blocks["Source Pose"]) - poses[-1]).max() < 1e-5
    target.data.shape_keys.key_blocks["Source Pose"].value = 0
    transfer(what='ANIMATION', frame_start=1, frame_end=5, cache_path=str(tmp_path / "target.pc2"))
    for frame, pose in enumerate(poses, 1):
        scene.frame_set(frame)
        assert np.abs(evaluated(target) - pose).max() < 1e-4


@pytest.mark.parametrize('kind', ['SUBSURF', 'MIRROR', 'SOLIDIFY'])
def test_an_armature_behind_is_followed(kind):
    """An armature behind the modifier that makes vertices, as where one half is modelled, mirrored and then posed."""
    source, _ = make_rigged()
    poses, scene = {}, bpy.context.scene
    for frame in (11, 16, 31):
        scene.frame_set(frame)
        poses[frame] = evaluated(source)
    MAKERS[kind](source)
    bpy.context.view_layer.objects.active = source
    bpy.ops.object.modifier_move_to_index(modifier=source.modifiers[1].name, index=0)
    assert [m.type for m in source.modifiers] == [kind, 'ARMATURE']
    target = copy_of_rest(source, "Target")
    assert live() == {'FINISHED'}
    for frame, pose in poses.items():
        scene.frame_set(frame)
        assert np.abs(evaluated(target) - pose).max() < 1e-3, frame


@pytest.mark.parametrize('kind', ['WAVE', 'NODES'])
def test_modifiers_that_are_left_out_are_named(pair, kind, capfd):
    source, target = pair
    pose = evaluated(source)
    MAKERS['SUBSURF'](source)
    source.modifiers.new("Waves", kind)
    source.modifiers.new("Weights", 'WEIGHTED_NORMAL')
    sentence = "What 'Waves' of 'Source' does is left out, for it comes behind 'Subsurf', which makes vertices"
    transfer()
    assert sentence in capfd.readouterr().out
    assert np.abs(coordinates(target.data.shape_keys.key_blocks["Source Pose"]) - pose).max() < 1e-5
    transfer(what='ALL_KEYS')  # in shape keys no modifier has a part
    assert "left out" not in capfd.readouterr().out
    for key in target.data.shape_keys.key_blocks:
        key.value = 0
    live()
    assert sentence in target.detail_deform.transfer.state
    source.modifiers["Waves"].show_viewport = False
    assert target.detail_deform.transfer.state == "Follows 'Source'."


@pytest.mark.parametrize('kind', ['DECIMATE', 'BEVEL', 'MASK'])
def test_modifiers_left_out_behind_one_that_may_make_vertices_are_named(pair, kind):
    source, target = pair
    maker = source.modifiers.new("Maker", kind)
    if kind == 'DECIMATE':
        maker.ratio = 0.5
    if kind == 'MASK':
        maker.vertex_group = source.vertex_groups.new(name="Some").name
        source.vertex_groups["Some"].add(list(range(len(source.data.vertices) // 2)), 1, 'REPLACE')
    source.modifiers.new("Weights", 'WEIGHTED_NORMAL')
    assert live() == {'FINISHED'}
    assert target.detail_deform.transfer.state == "Follows 'Source'."
    source.modifiers.new("Waves", 'WAVE')
    update()
    assert "What 'Waves' of 'Source' does is left out" in target.detail_deform.transfer.state


def test_a_follower_that_subdivides_is_followed_in_turn(pair):
    source, target = pair
    last = raw_strip("Last")
    activate(target)
    live()
    MAKERS['SUBSURF'](target)
    update()
    last.detail_deform.transfer.source = target
    activate(last)
    assert live() == {'FINISHED'}, last.detail_deform.transfer.state
    for angle in (0.3, -1.0):
        source.modifiers["Twist"].angle = angle
        update()
        assert np.abs(evaluated(last) - evaluated(source)).max() < 1e-3


def test_an_equal_number_of_vertices_is_not_taken_for_the_same_vertices(pair):
    """A mask hides half of the vertices and a mirror doubles the rest: the number is right, the vertices are not."""
    source, target = pair
    pose = evaluated(source)
    half = source.vertex_groups.new(name="half")
    count = len(source.data.vertices)
    half.add(list(range(count // 2, count)), 1.0, 'REPLACE')
    source.modifiers.new("Mask", 'MASK').vertex_group = "half"
    source.modifiers.new("Mirror", 'MIRROR').use_mirror_merge = False
    update()
    live()
    assert np.abs(evaluated(target) - pose).max() < 1e-4


def test_a_render_follows_the_source_as_rendered(pair, tmp_path):
    """A rendered frame follows the source with the modifiers and levels that are set for renders."""
    source, target = pair
    pose = evaluated(source)
    modifier = MAKERS['SUBSURF'](source)
    modifier.show_viewport, modifier.levels, modifier.render_levels = False, 0, 2
    live()
    assert np.abs(evaluated(target) - pose).max() < 1e-4
    scene, seen = bpy.context.scene, []
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.render.engine, scene.render.filepath = 'BLENDER_WORKBENCH', str(tmp_path / "frame")
    scene.render.resolution_x = scene.render.resolution_y = 16
    twist = source.modifiers["Twist"]
    for frame, angle in ((1, 1.0), (2, 0.2)):
        twist.angle = angle
        twist.keyframe_insert('angle', frame=frame)
    scene.frame_start, scene.frame_end = 1, 2

    def look(scene, depsgraph):
        seen.append((depsgraph.mode, len(source.evaluated_get(depsgraph).data.vertices),
                     target.detail_deform.transfer.problem))

    bpy.app.handlers.frame_change_post.append(look)
    try:
        bpy.ops.render.render(animation=True)
    finally:
        bpy.app.handlers.frame_change_post.remove(look)
    of_renders = [row for row in seen if row[0] == 'RENDER']
    assert of_renders and all(count > len(pose) and not problem for _, count, problem in of_renders), seen
