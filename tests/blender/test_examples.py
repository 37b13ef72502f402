# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing by example: shape keys and posed copies, pulled by handles or mixed by sliders."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from conftest import activate, add_empty, add_handle, bind, evaluated, group, make_strip, own, refusal, update

LENGTH = 3.0


def curled(p, angle):
    """A limb along x, bent about y by an angle from 1 on, on a circle of radius 1 / angle."""
    x, y, z = p.T
    s = np.clip(x - 1, 0, 1)
    turn, rest = angle * s, np.maximum(x - 2, 0)
    if angle == 0:
        return p.copy()
    radius = 1 / angle
    along = np.minimum(x, 1) + radius * np.sin(turn) + rest * np.cos(turn)
    up = radius * (1 - np.cos(turn)) + rest * np.sin(turn)
    return np.stack([along - np.sin(turn) * z, y, up + np.cos(turn) * z], -1)


@pytest.fixture
def limb():
    """A tube along x, fixed at its root, with shape keys "Bend" by 120° and "Other" by -60°, and the tip's handle."""
    rings, sides = 49, 12
    i, j = np.meshgrid(np.linspace(0, LENGTH, rings), np.arange(sides) * 2 * np.pi / sides, indexing='ij')
    p = np.stack([i, 0.2 * np.cos(j), 0.2 * np.sin(j)], -1).reshape(-1, 3)
    faces = [(r * sides + k, (r + 1) * sides + k, (r + 1) * sides + (k + 1) % sides, r * sides + (k + 1) % sides)
             for r in range(rings - 1) for k in range(sides)]
    mesh = bpy.data.meshes.new("Limb")
    mesh.from_pydata(p.tolist(), [], faces)
    ob = bpy.data.objects.new("Limb", mesh)
    bpy.context.scene.collection.objects.link(ob)
    activate(ob)
    ob.shape_key_add(name="Basis", from_mix=False)
    for name, angle in (("Bend", 2 * np.pi / 3), ("Other", -np.pi / 3)):
        key = ob.shape_key_add(name=name, from_mix=False)
        key.data.foreach_set('co', curled(p, angle).astype(np.float32).ravel())
        key.value = 0.0
    group(ob, 'region', np.flatnonzero(p[:, 0] > 0.2))
    group(ob, 'tip', np.flatnonzero(p[:, 0] > LENGTH - 0.1))
    ob.detail_deform.region = 'region'
    add_handle(ob, 'tip', add_empty("Tip", (LENGTH, 0, 0)))
    ob.detail_deform.method = 'EXAMPLES'
    assert bpy.ops.object.detail_deform_examples_from_keys() == {'FINISHED'}
    update()
    return ob


def pull(ob, angle):
    """Puts the tip's empty where bending by that angle takes it."""
    end = curled(np.array([[LENGTH, 0, 0]]), angle)[0]
    ob.detail_deform.handles[0].target.matrix_world = Matrix.Translation(end) @ Matrix.Rotation(-angle, 4, 'Y')
    update()


def found(ob):
    return [example.found_weight for example in ob.detail_deform.examples]


def middle_line(p):
    return p.reshape(49, 12, 3).mean(1)


def test_a_handle_at_an_examples_place_gives_the_example(limb):
    bind(limb)
    assert [e.name for e in limb.detail_deform.examples] == ["Bend", "Other"]
    box = np.linalg.norm(np.ptp(own(limb), axis=0))
    for angle, weights in ((2 * np.pi / 3, (1, 0)), (-np.pi / 3, (0, 1))):
        pull(limb, angle)
        assert np.abs(evaluated(limb) - curled(own(limb), angle)).max() < 1e-4 * box
        assert np.allclose(found(limb), weights, atol=2e-2)
    pull(limb, 0)
    assert np.abs(evaluated(limb) - own(limb)).max() < 1e-4


def test_in_between_limbs_turn_along_an_arc(limb):
    bind(limb)
    pull(limb, np.pi / 3)
    line = middle_line(evaluated(limb))
    length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
    assert abs(length / LENGTH - 1) < 0.01
    size = np.linalg.norm(np.ptp(own(limb), axis=0))
    assert np.abs(evaluated(limb) - curled(own(limb), np.pi / 3)).max() < 1e-3 * size
    assert abs(found(limb)[0] - 0.5) < 0.05


