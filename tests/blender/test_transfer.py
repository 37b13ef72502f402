# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfer: deformations carried over from one mesh to another."""

import bpy
import numpy as np
import pytest

from conftest import activate, add_empty, bind, evaluated, group, make_strip, own, refusal, rigid_motion, select, update

transfer = bpy.ops.object.detail_deform_transfer


def bent(p, bend=1.0):
    """Positions bent upwards about the y axis, without stretch at z = 0."""
    angle, radius = bend * p[:, 0], 1 / bend - p[:, 2]
    return np.stack([radius * np.sin(angle), p[:, 1], 1 / bend - radius * np.cos(angle)], -1)


def raw_strip(name, n=25):
    ob = make_strip(n, name=name)
    ob.detail_deform.handles.clear()
    ob.vertex_groups.clear()
    ob.detail_deform.region = ""
    return ob


def add_key(ob, name, positions, **values):
    if not ob.data.shape_keys:
        ob.shape_key_add(name="Basis", from_mix=False)
    key = ob.shape_key_add(name=name, from_mix=False)
    key.data.foreach_set('co', np.asarray(positions, np.float32).ravel())
    key.value = 0.0  # Blender 5.2 adds keys with the value 1
    for prop, value in values.items():
        setattr(key, prop, value)
    return key


def coordinates(key):
    values = np.empty(3 * len(key.data), np.float32)
    key.data.foreach_get('co', values)
    return values.reshape(-1, 3).astype(float)


def copy_of_rest(source, name="Target"):
    """A local target with the source's rest shape and topology; active."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(own(source).tolist(), [], [list(face.vertices) for face in source.data.polygons])
    target = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(target)
    target.detail_deform.transfer.source = source
    return activate(target)


@pytest.fixture
def pair():
    """(source with two shape keys, target of the same shape); the target is active."""
    source, target = raw_strip("Source"), raw_strip("Target")
    add_key(source, "Bend", bent(own(source)), slider_min=-1.0, slider_max=2.0, value=0.25)
    add_key(source, "Twist", own(source) + 0.2 * own(source)[:, [2, 0, 1]] * own(source)[:, :1])
    source.active_shape_key_index = 2
    activate(target)
    return source, target


def test_all_shape_keys_with_names_ranges_and_drivers(pair):
    source, target = pair
    curve = source.data.shape_keys.key_blocks["Twist"].driver_add('value')
    curve.driver.expression = "0.5"
    assert transfer(source="Source", what='ALL_KEYS', drivers=True) == {'FINISHED'}
    keys = target.data.shape_keys.key_blocks
    assert [key.name for key in keys] == ["Basis", "Bend", "Twist"]
    for name in ("Bend", "Twist"):
        assert np.abs(coordinates(keys[name]) - coordinates(source.data.shape_keys.key_blocks[name])).max() < 1e-5
    assert (keys["Bend"].slider_min, keys["Bend"].slider_max, keys["Bend"].value) == (-1, 2, 0.25)
    update()
    assert abs(keys["Twist"].value - 0.5) < 1e-6
    assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-5


def test_keys_are_added_beside_others_or_replace_them(pair):
    source, target = pair
    mine = own(target) + (0, 0, 1)
    add_key(target, "Bend", mine)
    transfer(source="Source", what='ALL_KEYS', pattern="B*")
    keys = target.data.shape_keys.key_blocks
    assert [key.name for key in keys] == ["Basis", "Bend", "Bend.001"]
    assert np.abs(coordinates(keys["Bend"]) - mine).max() < 1e-6
    transfer(source="Source", what='ALL_KEYS', pattern="Bend", replace=True)
    assert len(keys) == 3
    assert np.abs(coordinates(keys["Bend"]) - bent(own(source))).max() < 1e-5


def test_the_active_key_and_one_relative_to_another(pair):
    source, target = pair
    rest = own(source)
    both = add_key(source, "Lifted Bend", bent(rest) + rest[:, :1] * (0, 0, 0.1))
    both.relative_key = source.data.shape_keys.key_blocks["Bend"]
    source.active_shape_key_index = 3
    transfer(source="Source", what='ACTIVE_KEY')
    keys = target.data.shape_keys.key_blocks
    assert [key.name for key in keys] == ["Basis", "Lifted Bend"]
    assert np.abs(coordinates(keys["Lifted Bend"]) - rest - rest[:, :1] * (0, 0, 0.1)).max() < 1e-5


def test_the_current_pose_by_modifiers(pair):
    source, target = pair
    modifier = source.modifiers.new("Deform", 'SIMPLE_DEFORM')
    modifier.deform_method, modifier.angle = 'TWIST', 1.0
    update()
    assert transfer(source="Source") == {'FINISHED'}
    key = target.data.shape_keys.key_blocks["Source Pose"]
    assert key.value == 1 and np.abs(evaluated(target) - evaluated(source)).max() < 1e-5
    assert np.abs(own(target) - own(source)).max() == 0


def test_a_rotated_and_scaled_target_is_deformed_accordingly(pair):
    source, target = pair
    turn = np.array([[0, -2, 0], [2, 0, 0], [0, 0, 2]])  # a quarter turn about z, twice the size
    target.data.vertices.foreach_set('co', (own(target) @ turn.T + (3, 1, 0)).astype(np.float32).ravel())
    transfer(source="Source", what='ALL_KEYS')
    expected = bent(own(source)) @ turn.T + (3, 1, 0)
    assert np.abs(coordinates(target.data.shape_keys.key_blocks["Bend"]) - expected).max() < 1e-4


def test_animation_as_a_cache_and_as_keyed_keys(pair, tmp_path):
    source, target = pair
    key = source.data.shape_keys.key_blocks["Bend"]
    for frame, value in ((1, 0.0), (5, 1.0)):
        key.value = value
        key.keyframe_insert('value', frame=frame)
    scene = bpy.context.scene
    scene.frame_set(2)
    path = str(tmp_path / "target.pc2")
    transfer(source="Source", what='ANIMATION', frame_start=1, frame_end=5, cache_path=path)
    assert scene.frame_current == 2
    assert target.modifiers[0].type == 'MESH_CACHE'
    other = raw_strip("Other")
    transfer(source="Source", what='ANIMATION', bake_as='SHAPE_KEYS', frame_start=1, frame_end=5)
    for frame in range(1, 6):
        scene.frame_set(frame)
        assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-5
        assert np.abs(evaluated(other) - evaluated(source)).max() < 1e-5
    # A second transfer adds no second modifier.
    activate(target)
    transfer(source="Source", what='ANIMATION', frame_start=1, frame_end=3, cache_path=path)
    assert len(target.modifiers) == 1


def with_loose_parts(target):
    """Joins a plate that lies on the strip, a rivet on the plate, and a box far away to it, behind its own vertices.
    Returns the indices of the vertices of each."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    rest, faces = own(target).tolist(), [tuple(face.vertices) for face in target.data.polygons]
    middle, size = np.mean(rest, axis=0), np.ptp(rest, axis=0).max()
    places = []
    for shift, extent in (((0, 0, 0.02), (0.1, 0.08, 0.02)), ((0.02, 0, 0.033), (0.01, 0.01, 0.006)),
                          ((0, 0, 3), (0.1, 0.1, 0.1))):
        begin = len(rest)
        rest += (middle + size * (corners * extent + shift)).tolist()
        faces += [tuple(begin + v for v in side) for side in sides]
        places.append(np.arange(begin, len(rest)))
    mesh = bpy.data.meshes.new("With Parts")
    mesh.from_pydata(rest, [], faces)
    target.data = mesh
    update()
    return places


