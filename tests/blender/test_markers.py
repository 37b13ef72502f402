# SPDX-License-Identifier: GPL-3.0-or-later
"""Markers: those that contradict the others are named, matches with few or no markers, and how markers are shown."""

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector

from conftest import FIXTURES, activate, add_empty, group, has_voxels, make_strip, own, refusal, update
from test_fixtures import triangles
from test_transfer import add_key, bent, mark, raw_strip, transfer


@pytest.fixture
def creatures():
    """(calf, giraffe), with the same 39 markers."""
    bpy.ops.wm.open_mainfile(filepath=str(FIXTURES / 'creatures.blend'), load_ui=False)
    return bpy.data.objects["Calf"], bpy.data.objects["Giraffe"]


@pytest.fixture
def heads():
    """(Suzanne, a triangulated Suzanne with a broad face, a long chin and small ears). The eyes are loose parts."""
    made = []
    for name in ("Narrow", "Broad"):
        bpy.ops.mesh.primitive_monkey_add()
        ob = bpy.context.active_object
        ob.name = name
        ob.modifiers.new("Subdivision", 'SUBSURF').levels = 1
        if name == "Broad":
            ob.modifiers.new("Triangles", 'TRIANGULATE')
            ob.data.vertices.foreach_set('co', _broad(own(ob)).astype(np.float32).ravel())
        for modifier in list(ob.modifiers):
            bpy.ops.object.modifier_apply(modifier=modifier.name)
        made.append(ob)
    return made


def _broad(p):
    x, y, z = p.T
    wide = np.where(np.abs(x) < 0.8, 1.4 * x, np.sign(x) * (1.12 + 0.6 * (np.abs(x) - 0.8)))
    return np.stack([wide, 0.8 * y, np.where(z < 0, 1.6 * z, 0.9 * z)], -1)


def ended(steps):
    """Runs a generator to its end; returns its return value."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def share_found(part, pair, marked, size, wrong, count=60):
    """The fraction of random sets of `size` markers in which exactly the wrong markers are doubted.

    marked: the vertices of corresponding markers on both objects of the pair. wrong: 'misplaced', one marker of a set
    is at a distant other marker's place; 'exchanged', two distant ones are exchanged; '', all are right.
    """
    check, rng = part('setup.marker_check'), np.random.default_rng(1)
    there, here = (ended(check._distances(ob, vertices)) for ob, vertices in zip(pair, marked))
    found = 0
    for _ in range(count):
        chosen = apart(there, size, rng)
        taken, truth = list(chosen), ()
        far = [k for k in range(len(here)) if here[chosen[0], k] > 0.35 * here.max()]
        if wrong == 'misplaced':
            taken[0], truth = rng.choice([k for k in far if k not in chosen]), (0,)
        elif wrong == 'exchanged':
            other = next(number for number, k in enumerate(chosen) if k in far)
            taken[0], taken[other], truth = taken[other], taken[0], (0, other)
        found += check.doubtful(there[np.ix_(chosen, chosen)], here[np.ix_(taken, taken)]) == truth
    return found / count


def apart(distances, size, rng):
    """Indices of rows that are far apart from each other, as an artist chooses markers' places."""
    chosen = [int(rng.integers(len(distances)))]
    while len(chosen) < size:
        left = [k for k in rng.permutation(len(distances)).tolist() if k not in chosen][:8]
        chosen.append(max(left, key=lambda k: distances[k, chosen].min()))
    return chosen


def marked_animals(part, pair):
    return [list(part('setup.markers').of(ob).values()) for ob in pair]


@pytest.mark.parametrize('size', [6, 10, 20])
def test_good_markers_on_unlike_animals_raise_no_alarm(creatures, part, size):
    marked = marked_animals(part, creatures)
    assert share_found(part, creatures, marked, size, '') == 1
    assert share_found(part, creatures[::-1], marked[::-1], size, '') == 1


@pytest.mark.parametrize('size', [10, 20])
@pytest.mark.parametrize('wrong', ['misplaced', 'exchanged'])
def test_the_wrong_markers_of_unlike_animals_are_named(creatures, part, size, wrong):
    assert share_found(part, creatures, marked_animals(part, creatures), size, wrong) >= 0.75


@pytest.mark.parametrize('wrong', ['', 'misplaced', 'exchanged'])
def test_markers_on_unlike_heads(heads, part, wrong):
    # The same vertices on both: the first 507 are those of the mesh before subdivision. Some are on the eyes.
    p = own(heads[0])[:507]
    places = apart(np.linalg.norm(p[:, None] - p, axis=2), 30, np.random.default_rng(1))
    found = share_found(part, heads, [places, places], 10, wrong)
    assert found == 1 if not wrong else found >= 0.75


