# SPDX-License-Identifier: GPL-3.0-or-later
"""Users delete empties, rename groups and copy meshes beside deforming; the deformation stays right."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, bind, evaluated, group, make_strip, members, own, pull, refusal, update
from rigs import make_rigged

BRING_BACK = bpy.ops.object.detail_deform_bring_back


@pytest.fixture
def pulled():
    """A strip with two handles made by Pull, both moved."""
    ob = make_strip()
    ob.detail_deform.handles.clear()
    ob.vertex_groups.clear()
    ob.detail_deform.region = ""
    for low, high, up in ((0.8, 1.1, 0.3), (0.3, 0.4, -0.1)):
        x = own(ob)[:, 0]
        empty = pull(ob, (x > low) & (x < high), radius=0.3)
        empty.location.z += up
        update()
    return activate(ob)


def right(ob):
    """Offsets of the first handle's vertices."""
    return (evaluated(ob) - own(ob))[own(ob)[:, 0] > 0.8]


# ---- deleted empties

def delete(empty):
    activate(empty)
    bpy.ops.object.delete()
    update()


def remove(empty):
    bpy.data.objects.remove(empty)
    update()


@pytest.mark.parametrize('way', [delete, remove])
def test_where_an_empty_was_deleted_the_other_handles_go_on(pulled, way):
    before = right(pulled)
    way(pulled.detail_deform.handles[0].target)
    other = pulled.detail_deform.handles[1].target
    other.location.z -= 0.2
    update()
    middle = np.abs(own(pulled)[:, 0] - 0.35) < 0.04
    assert np.allclose((evaluated(pulled) - own(pulled))[middle, 2].mean(), -0.3, atol=0.02)
    assert np.abs(right(pulled) - before).max() < 1e-5
    assert "which were deleted or left behind" in pulled.detail_deform.status
    assert pulled.detail_deform.is_bound and not pulled.detail_deform.problem


@pytest.mark.parametrize('saved', [False, True])
def test_an_empty_comes_back_where_it_was(pulled, saved, tmp_path):
    before, empty = evaluated(pulled), pulled.detail_deform.handles[0].target
    place, name = empty.matrix_world.copy(), empty.name
    delete(empty)
    if saved:
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'deleted.blend'))
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'deleted.blend'))
        pulled = bpy.data.objects["Strip"]
    activate(pulled)
    assert BRING_BACK() == {'FINISHED'}
    update()
    found = pulled.detail_deform.handles[0].target
    assert found.name == name and found.name in bpy.context.view_layer.objects
    assert np.allclose(found.matrix_world, place, atol=1e-6)
    assert np.abs(evaluated(pulled) - before).max() < 1e-5
    assert "lost their empties" not in pulled.detail_deform.status
    found.location.z += 0.1
    update()
    assert np.allclose(right(pulled)[:, 2].mean(), 0.4, atol=0.02)
    assert "lost its empty" in refusal(BRING_BACK)


def test_a_deleted_empty_on_a_bone_comes_back_on_the_bone(tmp_path):
    ob, _ = make_rigged()
    tip = own(ob)[:, 0] > 2.8
    empty = pull(activate(ob), tip, radius=1)
    assert empty.parent_type == 'BONE'
    empty.matrix_world = Matrix.Translation((0, 0, 0.3)) @ empty.matrix_world
    update()
    before = evaluated(ob)
    delete(empty)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'bone.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'bone.blend'))
    ob = bpy.data.objects["Limb"]
    ob.data.update_tag()
    bpy.context.scene.frame_set(1)
    assert np.abs(evaluated(ob) - before).max() < 1e-4
    activate(ob)
    assert BRING_BACK() == {'FINISHED'}
    update()
    assert np.abs(evaluated(ob) - before).max() < 1e-4


def test_two_handles_of_one_deleted_empty_get_it_back(pulled):
    first, second = pulled.detail_deform.handles
    second.target = first.target
    update()
    bind(pulled)
    delete(first.target)
    activate(pulled)
    assert BRING_BACK() == {'FINISHED'}
    assert "lost their empties" not in pulled.detail_deform.status


def test_an_empty_removed_from_the_file_begins_anew_at_rest(pulled):
    remove(pulled.detail_deform.handles[0].target)
    activate(pulled)
    assert BRING_BACK() == {'FINISHED'}
    update()
    empty = pulled.detail_deform.handles[0].target
    # 0.3: the first handle's motion at the time of the second Pull, whose Bind starts from the surface shown then.
    assert np.allclose(right(pulled), (0, 0, 0.3), atol=1e-5)
    middle = evaluated(pulled)[own(pulled)[:, 0] > 0.8].mean(axis=0)
    assert np.linalg.norm(np.array(empty.matrix_world.translation) - middle) < 0.02
    empty.matrix_world = Matrix.Translation((0, 0, 0.25)) @ empty.matrix_world
    update()
    assert np.allclose(right(pulled)[:, 2].mean(), 0.55, atol=0.02)
    activate(pulled)
    assert bpy.ops.object.detail_deform_handle_reset(everything=True) == {'FINISHED'}
    assert np.abs(evaluated(pulled) - own(pulled)).max() < 1e-4