@pytest.mark.parametrize('pairs_of', ['TRIANGLES', 'VERTICES'])
def test_parts_that_correspond_to_nothing_ride_along(pair, tmp_path, capfd, pairs_of):
    source, target = pair
    count = len(source.data.vertices)
    source.data.calc_loop_triangles()
    plate, rivet, box = with_loose_parts(target)
    pairs = len(source.data.loop_triangles) if pairs_of == 'TRIANGLES' else count
    path = tmp_path / "pairs.txt"
    path.write_text(''.join(f"{k} {k}\n" for k in range(pairs)))
    source.active_shape_key_index = 1
    transfer(source="Source", what='ACTIVE_KEY', correspondence='LIST', filepath=str(path), pairs_of=pairs_of)
    said = capfd.readouterr().out
    assert "2 loose part(s) of this mesh correspond to nothing and ride along with what is beneath." in said
    assert f"1 loose part(s) of this mesh (such as that of vertex {box[0]}) correspond to nothing and go with" in said
    rest, now = own(target), coordinates(target.data.shape_keys.key_blocks["Bend"])
    assert np.abs(now[:count] - bent(own(source))).max() < 1e-4
    rotation, off = rigid_motion(rest[plate], now[plate])
    assert np.abs(off).max() < 1e-4
    # As what is beneath moves: its corners are where the bend has them, but for their own bend.
    assert np.abs(now[plate] - bent(rest[plate])).max() < 0.01
    assert np.abs(now[plate] - rest[plate]).max() > 0.05
    middle = rest[plate].mean(axis=0)
    carried = (rest[rivet] - middle) @ rotation.T + now[plate].mean(axis=0)
    assert np.abs(now[rivet] - carried).max() < 1e-4
    assert np.abs(rigid_motion(rest[box], now[box])[0] - np.eye(3)).max() < 1e-4  # goes with the rest, unturned
    # The same where it follows.
    target.detail_deform.transfer.source = source
    source.data.shape_keys.key_blocks["Bend"].value = 1
    source.data.shape_keys.key_blocks["Twist"].value = 0
    target.detail_deform.transfer.correspondence = 'STORED'
    target.shape_key_clear()
    bpy.ops.object.detail_deform_transfer_live()
    update()
    assert np.abs(evaluated(target)[plate] - now[plate]).max() < 1e-4