def test_all_handles_turned_together_turn_the_limb(limb):
    group(limb, 'root', [vertex.index for vertex in limb.data.vertices if vertex.co.x < 0.2])
    add_handle(limb, 'root', add_empty("Root", (0, 0, 0)))
    limb.detail_deform.region = ""  # nothing is fixed
    bind(limb)
    pull(limb, 1.0)
    bent, weight = evaluated(limb), limb.detail_deform.examples[0].found_weight
    assert weight > 0.3
    turn = Matrix.Translation((1, 2, -1)) @ Matrix.Rotation(np.pi / 2, 4, (0.3, 1, 0.6))
    for handle in limb.detail_deform.handles:
        handle.target.matrix_world = turn @ handle.target.matrix_world
    update()
    expected = bent @ np.array(turn)[:3, :3].T + np.array(turn)[:3, 3]
    assert np.abs(evaluated(limb) - expected).max() < 1e-4 * LENGTH
    assert limb.detail_deform.examples[0].found_weight == pytest.approx(weight, abs=1e-3)


def test_beyond_the_examples_the_handle_is_met_and_passes_matter(limb):
    bind(limb)
    pull(limb, 1.0)
    limb.detail_deform.handles[0].target.location += Vector((-0.3, 0.6, 0.2))
    update()
    refined = evaluated(limb)
    limb.detail_deform.refine = 0
    update()
    assert np.abs(evaluated(limb) - refined).max() > 0.01 * LENGTH
    tip = [vertex.index for vertex in limb.data.vertices if vertex.co.x > LENGTH - 0.1]
    assert np.abs(evaluated(limb) - refined)[tip].max() < 1e-5


def test_weights_by_sliders(limb):
    bind(limb)
    pull(limb, np.pi / 3)
    before = evaluated(limb)
    settings = limb.detail_deform
    settings.weights_by = 'SLIDERS'
    update()
    assert abs(settings.examples[0].weight - 0.5) < 0.05  # the sliders start from the weights that the handle found
    assert np.abs(evaluated(limb) - before).max() < 0.05
    for weight in (1.0, 0.5):
        settings.examples[0].weight, settings.examples[1].weight = weight, 0.0
        update()
        assert np.abs(evaluated(limb) - curled(own(limb), weight * 2 * np.pi / 3)).max() < 0.02
    # Keyed sliders are played.
    for frame, weight in ((1, 0.0), (11, 1.0)):
        settings.examples[0].weight = weight
        settings.examples[0].keyframe_insert('weight', frame=frame)
    bpy.context.scene.frame_set(11)
    assert np.abs(evaluated(limb) - curled(own(limb), 2 * np.pi / 3)).max() < 0.02
    bpy.context.scene.frame_set(1)
    assert np.abs(evaluated(limb) - own(limb)).max() < 1e-3


def test_posed_copies_as_examples(limb):
    settings = limb.detail_deform
    settings.examples.clear()
    copy = bpy.data.objects.new("Posed", limb.data.copy())
    copy.shape_key_clear()
    copy.data.vertices.foreach_set('co', curled(own(limb), 2 * np.pi / 3).astype(np.float32).ravel())
    bpy.context.scene.collection.objects.link(copy)
    activate(limb)
    assert "Select posed copies" in refusal(bpy.ops.object.detail_deform_examples_from_objects)
    copy.select_set(True)
    assert bpy.ops.object.detail_deform_examples_from_objects() == {'FINISHED'}
    copy.select_set(False)
    bind(limb)
    pull(limb, 2 * np.pi / 3)
    assert np.abs(evaluated(limb) - curled(own(limb), 2 * np.pi / 3)).max() < 5e-3
    # Edits of the copy and of the list of examples are noticed.
    copy.data.vertices[0].co.z += 1
    copy.data.update()
    update()
    assert "examples that need a new Bind" in limb.detail_deform.status
    copy.data.vertices[0].co.z -= 1
    copy.data.update()
    update()
    assert limb.detail_deform.is_bound
    bpy.ops.object.detail_deform_example_remove()
    assert "examples that need a new Bind" in limb.detail_deform.status