def test_animals_with_all_their_markers_are_in_no_doubt(creatures, part):
    assert ended(part('setup.marker_check').search(*creatures)) == ()


@pytest.mark.large
@pytest.mark.parametrize('count', [0, 3])
def test_a_calf_is_matched_to_a_giraffe(creatures, part, count):
    """The fitted calf's markers, without those given to the search, are near the giraffe's; its neck and legs are
    longer than the calf's."""
    there, here = (np.array(vertices) for vertices in marked_animals(part, creatures))
    calf, giraffe = ((own(ob), triangles(ob)) for ob in creatures)
    places = calf[0][there]
    chosen = apart(np.linalg.norm(places[:, None] - places, axis=2), count, np.random.default_rng(1)) if count else []
    markers = np.stack([there[chosen], here[chosen]], 1) if count else ()
    _, confidence, fitted = part('library.native').Match(calf, giraffe, markers).finish()
    away = np.linalg.norm(fitted[there] - giraffe[0][here], axis=1) / np.linalg.norm(np.ptp(giraffe[0], axis=0))
    assert np.delete(away, chosen).mean() < 0.055
    assert confidence.mean() > 0.6


TURN = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])


def give_other_faces(heads, change):
    """Adds a key to the source; gives its rest shape, turned, shifted and with other faces, to the target. A remesh
    keeps only the surface that is visible from outside."""
    source, target = heads
    p = own(source)
    add_key(source, "Chin", p + np.where(p[:, 2:] < -0.4, (0, -0.2, -0.1), 0))
    target.data.vertices.foreach_set('co', (p @ TURN.T + (3, 0, 0)).astype(np.float32).ravel())
    if change == 'decimated':
        modifier = target.modifiers.new("Decimate", 'DECIMATE')
        modifier.ratio = 0.5
    else:
        modifier = target.modifiers.new("Remesh", 'REMESH')
        modifier.voxel_size = 0.05
    activate(target)
    bpy.ops.object.modifier_apply(modifier=modifier.name)


@pytest.mark.parametrize('change', ['decimated', pytest.param('remeshed', marks=has_voxels)])
def test_a_head_with_other_faces_needs_no_markers(heads, change):
    give_other_faces(heads, change)
    source, target = heads
    p = own(source)
    share = len(target.data.vertices) / len(p)
    assert share < 0.7 if change == 'decimated' else share > 1.3
    assert bpy.ops.object.detail_deform_transfer_match(source=source.name) == {'FINISHED'}
    assert target.detail_deform.transfer.show_match and target.detail_deform.transfer.correspondence == 'STORED'
    assert transfer(source=source.name, what='ALL_KEYS', correspondence='STORED') == {'FINISHED'}
    rest, key = own(target), target.data.shape_keys.key_blocks["Chin"]
    moved = np.array([point.co for point in key.data]) - rest
    chin = rest[:, 2] < -0.55
    assert np.allclose(moved[chin].mean(0), TURN @ (0, -0.2, -0.1), atol=0.03)
    assert np.abs(moved[rest[:, 2] > 0.2]).max() < 0.03


def _put(source, ear, stands):
    """Changes the local spaces of both objects; returns the matrix (4, 4) from the source's to the ear's. In the world
    only a sheared parent moves them, both together."""
    if stands == "with an origin of its own":
        bpy.ops.object.origin_set(type='ORIGIN_GEOMETRY')
    elif stands == "turned, and sheared by its parent":
        turned = Matrix.Translation((3, 0, -1)) @ Euler((0.3, 1, -0.2)).to_matrix().to_4x4()
        ear.data.transform(turned.inverted())
        ear.matrix_world = turned
        parent = add_empty("Parent", (1, 2, 3))
        parent.scale = 1, 1.5, 0.7
        source.parent = ear.parent = parent
    update()
    assert (stands == "as it was") == (ear.matrix_world == source.matrix_world)
    return np.array(ear.matrix_world.inverted() @ source.matrix_world)