@pytest.mark.parametrize('pairs_of', ['TRIANGLES', 'VERTICES'])
def test_by_a_list_of_pairs(pair, tmp_path, pairs_of):
    source, target = pair
    target.data.calc_loop_triangles()
    count = len(target.data.loop_triangles) if pairs_of == 'TRIANGLES' else len(target.data.vertices)
    path = tmp_path / "pairs.txt"
    path.write_text(f"# source, target\n{count}\n" + ''.join(f"{k}, {k}, 0.5\n" for k in range(count)))
    transfer(source="Source", what='ACTIVE_KEY', correspondence='LIST', filepath=str(path), pairs_of=pairs_of)
    twist = coordinates(source.data.shape_keys.key_blocks["Twist"])
    assert np.abs(coordinates(target.data.shape_keys.key_blocks["Twist"]) - twist).max() < 1e-5
    # The pairs are stored, and can be used and saved again.
    transfer(source="Source", what='ALL_KEYS', correspondence='STORED', pattern="Bend")
    assert np.abs(coordinates(target.data.shape_keys.key_blocks["Bend"]) - bent(own(source))).max() < 1e-5
    target.detail_deform.transfer.source = source
    bpy.ops.object.detail_deform_transfer_save(filepath=str(tmp_path / "again.txt"))
    assert np.array_equal(np.loadtxt(tmp_path / "again.txt", dtype=int), np.stack([np.arange(count)] * 2, -1))