def test_switching_to_other_methods_and_back_needs_no_bind(limb):
    bind(limb)
    pull(limb, 2 * np.pi / 3)
    posed = evaluated(limb)
    limb.detail_deform.method = 'TRANSFER'
    update()
    assert np.abs(evaluated(limb) - posed).max() > 0.05
    limb.detail_deform.method = 'EXAMPLES'
    update()
    assert limb.detail_deform.is_bound and np.abs(evaluated(limb) - posed).max() < 1e-5


def test_poses_by_example_are_baked_and_survive_the_file(limb, tmp_path):
    bind(limb)
    target = limb.detail_deform.handles[0].target
    for frame, angle in ((1, 0), (5, np.pi / 3)):
        pull(limb, angle)
        target.keyframe_insert('location', frame=frame)
        target.keyframe_insert('rotation_euler', frame=frame)
    expected = []
    for frame in (1, 3, 5):
        bpy.context.scene.frame_set(frame)
        expected.append(evaluated(limb))
    path = str(tmp_path / "limb.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    limb = activate(bpy.data.objects["Limb"])
    bpy.ops.object.detail_deform_bake(filepath=str(tmp_path / "limb.pc2"), frame_start=1, frame_end=5)
    for frame, positions in zip((1, 3, 5), expected):
        bpy.context.scene.frame_set(frame)
        assert np.abs(evaluated(limb) - positions).max() < 1e-4


def test_what_is_wrong_with_examples_is_said(limb):
    settings = limb.detail_deform
    bind(limb)
    limb.data.shape_keys.key_blocks["Bend"].value = 0.5
    update()
    assert "Shape keys that are examples are shown too, as 'Bend'" in settings.status
    limb.data.shape_keys.key_blocks["Bend"].value = 0
    settings.examples[0].name = "Nothing"
    assert "has no shape key of that name" in settings.status
    assert "has no shape key of that name" in refusal(bpy.ops.object.detail_deform_bind)
    settings.examples[0].name = "Bend"  # the refused Bind has kept the earlier binding
    assert settings.is_bound
    settings.examples.clear()
    bind(limb)
    assert "There are no examples" in settings.status
    other = make_strip()
    activate(limb)
    other.select_set(True)
    assert "another pose of the same vertices" in refusal(bpy.ops.object.detail_deform_examples_from_objects)
    assert "has no shape keys" in refusal(lambda: activate(other) and bpy.ops.object.detail_deform_examples_from_keys())


def test_sliders_keep_what_was_set_before_bind(limb):
    settings = limb.detail_deform
    settings.examples[0].weight = 0.7
    settings.weights_by = 'SLIDERS'
    assert abs(settings.examples[0].weight - 0.7) < 1e-6
    bind(limb)
    assert np.abs(evaluated(limb) - curled(own(limb), 0.7 * 2 * np.pi / 3)).max() < 0.03


def test_examples_matter_to_their_method_alone(limb):
    settings = limb.detail_deform
    settings.method = 'TRANSFER'
    bind(limb)
    limb.data.shape_keys.key_blocks["Bend"].name = "Renamed"
    limb.data.update()
    update()
    assert limb.detail_deform.is_bound
    bind(limb)
    settings.method = 'EXAMPLES'
    assert "has no shape key of that name" in settings.status
    settings.examples[0].name = "Renamed"
    bind(limb)
    pull(limb, 2 * np.pi / 3)
    assert np.abs(evaluated(limb) - curled(own(limb), 2 * np.pi / 3)).max() < 5e-3


def test_a_posed_copy_that_is_at_rest_or_deleted_is_refused(limb):
    limb.detail_deform.examples.clear()
    copy = bpy.data.objects.new("Copy", limb.data.copy())
    copy.shape_key_clear()
    bpy.context.scene.collection.objects.link(copy)
    activate(limb)
    copy.select_set(True)
    assert "at rest" in refusal(bpy.ops.object.detail_deform_examples_from_objects)
    copy.data.vertices[30].co.z += 1
    bpy.ops.object.detail_deform_examples_from_objects()
    bpy.data.objects.remove(copy)
    assert "was deleted" in refusal(bpy.ops.object.detail_deform_bind)