@pytest.mark.parametrize('stands', ["as it was", "with an origin of its own", "turned, and sheared by its parent"])
def test_a_part_in_an_object_of_its_own_needs_no_markers(heads, stands):
    """An ear that was separated, and a key of the head that lifts its tip."""
    source, ear = heads
    p = own(source)
    tip = np.maximum(p[:, :1] - 1, 0)
    add_key(source, "Lift", p + tip * (0, 0, 0.5))
    ear.data.vertices.foreach_set('co', p.astype(np.float32).ravel())
    kept = bmesh.new()
    kept.from_mesh(ear.data)
    bmesh.ops.delete(kept, geom=[vertex for vertex in kept.verts if vertex.co.x < 0.75], context='VERTS')
    kept.to_mesh(ear.data)
    kept.free()
    activate(ear)
    assert 50 < len(ear.data.vertices) < len(p) / 6
    to_ear = _put(source, ear, stands)
    assert bpy.ops.object.detail_deform_transfer_match(source=source.name) == {'FINISHED'}
    assert transfer(source=source.name, what='ALL_KEYS', correspondence='STORED') == {'FINISHED'}
    rest, key = own(ear), ear.data.shape_keys.key_blocks["Lift"]
    moved = np.array([point.co for point in key.data]) - rest
    on_head = rest @ np.linalg.inv(to_ear[:3, :3]).T + np.linalg.solve(to_ear[:3, :3], -to_ear[:3, 3])
    expected = np.maximum(on_head[:, :1] - 1, 0) * (0, 0, 0.5) @ to_ear[:3, :3].T
    assert np.linalg.norm(expected, axis=1).max() > 0.1
    assert np.abs(moved - moved.mean(0) - (expected - expected.mean(0))).max() < 0.01


def test_the_stance_of_a_source_is_a_rotation_and_a_scale(part):
    proportions = part('scene.proportions')
    source, target = raw_strip("Source"), raw_strip("Target")

    def stance(of_source, of_target):
        source.matrix_world, target.matrix_world = of_source, of_target
        update()
        return proportions.relative_transform(source, target)

    turned = Matrix.Translation((1, 2, 3)) @ Euler((0.3, 1, -0.2)).to_matrix().to_4x4()
    apart = Matrix.Translation((-5, 0, 2)) @ Matrix.Scale(4, 4)
    expected = np.array(apart.inverted() @ turned)[:3]
    assert np.allclose(stance(turned, apart), expected, atol=1e-5)
    flipped = Matrix.Diagonal((-1, 1, 1, 1))
    assert np.allclose(stance(flipped @ turned, flipped @ apart), expected, atol=1e-5)
    assert np.linalg.det(stance(flipped @ turned, apart)[:, :3]) < 0
    found = stance(turned @ Matrix.Diagonal((1, 2, 5, 1)), apart)[:, :3]
    assert np.allclose(found @ found.T, (5 / 4)**2 * np.eye(3), atol=1e-4)
    for flat in ((1, 1, 0, 1), (0, 0, 0, 1)):
        assert stance(Matrix.Diagonal(flat), apart) is None and stance(turned, Matrix.Diagonal(flat)) is None


def test_a_match_that_fits_is_not_searched_again_where_an_object_was_moved(heads, part, monkeypatch):
    matching, (source, target) = part('setup.matching'), heads
    search, native = matching.search, matching.native
    found = ended(search(source, target))
    target.location.x += 5
    update()
    monkeypatch.setattr(native, 'Match', None)
    assert ended(search(source, target)) is found
    monkeypatch.undo()
    found.confidence = 0 * found.confidence
    assert ended(search(source, target)) is not found


def test_displacements_go_by_the_points_that_are_kept_with_a_match(heads, part):
    give_other_faces(heads, 'decimated')
    source, target = heads
    p = own(source)
    by_displacements = dict(what='ALL_KEYS', correspondence='STORED', placing='DISPLACEMENTS')
    assert bpy.ops.object.detail_deform_transfer_match(source=source.name) == {'FINISHED'}
    matched, rest = part('scene.saved_match').stored(source, target), own(target)
    triangles, weights = matched.points
    places = (weights[:, :, None] * p[matched.source_triangles[triangles]]).sum(1) @ TURN.T + (3, 0, 0)
    assert np.abs(places - rest).max() < 0.03
    assert transfer(source=source.name, **by_displacements) == {'FINISHED'}
    key = target.data.shape_keys.key_blocks["Chin"]
    moved = np.array([point.co for point in key.data]) - rest
    assert np.abs(moved[rest[:, 2] < -0.55] - TURN @ (0, -0.2, -0.1)).max() < 1e-3
    assert np.abs(moved[rest[:, 2] > -0.25]).max() < 1e-3
    # A Saved Match whose points are damaged goes by its pairs.
    kept = target.data['detail_deform_match']['arrays']
    kept['point_weights'] = kept['point_weights'][:-1]
    assert part('scene.saved_match').stored(source, target).points is None
    assert transfer(source=source.name, **by_displacements) == {'FINISHED'}
    moved = np.array([point.co for point in target.data.shape_keys.key_blocks["Chin"].data]) - rest
    assert np.allclose(moved[rest[:, 2] < -0.55].mean(0), TURN @ (0, -0.2, -0.1), atol=0.01)