def test_the_handle_of_a_deleted_empty_can_be_removed(pulled):
    delete(pulled.detail_deform.handles[0].target)
    activate(pulled)
    pulled.detail_deform.handle_index = 0
    assert bpy.ops.object.detail_deform_handle_remove() == {'FINISHED'}
    update()
    bind(pulled, keep_rest=True)
    assert "deleted" not in pulled.detail_deform.status


def test_an_empty_in_an_excluded_collection_is_not_taken_for_deleted(pulled):
    """It isn't evaluated, so its place is unknown, but it is in the file."""
    collection = pulled.detail_deform.handle_collection
    layer = next(layer for layer in bpy.context.view_layer.layer_collection.children if layer.collection == collection)
    layer.exclude = True
    update()
    pulled.detail_deform.handles[1].target.location.z += 0.1
    update()
    assert "deleted" not in pulled.detail_deform.status


# ---- renamed groups

@pytest.mark.parametrize('which', ['handle', 'region', 'influence', 'all'])
def test_a_group_that_is_renamed_stays_what_it_was(pulled, which):
    of = pulled.detail_deform
    group(pulled, "Seen", range(len(pulled.data.vertices)))
    of.influence = "Seen"
    update()
    before = evaluated(pulled)
    names = {'handle': [of.handles[0].vertex_group], 'region': [of.region], 'influence': ["Seen"],
             'all': [g.name for g in pulled.vertex_groups]}[which]
    for number, name in enumerate(names):
        pulled.vertex_groups[name].name = f"Other {number}"
    pulled.data.update_tag()
    update()
    of.handles[1].target.location.z += 0.0
    bpy.context.scene.frame_set(2)
    assert np.abs(evaluated(pulled) - before).max() < 1e-6
    assert of.is_bound and not of.stale and not of.problem, of.status
    assert all(name in pulled.vertex_groups for name in (of.region, of.influence, of.handles[0].vertex_group))
    of.handles[0].target.location.z += 0.1
    update()
    assert np.allclose(right(pulled)[:, 2].mean(), 0.4, atol=0.02)
    assert of.pulled_region  # the region is still known as Pull's own, which a later Pull may extend


def test_a_group_that_is_deleted_is_said(pulled):
    pulled.vertex_groups.remove(pulled.vertex_groups[pulled.detail_deform.handles[0].vertex_group])
    pulled.data.update_tag()
    update()
    assert "does not have" in pulled.detail_deform.status


def test_a_group_that_was_moved_in_the_list_is_still_the_handles(pulled):
    names = [handle.vertex_group for handle in pulled.detail_deform.handles]
    before = evaluated(pulled)
    pulled.vertex_groups.active_index = 0
    bpy.ops.object.vertex_group_move(direction='DOWN')
    update()
    bpy.context.scene.frame_set(2)
    assert [handle.vertex_group for handle in pulled.detail_deform.handles] == names
    assert np.abs(evaluated(pulled) - before).max() < 1e-6


# ---- copies

def linked_copy(ob, along=(3, 0, 0)):
    activate(ob)
    bpy.ops.object.duplicate(linked=True)
    copy = bpy.context.view_layer.objects.active
    copy.location = along
    update()
    return copy


@pytest.mark.parametrize('renamed', [False, True])
@pytest.mark.parametrize('by_pull', [True, False])
def test_the_first_of_linked_copies_moves_their_mesh(pulled, by_pull, renamed):
    if by_pull:
        ob = pulled
        empty = ob.detail_deform.handles[0].target
    else:
        ob = bind(make_strip(name="Other"))
        empty = ob.detail_deform.handles[0].target
    copy = linked_copy(ob)
    if renamed and by_pull:
        ob.name = "Z"
    empty.location.z += 0.2
    update()
    shown = evaluated(ob)
    assert shown[own(ob)[:, 0] > 0.9, 2].mean() > 0.15
    assert np.array_equal(evaluated(copy), shown)
    assert ob.detail_deform.is_bound and not ob.detail_deform.problem
    assert f"has the same mesh as '{ob.name}'" in copy.detail_deform.status
    ob.data.vertices[0].co.z += 0.1  # an edit, which needs a new Bind
    ob.data.update()
    update()
    bind(ob, keep_rest=True)
    bpy.data.objects.remove(copy)
    update()
    assert ob.detail_deform.is_bound


def test_the_first_of_linked_copies_is_pulled_further_and_baked(pulled, tmp_path):
    copy = linked_copy(pulled)
    x = own(pulled)[:, 0]
    empty = pull(pulled, (x > 0.55) & (x < 0.6), radius=0.1)
    empty.location.z += 0.2
    update()
    assert np.array_equal(evaluated(copy), evaluated(pulled)) and pulled.detail_deform.is_bound
    activate(pulled)
    assert bpy.ops.object.detail_deform_bake(mode='CACHE', frame_start=1, frame_end=2,
                                             filepath=str(tmp_path / 'linked.pc2')) == {'FINISHED'}
    activate(copy)
    assert "has the same mesh as" in refusal(bpy.ops.object.detail_deform_bake, mode='CACHE', frame_start=1,
                                             frame_end=2, filepath=str(tmp_path / 'copy.pc2'))