def mark(ob, n, as_empties):
    """Adds markers at the corners, the middles of the sides and the centre of an n × n strip."""
    for number, (i, j) in enumerate([(a, b) for a in (0, n // 2, n - 1) for b in (0, n // 2, n - 1)], 1):
        if as_empties:
            empty = add_empty(f"Marker {number}", own(ob)[i * n + j] + (0, 0, 0.01), parent=ob)
            assert empty.name.startswith(f"Marker {number}")
        else:
            group(ob, f"Marker {number}", [i * n + j])
    update()


@pytest.mark.parametrize('as_empties', [False, True])
def test_by_markers_onto_another_topology(as_empties, tmp_path):
    source, target = raw_strip("Source", 21), raw_strip("Target", 33)
    p = own(target)
    p[:, 2] = 0.05 * np.sin(20 * p[:, 1])  # another relief than the source's
    target.data.vertices.foreach_set('co', p.astype(np.float32).ravel())
    add_key(source, "Bend", bent(own(source)))
    mark(source, 21, as_empties)
    mark(target, 33, False)
    activate(target)
    assert transfer(source="Source", what='ALL_KEYS', correspondence='MARKERS', rotation_only=True) == {'FINISHED'}
    found = coordinates(target.data.shape_keys.key_blocks["Bend"])
    shift = (found - bent(p)).mean(0)
    assert np.abs(found - bent(p) - shift).max() < 0.03
    # The match is stored with the target and saved with the file.
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    target = activate(bpy.data.objects["Target"])
    transfer(source="Source", what='ALL_KEYS', correspondence='STORED', rotation_only=True)
    assert np.abs(coordinates(target.data.shape_keys.key_blocks["Bend"]) - found).max() == 0


def test_correspondences_are_found_shown_and_forgotten(part):
    source, target = raw_strip("Source", 21), raw_strip("Target", 33)
    mark(source, 21, False)
    mark(target, 33, False)
    settings = target.detail_deform.transfer
    settings.source = source
    activate(target)
    assert bpy.ops.object.detail_deform_transfer_match() == {'FINISHED'}
    assert settings.correspondence == 'STORED'
    confidence = part('scene.saved_match').vertex_confidence(target)
    assert confidence.shape == (33 * 33,) and confidence.min() > 0.5
    assert settings.show_match  # so that the user sees it before it is used
    colours = part('ui.preview').vertex_colours(target)
    assert (colours[:, 1] > colours[:, 0]).all()  # green
    bpy.ops.object.detail_deform_transfer_forget()
    assert settings.correspondence == 'TOPOLOGY' and not settings.show_match
    assert not [name for name in target.data.keys() if 'detail_deform' in name]


def test_markers_are_numbered_as_they_are_added():
    ob = raw_strip("Strip")
    for number, vertex in ((1, 7), (2, 300)):
        select(ob, np.arange(625) == vertex)
        assert bpy.ops.object.detail_deform_marker_add() == {'FINISHED'}
        bpy.ops.object.mode_set(mode='OBJECT')
        assert ob.vertex_groups[-1].name == f"Marker {number}"
        assert [v.index for v in ob.data.vertices if any(g.group == number - 1 for g in v.groups)] == [vertex]
    select(ob, np.arange(625) == 9)
    assert "has a marker 2 already" in refusal(bpy.ops.object.detail_deform_marker_add, number=2)
    select(ob, np.zeros(625))
    assert "No vertex is selected" in refusal(bpy.ops.object.detail_deform_marker_add)


def test_anchors(pair):
    _, target = pair
    group(target, 'left', range(25))
    transfer(source="Source", what='ALL_KEYS', pattern="Bend", anchor='PINNED', anchor_group='left')
    found = coordinates(target.data.shape_keys.key_blocks["Bend"])
    assert np.abs(found[:25] - own(target)[:25]).max() < 1e-6 and np.abs(found[-1] - own(target)[-1]).max() > 0.2
    transfer(source="Source", what='ALL_KEYS', pattern="Bend", anchor='CENTROID', replace=True)
    found = coordinates(target.data.shape_keys.key_blocks["Bend"])
    assert np.abs((found - own(target)).mean(0)).max() < 0.02


def test_a_target_follows_its_source_live(pair, tmp_path):
    source, target = pair
    key = source.data.shape_keys.key_blocks["Bend"]
    assert bpy.ops.object.detail_deform_transfer_live(source="Source") == {'FINISHED'}
    assert target.detail_deform.status == "Follows 'Source'."
    assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-4
    for value in (1.0, 0.5):
        key.value = value
        update()
        assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-4
    assert np.abs(own(target) - own(source)).max() == 0
    # In playback, also while the source is hidden.
    for frame, value in ((1, 0.0), (10, 1.0)):
        key.value = value
        key.keyframe_insert('value', frame=frame)
    source.hide_viewport = source.hide_render = True
    for frame in (1, 7):
        bpy.context.scene.frame_set(frame)
        expected = own(source) + key.value * (bent(own(source)) - own(source))
        assert np.abs(evaluated(target) - expected).max() < 1e-4
    source.hide_viewport = False
    # After saving and loading.
    path = str(tmp_path / "live.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    source, target = bpy.data.objects["Source"], activate(bpy.data.objects["Target"])
    bpy.context.scene.frame_set(10)
    assert np.abs(evaluated(target) - bent(own(source))).max() < 1e-4
    # After an edit of the target's mesh, which is followed from.
    target.data.vertices.foreach_set('co', (own(target) + (0, 0, 2)).astype(np.float32).ravel())
    target.data.update()
    update()
    bpy.context.scene.frame_set(9)
    bpy.context.scene.frame_set(10)
    assert np.abs(evaluated(target) - bent(own(source)) - (0, 0, 2)).max() < 1e-4
    # A deleted source is reported.
    bpy.data.objects.remove(source)
    update()
    bpy.context.scene.frame_set(3)
    assert "source was deleted" in target.detail_deform.transfer.problem
    bpy.ops.object.detail_deform_transfer_live(on=False)
    assert np.abs(evaluated(target) - own(target)).max() == 0
    assert not target.detail_deform.transfer.problem


def test_following_and_handles_exclude_one_another(pair):
    strip = bind(make_strip())
    assert "bound to handles" in refusal(bpy.ops.object.detail_deform_transfer_live, source="Source")
    bpy.ops.object.detail_deform_unbind()
    bpy.ops.object.detail_deform_transfer_live(source="Source")
    assert "follows 'Source'" in refusal(bpy.ops.object.detail_deform_bind)
    bpy.ops.object.detail_deform_remove()
    assert not strip.detail_deform.transfer.live and not strip.modifiers


def test_refusals(pair, tmp_path):
    source, target = pair
    raw_strip("Other", 20)
    assert "There is no object 'Nobody'" in refusal(transfer, source="Nobody")
    assert "both source and target" in refusal(transfer, source="Other")
    assert "There is no source" in refusal(transfer)
    assert "not of the same topology" in refusal(transfer, source="Source")
    group(source, "Marker 1", [1])
    group(bpy.context.active_object, "Marker 2", [1])
    assert "none with the same number" in refusal(transfer, source="Source", correspondence='MARKERS')
    assert "has no Saved Match" in refusal(transfer, source="Source", correspondence='STORED')
    assert "has no shape keys" in refusal(transfer, source="Target", what='ALL_KEYS')
    assert "whose name fits 'x*'" in refusal(transfer, source="Source", what='ALL_KEYS', pattern="x*")
    source.active_shape_key_index = 0
    assert "is its basis" in refusal(transfer, source="Source", what='ACTIVE_KEY')
    activate(target)
    assert "no vertex group 'feet'" in refusal(transfer, source="Source", anchor='PINNED', anchor_group='feet')
    assert "never saved" in refusal(transfer, source="Source", what='ANIMATION', cache_path="//x.pc2")
    assert "is before the first" in refusal(transfer, source="Source", what='ANIMATION', frame_start=5, frame_end=1,
                                            cache_path=str(tmp_path / "x.pc2"))
    path = tmp_path / "list.txt"
    for text, sentence in (("0 0\n1 zwei\n", "line 2"), ("# nothing\n", "has no pairs"),
                           ("0 0\n3 99999\n", "pair 2 names number 99999"),
                           ("-1 0\n", "number -1 of 'Source'"), ("0 99999999999\n", "a number over")):
        path.write_text(text, encoding='utf-8')
        assert sentence in refusal(transfer, source="Source", correspondence='LIST', filepath=str(path))
    for encoding in ('cp1252', 'utf-16', 'utf-16-le'):
        path.write_bytes("0 0\n# für die Füße\n".encode(encoding))
        assert "it is no text in UTF-8: save it" in refusal(transfer, source="Source", correspondence='LIST',
                                                            filepath=str(path))
    assert "can't be read" in refusal(transfer, source="Source", correspondence='LIST', filepath=str(tmp_path / "none"))
    assert "no list yet" in refusal(transfer, source="Source", correspondence='LIST', filepath="")
    add_key(source, "Broken", np.full((len(source.data.vertices), 3), np.nan))
    assert "'Broken': Vertex 0 of the source is not finite" in refusal(transfer, source="Source", what='ALL_KEYS',
                                                                pattern="Broken")
    # No refusal has left a trace.
    assert not target.data.shape_keys and not target.modifiers and not list(tmp_path.glob("*.pc2*"))


def test_a_key_with_a_vertex_out_of_all_bounds_is_left_out_and_named(pair, capfd):
    """A pose with such a vertex is refused, as it would move the whole target."""
    source, target = pair
    positions = own(source)
    positions[7, 2] = 1e30
    broken = add_key(source, "Broken", positions)
    activate(target)
    assert transfer(source="Source", what='ALL_KEYS') == {'FINISHED'}
    assert [key.name for key in target.data.shape_keys.key_blocks] == ["Basis", "Bend", "Twist"]
    assert "Vertex 7 of 'Source' is 1e+30 times" in capfd.readouterr().out
    broken.value = 1
    update()
    assert "Vertex 7 of 'Source' is" in refusal(transfer, source="Source", what='POSE')
    target.shape_key_clear()
    broken.value = 0
    update()
    target.detail_deform.transfer.source = source
    activate(target)
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    shown = evaluated(target)
    broken.value = 1
    update()
    assert "Vertex 7 of 'Source' is" in target.detail_deform.transfer.state
    assert np.abs(evaluated(target) - shown).max() == 0


def test_markers_that_contradict_are_refused(pair):
    source, target = pair
    for number in (1, 2, 3):
        for ob in pair:
            group(ob, f"Marker {number}", [number])
    group(source, "marker.1", [5])
    assert "two markers with the number 1" in refusal(transfer, source="Source", correspondence='MARKERS')
    source.vertex_groups.remove(source.vertex_groups["marker.1"])
    group(source, "Marker 4", [1])
    group(target, "Marker 4", [77])
    assert "is paired by markers" in refusal(transfer, source="Source", correspondence='MARKERS')
    group(source, "Marker 5", [])
    assert "has no vertex" in refusal(transfer, source="Source", correspondence='MARKERS')


def test_kept_correspondences_of_another_mesh_are_refused(pair, tmp_path):
    _, target = pair
    path = tmp_path / "pairs.txt"
    path.write_text("0 0\n5 5\n")
    transfer(source="Source", correspondence='LIST', filepath=str(path))
    raw_strip("Other", 20)
    activate(target)
    assert "was made for 'Source'" in refusal(transfer, source="Other", correspondence='STORED')


def test_followers_that_swap_their_names_keep_to_their_own_sources(pair):
    source, target = pair
    other_source, other = raw_strip("Other Source", 15), raw_strip("Other", 15)
    add_key(other_source, "Bend", bent(own(other_source)))
    for ob, follows in ((target, "Source"), (other, "Other Source")):
        activate(ob)
        bpy.ops.object.detail_deform_transfer_live(source=follows)
    target.name, other.name, target.name = "Swap", "Target", "Other"
    source.name = "Renamed"
    for key in (source.data.shape_keys.key_blocks["Bend"], other_source.data.shape_keys.key_blocks["Bend"]):
        key.value = 1.0
    update()
    for ob, follows in ((target, source), (other, other_source)):
        assert np.abs(evaluated(ob) - evaluated(follows)).max() < 1e-4


def test_an_earlier_transferred_key_is_replaced_and_not_doubled(pair):
    source, target = pair
    modifier = source.modifiers.new("Deform", 'SIMPLE_DEFORM')
    modifier.deform_method = 'TWIST'
    source.name = "S" * 62  # with " Pose" longer than Blender's limit for names
    for angle in (1.0, 0.5):
        modifier.angle = angle
        update()
        transfer(source=source.name)
        assert len(target.data.shape_keys.key_blocks) == 2
        assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-5
    assert target.active_shape_key_index == 1
    # A transferred key that the user made relative to another key is written relative to the basis again.
    target.data.shape_keys.key_blocks[1].relative_key = add_key(target, "Other", own(target) + 1)
    transfer(source=source.name)
    assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-5


def test_ranges_and_names_of_all_kinds(pair):
    source, target = pair
    key = add_key(source, 'say "a\\b"', bent(own(source)), slider_max=5.0, slider_min=2.0, value=3.0)
    key.driver_add('value').driver.expression = "2.5"
    assert transfer(source="Source", what='ALL_KEYS', pattern=key.name, drivers=True) == {'FINISHED'}
    copy = target.data.shape_keys.key_blocks[key.name]
    assert (copy.slider_min, copy.slider_max) == (2, 5)
    update()
    assert abs(copy.value - 2.5) < 1e-6
    assert transfer(source="Source", what='ALL_KEYS', pattern="BEND") == {'FINISHED'}
    assert "Bend" in target.data.shape_keys.key_blocks


def test_objects_scaled_unevenly_are_deformed_as_displayed(pair):
    source, target = pair
    target.data.vertices.foreach_set('co', (own(target) / (4, 1, 1)).astype(np.float32).ravel())
    target.scale = (4, 1, 1)
    update()
    transfer(source="Source", what='ALL_KEYS', pattern="Bend")
    found = coordinates(target.data.shape_keys.key_blocks["Bend"]) * (4, 1, 1)
    assert np.abs(found - bent(own(source))).max() < 1e-4


def test_keys_start_from_the_basis_whatever_the_vertices_say(pair):
    source, target = pair
    source.data.vertices.foreach_set('co', (own(source) * 1.5).astype(np.float32).ravel())
    add_key(source, "Nothing", coordinates(source.data.shape_keys.reference_key))
    transfer(source="Source", what='ALL_KEYS', pattern="Nothing")
    assert np.abs(coordinates(target.data.shape_keys.key_blocks["Nothing"]) - own(target)).max() < 1e-5


def test_a_source_that_is_not_evaluated_is_refused(pair):
    source, _ = pair
    source.hide_viewport = True
    update()
    assert "hidden by its monitor icon" in refusal(transfer, source="Source")


def test_caches_don_t_overwrite_one_another(pair, tmp_path):
    _, target = pair
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    other = raw_strip("Other")
    for ob in (target, other, target):
        activate(ob)
        transfer(source="Source", what='ANIMATION', frame_start=1, frame_end=2)
    paths = [ob.modifiers[0].filepath for ob in (target, other)]
    assert len(target.modifiers) == 1 and len(set(paths)) == 2
    strip = bind(make_strip(name="Target/"))
    bpy.ops.object.detail_deform_bake(frame_start=1, frame_end=2)
    assert strip.modifiers["Detail Deform Cache"].filepath not in paths
    bpy.context.scene.render.frame_map_new = 200
    activate(target)
    for bake_as in ('CACHE', 'SHAPE_KEYS'):
        assert "remaps its time" in refusal(transfer, source="Source", what='ANIMATION', bake_as=bake_as)


def test_a_refused_transfer_leaves_what_was_kept(pair, tmp_path):
    source, target = pair
    path = tmp_path / "pairs.txt"
    path.write_text("0 0\n")
    transfer(source="Source", what='ACTIVE_KEY', correspondence='LIST', filepath=str(path))
    before = list(target.data['detail_deform_match']['arrays']['pairs'])
    path.write_text("1 1\n5 5\n")
    assert "no vertex group" in refusal(transfer, source="Source", correspondence='LIST', filepath=str(path),
                                        anchor='PINNED', anchor_group='none')
    assert list(target.data['detail_deform_match']['arrays']['pairs']) == before == [0, 0]
    # The file's header says that it has pairs of triangles.
    target.detail_deform.transfer.source = source
    bpy.ops.object.detail_deform_transfer_save(filepath=str(path))
    assert "holds pairs of triangles" in refusal(transfer, source="Source", correspondence='LIST', filepath=str(path),
                                                 pairs_of='VERTICES')


def test_a_bound_source_is_followed_without_delay(pair):
    _, target = pair
    strip = bind(make_strip(name="Strip"))
    empty = strip.detail_deform.handles[0].target
    activate(target)
    bpy.ops.object.detail_deform_transfer_live(source="Strip")
    last = raw_strip("A follower of the follower")
    bpy.ops.object.detail_deform_transfer_live(source="Target")
    for frame, height in ((1, 0.0), (10, 0.4)):
        empty.location.z = height
        empty.keyframe_insert('location', frame=frame)
    for frame in (1, 10, 1, 10):
        bpy.context.scene.frame_set(frame)
        shown = evaluated(strip)
        assert (np.abs(shown - own(strip)).max() > 0.3) == (frame == 10)
        for follower in (target, last):
            assert np.abs(evaluated(follower) - shown).max() < 1e-4
    empty.animation_data_clear()
    empty.location.z = 0.2
    update()
    assert np.abs(evaluated(target) - evaluated(strip)).max() < 1e-4


def test_following_ends_by_apply_unbind_removal_or_deletion(pair):
    source, target = pair
    source.data.shape_keys.key_blocks["Bend"].value = 1
    live = bpy.ops.object.detail_deform_transfer_live
    settings = target.detail_deform.transfer
    bent_pose = bent(own(source))

    live(source="Source")
    assert "would be doubled" in refusal(transfer, source="Source")
    bpy.ops.object.detail_deform_apply(mode='SHAPE_KEY')
    assert not settings.live and not target.modifiers
    assert np.abs(evaluated(target) - bent_pose).max() < 1e-4
    target.shape_key_clear()

    live(source="Source")
    bpy.ops.object.detail_deform_unbind()
    assert not settings.live and np.abs(evaluated(target) - own(target)).max() == 0

    live(source="Source")
    target.modifiers.remove(target.modifiers[0])
    update()
    bpy.context.scene.frame_set(2)
    assert "modifier was removed" in target.detail_deform.status
    live(on=False)

    live(source="Source")
    activate(source)
    bpy.ops.object.delete()
    bpy.context.scene.frame_set(3)
    assert "source was deleted" in target.detail_deform.status
    activate(target)
    live(on=False)
    assert not target.detail_deform.transfer.live


def test_a_start_that_is_refused_changes_nothing(pair):
    source, target = pair
    other = raw_strip("Other", 20)
    activate(target)
    assert "not of the same topology" in refusal(bpy.ops.object.detail_deform_transfer_live, source="Other")
    settings = target.detail_deform.transfer
    assert not target.modifiers and not settings.live and settings.source is None
    bpy.ops.object.detail_deform_transfer_live(source="Source")
    assert "not of the same topology" in refusal(bpy.ops.object.detail_deform_transfer_live, source=other.name)
    assert settings.live and settings.source == source
    # There is no saved match to forget: it follows by topology.
    assert "no Saved Match" in refusal(bpy.ops.object.detail_deform_transfer_forget)


def test_undo_takes_a_transfer_back(pair):
    bpy.ops.ed.undo_push(message="Before")
    transfer(source="Source", what='ALL_KEYS')
    bpy.ops.ed.undo_push(message="Transferred")
    bpy.ops.ed.undo()
    assert bpy.data.objects["Target"].data.shape_keys is None
    bpy.ops.ed.redo()
    assert len(bpy.data.objects["Target"].data.shape_keys.key_blocks) == 3


def test_following_is_not_doubled_and_goes_in_no_circle(pair, tmp_path):
    source, target = pair
    live = bpy.ops.object.detail_deform_transfer_live
    source.data.shape_keys.key_blocks["Bend"].value = 1
    transfer(source="Source")
    assert "as 'Source Pose', and would be doubled" in refusal(live, source="Source")
    target.data.shape_keys.key_blocks["Source Pose"].value = 0
    assert live(source="Source") == {'FINISHED'}
    source.data.shape_keys.key_blocks["Bend"].value = 0
    activate(source)
    assert "follows 'Source' already" in refusal(live, source="Target")
    activate(target)
    live(on=False)
    transfer(source="Source", what='ANIMATION', frame_start=1, frame_end=2, cache_path=str(tmp_path / "t.pc2"))
    assert "plays a transferred animation" in refusal(live, source="Source")


def test_the_original_formulation_with_fourth_points(pair):
    source, target = pair
    other = raw_strip("Other")
    other.data.vertices.foreach_set('co', (own(other) * (1, 1, 4)).astype(np.float32).ravel())
    found = []
    for formulation in ('SURFACE', 'FOURTH_POINTS', 'FOURTH_POINTS_UNWEIGHTED'):
        for ob in (target, other):
            activate(ob)
            transfer(source="Source", what='ALL_KEYS', pattern="Bend", formulation=formulation)
        # On a mesh with the source's rest shape each formulation gives the source's pose; on another one they differ a
        # little.
        assert np.abs(coordinates(target.data.shape_keys.key_blocks["Bend"]) - bent(own(source))).max() < 1e-5
        found.append(coordinates(other.data.shape_keys.key_blocks["Bend"]))
    for original in found[1:]:
        assert 1e-5 < np.abs(original - found[0]).max() < 0.05


def turned(faces):
    return [face[1:] + face[:1] for face in faces]


def halved(faces):
    """Triangles, cutting the quads by either diagonal in turns."""
    return [part for number, f in enumerate(faces) for part in (
        ([f[0], f[1], f[2]], [f[0], f[2], f[3]]) if number % 2 else ([f[1], f[2], f[3]], [f[1], f[3], f[0]]))]


def joined(faces):
    """Joins some pairs of quads to faces of six corners."""
    found, left = [], list(map(tuple, faces))
    while left:
        first = left.pop(0)
        second = next((face for face in left if len(set(face) & set(first)) == 2), None) if len(left) % 3 else None
        if second is None:
            found.append(list(first))
            continue
        left.remove(second)
        shared = set(first) & set(second)
        at = next(k for k in range(4) if {first[k], first[(k + 1) % 4]} == shared)
        begin = second.index(first[at])
        inner = [second[(begin + k) % 4] for k in (1, 2)]
        if set(inner) & shared:
            inner = [second[(begin - k) % 4] for k in (1, 2)]
        found.append([*first[:at + 1], *inner, *first[at + 1:]])
    return found


def remade(ob, faces):
    mesh = bpy.data.meshes.new(ob.name)
    mesh.from_pydata(own(ob).tolist(), [], faces)
    mesh.validate()
    assert len(mesh.polygons) == len(faces)
    ob.data = mesh


FACES = {
    'another order': lambda faces: faces[::-1], 'begun elsewhere': turned,
    'wound the other way': lambda faces: [face[::-1] for face in faces], 'triangles': halved,
    'some of six corners': joined, 'triangles in another order': lambda faces: turned(halved(faces))[::-1],
}


@pytest.mark.parametrize('of_source', [False, True])
@pytest.mark.parametrize('kind', FACES)
def test_the_order_and_triangulation_of_faces_do_not_matter(pair, kind, of_source, part):
    """Meshes whose faces join the same vertices, also when triangulated, have the same topology: they match vertex by
    vertex, and can be examples of one another."""
    source, target = pair
    faces = [list(face.vertices) for face in target.data.polygons]
    if of_source:
        keys = [(key.name, coordinates(key)) for key in source.data.shape_keys.key_blocks[1:]]
        remade(source, FACES[kind](faces))
        for name, positions in keys:
            add_key(source, name, positions)
    else:
        remade(target, FACES[kind](faces))
    activate(target)
    assert transfer(source="Source", what='ALL_KEYS', correspondence='TOPOLOGY') == {'FINISHED'}
    for key in source.data.shape_keys.key_blocks[1:]:
        assert np.abs(coordinates(target.data.shape_keys.key_blocks[key.name]) - coordinates(key)).max() < 1e-5
    target.shape_key_clear()
    target.detail_deform.method = 'EXAMPLES'
    source.shape_key_clear()
    source.data.vertices[5].co.z += 1
    source.select_set(True)
    assert bpy.ops.object.detail_deform_examples_from_objects() == {'FINISHED'}
    assert np.abs(part('scene.examples').positions(target)[0][5] - own(source)[5]).max() < 1e-6


def test_faces_that_join_other_vertices_are_refused(pair):
    """One flipped edge in a mesh of triangles, and a missing face."""
    source, target = pair
    faces = [list(face.vertices) for face in target.data.polygons]
    triangles = [part for f in faces for part in ([f[0], f[1], f[2]], [f[0], f[2], f[3]])]
    a, b, c, d = faces[100]
    others = [[a, b, d], [b, c, d]]
    for ob, made in ((source, triangles), (target, triangles[:200] + others + triangles[202:])):
        remade(ob, made)
    add_key(source, "Bend", bent(own(source)))
    activate(target)
    assert "join other vertices" in refusal(transfer, source="Source", what='ALL_KEYS', correspondence='TOPOLOGY')
    remade(target, faces[1:])
    assert "not of the same topology" in refusal(transfer, source="Source", what='ALL_KEYS', correspondence='TOPOLOGY')


def test_the_record_of_many_keys_is_read_and_written_once(pair, part, monkeypatch):
    """A cost quadratic in the number of keys takes minutes for the thousands of keys in some files."""
    source, target = pair
    for number in range(40):
        add_key(source, f"Key {number}", own(source) + 0.01 * number)
    transferred, calls = part('scene.transferred'), []
    for owner, name in ((transferred, 'transferred_keys'), (transferred.json, 'dumps')):
        was = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *args, was=was, name=name, **kw: calls.append(name) or was(*args, **kw))
    for _ in range(2):  # the second time, the keys of the first are replaced
        calls.clear()
        activate(target)
        assert transfer(source="Source", what='ALL_KEYS') == {'FINISHED'}
        assert calls.count('dumps') == 1 and calls.count('transferred_keys') < 5
        assert len(target.data.shape_keys.key_blocks) == len(source.data.shape_keys.key_blocks)
    assert set(transferred.transferred_keys(target)) == {key.name for key in source.data.shape_keys.key_blocks[1:]}