def test_an_ambiguous_match_asks_for_a_marker_and_may_be_taken(part):
    source, target = raw_strip("Source", 21), raw_strip("Target", 33)
    for ob in (source, target):  # flat squares
        ob.data.vertices.foreach_set('co', (own(ob) * (1, 1, 0)).astype(np.float32).ravel())
    add_key(source, "Bend", bent(own(source)))
    activate(target)
    told = refusal(transfer, source="Source", what='ALL_KEYS', correspondence='MARKERS')
    assert "'Source' fits 'Target' about as well turned another way" in told and "press Find Match" in told
    assert target.data.shape_keys is None
    assert bpy.ops.object.detail_deform_transfer_match(source="Source") == {'FINISHED'}
    assert target.detail_deform.transfer.correspondence == 'STORED'
    # Of the ways to turn it, Find Match takes the one in which the meshes stand.
    matched = part('scene.saved_match').stored(source, target)
    centres = [own(ob)[triangles].mean(1)[matched.pairs[:, side]] for side, (ob, triangles) in enumerate(
        ((source, matched.source_triangles), (target, matched.target_triangles)))]
    assert np.abs(centres[0] - centres[1]).max() < 0.1


def test_wrong_markers_are_named_before_anything_is_transferred(part):
    source, target = raw_strip("Source", 21), raw_strip("Target", 33)
    add_key(source, "Bend", bent(own(source)))
    mark(source, 21, False)
    mark(target, 33, False)
    for name, vertex in (("Marker 1", 33 * 33 - 1), ("Marker 9", 0)):  # opposite corners: 1 and 9 are exchanged
        target.vertex_groups.remove(target.vertex_groups[name])
        group(target, name, [vertex])
    activate(target)
    named = "Markers 1 and 9 seem to be exchanged on 'Source' or 'Target'"
    assert named in refusal(transfer, source="Source", what='ALL_KEYS', correspondence='MARKERS')
    target.detail_deform.transfer.correspondence = 'MARKERS'
    assert named in refusal(bpy.ops.object.detail_deform_transfer_live, source="Source")
    assert target.data.shape_keys is None and not target.detail_deform.transfer.live
    # Find Match uses them nevertheless: they may be intended.
    assert bpy.ops.object.detail_deform_transfer_match(source="Source") == {'FINISHED'}
    assert target.detail_deform.transfer.correspondence == 'STORED'


@pytest.mark.large
@pytest.mark.parametrize('size', [3, 4, 5])
def test_the_wrong_one_of_a_few_markers_is_named(creatures, part, size):
    check, of = part('setup.marker_check'), part('setup.markers').of
    good = [dict(list(of(ob).items())[::7][:size]) for ob in creatures]
    assert ended(check.search(*creatures, *good)) == ()
    numbers = list(good[0])
    other = of(creatures[1])
    far = max(other, key=lambda k: np.linalg.norm(own(creatures[1])[other[k]] -
                                                  own(creatures[1])[good[1][numbers[0]]]))
    assert ended(check.search(*creatures, good[0], {**good[1], numbers[0]: other[far]})) == (numbers[0],)
    partner = max(numbers, key=lambda k: np.linalg.norm(own(creatures[1])[good[1][k]] -
                                                        own(creatures[1])[good[1][numbers[0]]]))
    exchanged = {**good[1], numbers[0]: good[1][partner], partner: good[1][numbers[0]]}
    assert ended(check.search(*creatures, good[0], exchanged)) == (numbers[0], partner)


def test_a_wrong_marker_is_named_in_the_panel_until_it_is_corrected(part):
    source, target = raw_strip("Source", 21), raw_strip("Target", 33)
    mark(source, 21, False)
    mark(target, 33, False)
    target.vertex_groups.remove(target.vertex_groups["Marker 1"])
    group(target, "Marker 1", [33 * 20 + 25])
    known = part('ui.marker_cache')
    assert known.doubts(source, target) == ()
    while known._search_on() is not None:
        pass
    assert known.doubts(source, target) == (1,)
    assert "Marker 1 seems to be at different places" in part('setup.marker_check').sentence((1,), source, target)
    target.vertex_groups.remove(target.vertex_groups["Marker 1"])
    update()
    group(target, "Marker 1", [0])
    target.data.update()
    update()
    known.doubts(source, target)
    while known._search_on() is not None:
        pass
    assert known.doubts(source, target) == ()