def test_a_linked_copy_can_not_be_unbound_alone(pulled):
    copy = linked_copy(pulled)
    activate(copy)
    assert "has the same mesh as" in refusal(bpy.ops.object.detail_deform_unbind)
    before = evaluated(pulled)
    bpy.ops.object.make_single_user(object=True, obdata=True)
    update()
    assert np.abs(evaluated(copy) - before).max() < 1e-5
    assert "posed alike" in copy.detail_deform.status


def test_a_copy_with_its_own_mesh_is_posed_like_the_first_wherever_it_stands(pulled):
    activate(pulled)
    bpy.ops.object.duplicate()
    copy = bpy.context.view_layer.objects.active
    copy.matrix_world = Matrix.Translation((5, 1, 2)) @ Matrix.Rotation(1, 4, 'Z') @ Matrix.Scale(2, 4)
    update()
    pulled.detail_deform.handles[0].target.location.z += 0.1
    update()
    assert np.abs(evaluated(copy) - evaluated(pulled)).max() < 1e-5
    assert copy.data != pulled.data


@pytest.mark.parametrize('what', ['all', 'one'])
def test_the_copy_stays_when_the_first_lets_its_handles_go(pulled, what):
    activate(pulled)
    bpy.ops.object.duplicate()
    copy = bpy.context.view_layer.objects.active
    copy.matrix_world = Matrix.Translation((5, 1, 2)) @ Matrix.Rotation(1, 4, 'Z')
    update()
    before, empty = evaluated(copy), copy.detail_deform.handles[0].target
    activate(pulled)
    pulled.detail_deform.handle_index = 0
    if what == 'all':
        assert bpy.ops.object.detail_deform_remove() == {'FINISHED'}
    else:
        assert bpy.ops.object.detail_deform_handle_remove() == {'FINISHED'}
    update()
    bpy.context.scene.frame_set(2)
    assert np.abs(evaluated(copy) - before).max() < 1e-4
    empty.matrix_world = Matrix.Translation((0, 0, 0.1)) @ empty.matrix_world
    update()
    assert np.allclose((evaluated(copy) - before)[own(copy)[:, 0] > 0.8, 2], 0.1, atol=0.02)


def test_two_objects_that_were_given_one_empty_follow_it_from_where_each_stands():
    one, two = make_strip(name="One"), make_strip(name="Two")
    two.detail_deform.handles[0].target = one.detail_deform.handles[0].target
    bind(one)
    bind(two)
    assert "Its empties" not in one.detail_deform.status + two.detail_deform.status
    two.location.z += 1
    update()
    assert np.allclose((evaluated(two) - own(two))[members(two, 'right')], (0, 0, -1), atol=1e-5)
    assert np.abs(evaluated(one) - own(one)).max() < 1e-6


# ---- loose parts within a reach

def parts():
    """Two bumpy strips side by side, the second narrower."""
    ob = make_strip()
    points, faces = own(ob), [list(face.vertices) for face in ob.data.polygons]
    mesh = bpy.data.meshes.new("Parts")
    mesh.from_pydata([*points.tolist(), *(points * (1, 0.3, 1) + (0, 2, 0)).tolist()], [],
                     [*faces, *([v + len(points) for v in face] for face in faces)])
    ob.data = mesh
    ob.detail_deform.handles.clear()
    ob.vertex_groups.clear()
    ob.detail_deform.region = ""
    update()
    return activate(ob)


@pytest.mark.parametrize('radius, is_said', [(0.3, False), (5.0, True)])
@pytest.mark.parametrize('has_reach', [False, True])
def test_a_region_or_reach_that_holds_a_whole_loose_part_is_said(has_reach, radius, is_said):
    ob = parts()
    if has_reach:  # of the handle that is pulled next, because the first handle has the region
        pull(ob, (own(ob)[:, 1] < 1.1) & (own(ob)[:, 0] > 0.9), radius=0.3)
    chosen = (own(ob)[:, 1] > 1.9) & (own(ob)[:, 0] > 0.9)
    empty = pull(ob, chosen, radius=radius)
    assert bool(ob.detail_deform.handles[-1].reach) == has_reach
    assert ("moves as a whole" in ob.detail_deform.status) == is_said
    empty.location.z += 0.2
    update()
    moved = (evaluated(ob) - own(ob))[own(ob)[:, 1] > 1.9, 2]
    assert (moved.min() > 0.19) == is_said


def test_a_part_with_two_handles_bends_and_nothing_is_said():
    ob = parts()
    for low, high in ((0.9, 2), (-1, 0.1)):
        x = own(ob)[:, 0]
        pull(ob, (own(ob)[:, 1] > 1.9) & (x > low) & (x < high), radius=5.0)
    assert "moves as a whole" not in ob.detail_deform.status