def test_numbers_are_shown_on_both_meshes_whichever_is_active(part):
    source, target = raw_strip("Source"), raw_strip("Target")
    target.detail_deform.transfer.source = source
    source.location.x = 3
    group(target, "Marker 1", [4])
    group(target, "Marker 2", [600])
    group(source, "Marker 1", [5])
    update()
    preview = part('ui.marker_preview')

    def labels(ob):
        found = preview.labels(ob, bpy.context.evaluated_depsgraph_get())
        return {(number, rounded(place)): colour == preview._BOTH_COLOUR for number, place, colour in found}

    def rounded(place):
        return tuple(round(float(x), 4) + 0.0 for x in place)

    def at(vertex, ob, shift=0):
        return rounded(own(ob)[vertex] + (shift, 0, 0))

    expected = {(1, at(4, target)): True, (2, at(600, target)): False, (1, at(5, source, 3)): True}
    assert labels(target) == expected and labels(source) == expected
    group(source, "Marker 2", [6])
    assert list(labels(source).values()) == [True] * 4
    target.detail_deform.transfer.show_markers = False
    assert not labels(source)
    assert not labels(make_strip())  # neither a source nor a target


def test_markers_behind_the_surface_are_hidden(part):
    bpy.ops.mesh.primitive_uv_sphere_add(location=(2, 0, 0), scale=(1, 2, 1))
    ball = bpy.context.active_object
    update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    hidden = part('ui.marker_cache').is_hidden
    eye = Vector((2, -20, 0))
    places = [ball.matrix_world @ v.co for v in ball.data.vertices]
    front, back = min(places, key=lambda p: p.y), max(places, key=lambda p: p.y)
    assert not hidden(front, eye, [ball], depsgraph) and hidden(back, eye, [ball], depsgraph)
    assert not hidden(back, eye, [], depsgraph)
    # By the present shape, after it was flattened.
    ball.data.vertices.foreach_set('co', (own(ball) * (1, 0, 1)).astype(np.float32).ravel())
    ball.data.update()
    update()
    assert not hidden(Vector((2, 0, 0.5)), eye, [ball], bpy.context.evaluated_depsgraph_get())
    assert hidden(Vector((2, 1, 0.5)), eye, [ball], bpy.context.evaluated_depsgraph_get())


def test_a_source_knows_its_targets(part):
    source, first, second = raw_strip("Source"), raw_strip("First"), raw_strip("Second")
    known = part('ui.marker_cache')
    assert known.followers(source) == []
    for target in (first, second):
        target.detail_deform.transfer.source = source
    assert known.followers(source) == [first, second] and known.followers(first) == []
    activate(source)
    bpy.ops.object.detail_deform_target_activate(target="Second")
    assert bpy.context.active_object == second
    second.detail_deform.transfer.source = None
    assert known.followers(source) == [first]
    activate(source)
    assert "'Nobody' is not in this scene" in refusal(bpy.ops.object.detail_deform_target_activate, target="Nobody")


def test_a_marker_empty_that_is_moved_marks_another_vertex(part):
    ob = raw_strip("Strip")
    empty = add_empty("Marker 4", own(ob)[9], parent=ob)
    update()
    known = part('ui.marker_cache')
    assert known.markers_of(ob) == {4: 9}
    empty.location = own(ob)[70]
    update()
    assert known.markers_of(ob) == {4: 70}


def test_a_source_that_is_no_mesh_any_more_has_no_markers(part):
    curve = bpy.data.objects.new("Curve", bpy.data.curves.new("Curve", 'CURVE'))
    bpy.context.scene.collection.objects.link(curve)
    assert part('ui.marker_cache').markers_of(curve) == {}


def test_markers_in_one_place_are_in_no_doubt(part):
    assert part('setup.marker_check').doubtful(np.zeros((8, 8)), np.zeros((8, 8))) == ()


def test_a_marker_is_selected_by_its_number():
    ob = raw_strip("Strip")
    group(ob, "Marker 3", [70])
    empty = add_empty("Marker 4", own(ob)[9], parent=ob)
    activate(ob)
    update()
    bpy.ops.object.detail_deform_marker_select(number=3)
    assert ob.mode == 'EDIT'
    bpy.ops.object.mode_set(mode='OBJECT')
    assert [v.index for v in ob.data.vertices if v.select] == [70]
    for mode in ('OBJECT', 'EDIT'):
        activate(ob)
        bpy.ops.object.mode_set(mode=mode)
        bpy.ops.object.detail_deform_marker_select(number=4)
        assert bpy.context.active_object == empty and ob.mode == 'OBJECT'
    activate(ob)
    assert "has no marker 5" in refusal(bpy.ops.object.detail_deform_marker_select, number=5)
