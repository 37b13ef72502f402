# SPDX-License-Identifier: GPL-3.0-or-later
"""Pull with the brush, in Sculpt Mode. The sculpt is a wavy grid of 61 × 61 vertices over the square from -1 to 1."""

import itertools

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

from conftest import activate, bind, evaluated, group, members, moved, own, refusal, rigid_motion, symmetric, update
from multires import make_sculpt
from rigs import make_rigged

SIDE = 61


def make_grid(name="Sculpt", relief=0.03):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=SIDE - 1, y_subdivisions=SIDE - 1, size=2)
    ob = bpy.context.active_object
    ob.name = name
    points = own(ob)
    points[:, 2] = relief * np.sin(23 * points[:, 0]) * np.cos(19 * points[:, 1])
    ob.data.vertices.foreach_set('co', points.astype(np.float32).ravel())
    ob.data.update()
    return enter(ob)


def enter(ob):
    activate(ob)
    bpy.ops.object.mode_set(mode='SCULPT')
    return ob


def brush(point, offset, radius, **options):
    result = bpy.ops.object.detail_deform_brush_pull(point=point, offset=offset, radius=radius, **options)
    update()
    return result


def nearest(points, point):
    return int(np.linalg.norm(points - point, axis=1).argmin())


def lengths(ob):
    """(n,): how far each vertex is displayed from where the mesh has it."""
    return np.linalg.norm(evaluated(ob) - own(ob), axis=1)


def put(mesh, name, kind, domain, values):
    """Stores what Sculpt Mode keeps, as it does; its operators need a window."""
    if name == '.sculpt_mask' and bpy.app.version < (4, 1):
        bpy.ops.object.mode_set(mode='OBJECT')
        content = bmesh.new()
        content.from_mesh(mesh)
        layer = content.verts.layers.paint_mask.verify()
        for vertex, value in zip(content.verts, values.tolist()):
            vertex[layer] = value
        content.to_mesh(mesh)
        bpy.ops.object.mode_set(mode='SCULPT')
        return
    attribute = mesh.attributes.get(name) or mesh.attributes.new(name, kind, domain)
    attribute.data.foreach_set('value', values)


# What a drag does

def test_a_drag_moves_what_is_under_the_brush_and_nothing_beyond_the_radius():
    ob = make_grid(relief=0.0)
    rest = own(ob)
    point, offset, radius = np.array([0.2, -0.1, 0.0]), np.array([0.05, 0.1, 0.3]), 0.5
    assert brush(point, offset, radius, handle_size=0.3) == {'FINISHED'}
    assert ob.mode == 'SCULPT' and bpy.context.active_object == ob, "Sculpt Mode is not left"
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    assert np.array_equal(own(ob), rest), "the mesh's own vertices are unchanged"
    away, change = np.linalg.norm(rest - rest[nearest(rest, point)], axis=1), evaluated(ob) - rest
    held = members(ob, ob.detail_deform.handles[0].vertex_group)
    assert held[away < 0.9 * 0.3 * radius].all() and not held[away > 1.01 * 0.3 * radius].any()
    assert held.sum() > 50 and np.abs(change[held] - offset).max() < 1e-5
    assert not change[away > radius].any()
    between = (away > 0.3 * radius + 0.05) & (away < radius - 0.1)
    assert (np.linalg.norm(change[between], axis=1) > 1e-3).all()
    # On a plane distances over the surface are those in space, to a few percent of the radius.
    reach = members(ob, ob.detail_deform.handles[0].reach)
    assert reach[away < 0.9 * radius].all() and not reach[away > 1.01 * radius].any()


def test_it_is_the_same_as_a_handle_and_a_reach_by_hand():
    """Computed another way: the groups by their definition, on a copy that is bound step by step."""
    ob = make_grid()
    brush((0, 0, 0), (0, 0.1, 0.3), 0.5)
    shown, handle = evaluated(ob), ob.detail_deform.handles[0]
    held, reach = members(ob, handle.vertex_group), members(ob, handle.reach)
    bpy.ops.object.mode_set(mode='OBJECT')
    other = make_grid("By Hand")
    bpy.ops.object.mode_set(mode='OBJECT')
    group(other, "held", np.flatnonzero(held))
    group(other, "reach", np.flatnonzero(reach))
    bpy.ops.object.detail_deform_handle_add(vertex_group="held")
    other.detail_deform.handles[0].reach = "reach"
    bind(other)
    other.detail_deform.handles[0].target.location += Vector((0, 0.1, 0.3))
    update()
    assert np.abs(evaluated(other) - shown).max() < 1e-6


def test_a_drag_on_a_handle_moves_that_one():
    ob = make_grid()
    brush((0, 0, 0), (0, 0, 0.3), 0.5)
    brush((0, 0, 0.3), (0.1, 0, 0), 0.2)
    assert len(ob.detail_deform.handles) == 1
    rest = own(ob)
    middle = nearest(rest, (0, 0, 0))
    assert np.allclose(evaluated(ob)[middle] - rest[middle], (0.1, 0, 0.3), atol=1e-5)


def test_each_further_drag_starts_from_what_is_displayed():
    ob = make_grid()
    brush((-0.5, 0, 0), (0, 0, 0.4), 0.3)
    first = evaluated(ob)
    brush((0.5, 0, 0), (0, 0, 0.4), 0.3)
    assert len(ob.detail_deform.handles) == 2
    now, left = evaluated(ob), own(ob)[:, 0] < 0
    assert np.abs(now - first)[left].max() < 1e-6 and np.abs(now - first)[~left].max() > 0.39


def test_a_brush_smaller_than_a_face_pulls_a_vertex_with_its_neighbours():
    ob = make_grid()
    brush((0, 0, 0), (0, 0, 0.2), 1e-4)
    middle = nearest(own(ob), (0, 0, 0))
    change, away = lengths(ob), np.linalg.norm(own(ob)[:, :2] - own(ob)[middle, :2], axis=1)
    assert ob.detail_deform.is_bound and abs(change[middle] - 0.2) < 1e-5
    assert not change[away > 1.5 * 2 / (SIDE - 1)].any()


@pytest.mark.parametrize('turns', ['TARGET', 'FREE'])
def test_its_settings_are_those_of_the_handle(turns):
    ob = make_grid()
    brush((0, 0, 0), (0, 0, 0.2), 0.4, turns=turns, falloff='SHARP')
    assert (ob.detail_deform.handles[0].turns, ob.detail_deform.handles[0].falloff) == (turns, 'SHARP')
    assert ob.detail_deform.is_bound, ob.detail_deform.status


def test_of_an_object_with_a_transform_radius_and_offset_are_the_worlds():
    ob = make_grid(relief=0.0)
    ob.matrix_world = (Matrix.Translation((3, -2, 5)) @ Matrix.Rotation(0.8, 4, (1, 2, 3))
                       @ Matrix.Diagonal((2, 2, 2, 1)))
    update()
    rest, world = own(ob), np.array(ob.matrix_world)
    place, offset = world[:3, :3] @ (0.2, 0.1, 0) + world[:3, 3], np.array([0.1, 0.2, 0.3])
    brush(place, offset, 0.8)
    change = (evaluated(ob) - rest) @ world[:3, :3].T
    middle = nearest(rest, (0.2, 0.1, 0))
    assert np.abs(change[middle] - offset).max() < 1e-5
    away = 2 * np.linalg.norm(rest - rest[middle], axis=1)
    assert not change[away > 0.8].any() and (np.linalg.norm(change[away < 0.6], axis=1) > 1e-3).all()


def test_where_an_armature_poses_the_mesh_the_brush_is_where_it_is_seen():
    ob = make_rigged()[0]
    bpy.context.scene.frame_set(11)
    update()
    shown, rest = evaluated(ob), own(ob)
    vertex = nearest(rest, (2.5, 0, 0.2))
    assert np.linalg.norm(shown[vertex] - rest[vertex]) > 0.5
    enter(ob)
    offset = np.array([0.3, 0.0, 0.2])
    brush(shown[vertex], offset, 0.6)
    assert np.abs(evaluated(ob)[vertex] - shown[vertex] - offset).max() < 1e-3
    held = members(ob, ob.detail_deform.handles[0].vertex_group)
    assert held[vertex] and np.abs(rest[held] - rest[vertex]).max() < 0.3


# What stays

@pytest.mark.parametrize('what', ['masked', 'hidden'])
def test_what_is_masked_or_hidden_stays(what):
    ob = make_grid()
    rest = own(ob)
    stays = rest[:, 0] > 0.1
    if what == 'masked':
        put(ob.data, '.sculpt_mask', 'FLOAT', 'POINT', np.where(stays, 0.8, 0.2))
    else:
        put(ob.data, '.hide_vert', 'BOOLEAN', 'POINT', stays)
    brush((0, 0, 0), (0, 0, 0.3), 0.5)
    change = lengths(ob)
    assert not change[stays].any()
    near = ~stays & (np.linalg.norm(rest, axis=1) < 0.3)
    assert change[near].min() > 1e-3
    assert "masked" in refusal(bpy.ops.object.detail_deform_brush_pull, point=(0.5, 0, 0), radius=0.3)
    assert len(ob.detail_deform.handles) == 1


def test_a_region_of_the_users_own_limits_it():
    ob = make_grid()
    group(ob, "mine", np.flatnonzero(own(ob)[:, 1] < 0.05))
    ob.detail_deform.region = "mine"
    brush((0, 0, 0), (0, 0, 0.3), 0.5)
    change = lengths(ob)
    assert not change[~members(ob, "mine")].any() and change[members(ob, "mine")].max() > 0.2
    assert ob.detail_deform.region == "mine"
    assert "region, 'mine'" in refusal(bpy.ops.object.detail_deform_brush_pull, point=(0, 0.5, 0), radius=0.3)
    assert len(ob.detail_deform.handles) == 1 and ob.detail_deform.is_bound


def test_a_pull_in_edit_mode_goes_on_from_there():
    ob = make_grid()
    brush((-0.5, 0, 0), (0, 0, 0.3), 0.3)
    shown = evaluated(ob)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='DESELECT')
    bpy.ops.object.mode_set(mode='OBJECT')
    chosen = np.zeros(len(shown), bool)
    chosen[nearest(own(ob), (0.5, 0, 0))] = True
    ob.data.vertices.foreach_set('select', chosen)
    bpy.ops.object.mode_set(mode='EDIT')
    assert bpy.ops.object.detail_deform_pull(radius=0.3) == {'FINISHED'}
    update()
    assert np.abs(evaluated(ob) - shown).max() < 1e-6
    assert not ob.detail_deform.region and all(handle.reach for handle in ob.detail_deform.handles)


# Face sets and symmetry

def test_a_face_set_is_moved_as_one_piece():
    ob = make_grid()
    rest = own(ob)
    corners = np.array([polygon.vertices[:] for polygon in ob.data.polygons])
    inside = (np.abs(rest[corners]).max(axis=(1, 2)) < 0.3)
    put(ob.data, '.sculpt_face_set', 'INT', 'FACE', np.where(inside, 7, 1).astype(np.int32))
    brush((0.1, 0.1, 0), (0.1, 0, 0.3), 0.4, hold='FACE_SET')
    held = np.zeros(len(rest), bool)
    held[corners[inside]] = True
    assert (members(ob, ob.detail_deform.handles[0].vertex_group) == held).all()
    change = evaluated(ob) - rest
    assert np.abs(change[held] - (0.1, 0, 0.3)).max() < 1e-5
    away = np.linalg.norm(np.maximum(np.abs(rest[:, :2]) - 0.3, 0), axis=1)
    assert not change[away > 0.45].any() and np.linalg.norm(change[~held & (away < 0.2)], axis=1).min() > 1e-3


def test_the_symmetry_pulls_the_other_side_too():
    ob = enter(symmetric())
    ob.data.use_mirror_x = True
    rest = own(ob)
    size = np.ptp(rest[:, 0])
    place = rest[nearest(rest, (0.3 * size, 0, 0))]
    brush(place, (0.1 * size, 0, 0.2 * size), 0.2 * size)
    change = evaluated(ob) - rest
    image = [nearest(rest, point * (-1, 1, 1)) for point in rest]
    assert np.abs(change[image] * (-1, 1, 1) - change).max() < 1e-5 * size
    assert np.linalg.norm(change[nearest(rest, place * (-1, 1, 1))]) > 0.2 * size


def test_on_a_mesh_that_is_not_symmetric_vertex_by_vertex_it_is_so_in_space():
    ob = make_grid()
    points = own(ob)
    points[:, 0] += np.where(points[:, 0] > 0, 0.012 * np.sin(9 * points[:, 1]), 0)  # a third of an edge
    ob.data.vertices.foreach_set('co', points.astype(np.float32).ravel())
    ob.data.use_mirror_x = True
    brush((0.5, 0.1, 0), (0.1, 0, 0.3), 0.3)
    change = evaluated(ob) - points
    left, right = nearest(points, (-0.5, 0.1, 0)), nearest(points, (0.5, 0.1, 0))
    assert np.allclose(change[right], (0.1, 0, 0.3), atol=1e-5)
    assert np.allclose(change[left], (-0.1, 0, 0.3), atol=1e-5)
    # A drag of the image moves both.
    brush(evaluated(ob)[left], (0, 0, 0.1), 0.3)
    assert len(ob.detail_deform.handles) == 2
    assert np.allclose(evaluated(ob)[[left, right], 2] - points[[left, right], 2], 0.4, atol=1e-5)


def test_on_the_plane_of_symmetry_it_stays_on_it():
    ob = make_grid()
    ob.data.use_mirror_x = True
    brush((0, 0, 0), (0.2, 0, 0.3), 0.4)
    middle = nearest(own(ob), (0, 0, 0))
    assert np.allclose(evaluated(ob)[middle] - own(ob)[middle], (0, 0, 0.3), atol=1e-5)


def test_the_other_side_of_an_earlier_handle_is_left_and_told():
    ob = make_grid()
    brush((-0.5, 0, 0), (0, 0, 0.3), 0.3)
    shown = evaluated(ob)
    ob.data.use_mirror_x = True
    brush((0.5, 0, 0), (0, 0, 0.3), 0.3)
    left = own(ob)[:, 0] < 0
    assert len(ob.detail_deform.handles) == 2 and np.abs(evaluated(ob) - shown)[left].max() < 1e-6


def test_the_image_has_the_mirrored_vertices_where_the_mesh_has_them():
    ob = make_grid(relief=0.0)
    ob.data.use_mirror_x = True
    rest = own(ob)
    for x in (0.15, 0.5):
        brush((x, 0.1, 0), (0, 0, 0.3), 0.4)
        mine, image = (members(ob, handle.vertex_group) for handle in list(ob.detail_deform.handles)[-2:])
        mirrored = {tuple(np.round(point * (-1, 1), 4)) for point in rest[mine, :2]}
        assert {tuple(point) for point in np.round(rest[image, :2], 4)} == mirrored
        assert bpy.ops.object.detail_deform_apply(remove_handles=True) == {'FINISHED'}


def test_a_second_pull_on_the_plane_stays_on_it():
    ob = make_grid()
    ob.data.use_mirror_x = True
    brush((0.7, 0.7, 0), (0, 0, 0.2), 0.2)
    brush((0, -0.5, 0), (0.1, 0, 0.3), 0.3)
    middle = nearest(own(ob), (0, -0.5, 0))
    assert np.allclose(evaluated(ob)[middle] - own(ob)[middle], (0, 0, 0.3), atol=1e-5)


def test_with_two_axes_an_image_keeps_the_other_symmetry(capfd):
    ob = make_grid()
    ob.data.use_mirror_x = ob.data.use_mirror_y = True
    brush((0, 0.5, 0), (0.1, 0, 0.3), 0.3)
    for y in (0.5, -0.5):
        middle = nearest(own(ob), (0, y, 0))
        assert np.allclose(evaluated(ob)[middle] - own(ob)[middle], (0, 0, 0.3), atol=1e-5)
    assert "several axes" in capfd.readouterr().out


def test_what_lies_between_a_handle_and_its_image_goes_where_it_is_dragged():
    ob = make_grid()
    ob.data.use_mirror_y = True
    brush((-0.3, 0.08, 0), (0, 0, 0.3), 0.5)
    shown, middle = evaluated(ob), nearest(own(ob), (-0.3, 0, 0))
    brush(shown[middle], (0.1, 0, 0), 0.5)
    assert np.allclose(evaluated(ob)[middle] - shown[middle], (0.1, 0, 0), atol=1e-5)


def test_what_is_masked_on_the_other_side_stays():
    ob = make_grid()
    rest = own(ob)
    stays = rest[:, 0] < -0.1
    put(ob.data, '.sculpt_mask', 'FLOAT', 'POINT', stays.astype(float))
    corners = np.array([polygon.vertices[:] for polygon in ob.data.polygons])
    put(ob.data, '.sculpt_face_set', 'INT', 'FACE',
        np.where(np.abs(rest[corners] - (0.5, 0, 0)).max(axis=(1, 2)) < 0.2, 2, 1).astype(np.int32))
    ob.data.use_mirror_x = True
    for hold in ('FACE_SET', 'BRUSH'):
        brush((0.5, 0, 0), (0, 0, 0.3), 0.3, hold=hold)
        change = lengths(ob)
        assert not change[stays].any() and change.max() > 0.29
        bpy.ops.object.detail_deform_remove()


def test_a_handle_of_what_was_masked_since_is_not_moved():
    ob = make_grid()
    brush((0, 0, 0), (0, 0, 0.3), 0.5)
    shown = evaluated(ob)
    put(ob.data, '.sculpt_mask', 'FLOAT', 'POINT', (own(ob)[:, 0] > 0.2).astype(float))
    assert "masked" in refusal(bpy.ops.object.detail_deform_brush_pull, point=(0, 0, 0.3), radius=0.5)
    assert np.abs(evaluated(ob) - shown).max() < 1e-6


def test_handles_side_by_side_do_not_tear():
    """The handle is smaller beside another one, and beside what stays: no edge is stretched by most of the motion."""
    ob = make_grid()
    brush((0, 0, 0), (0, 0, 0.3), 0.5, handle_size=0.5)
    held = members(ob, ob.detail_deform.handles[0].vertex_group)
    shown = evaluated(ob)
    beside = own(ob)[held, 0].max() + 0.1
    place = nearest(own(ob), (beside, 0, 0))
    brush(shown[place], (0, 0, 0.3), 0.5, handle_size=0.5)
    new = members(ob, ob.detail_deform.handles[1].vertex_group)
    assert new[place] and not (new & held).any()
    edges = np.array([edge.vertices[:] for edge in ob.data.edges])
    change = evaluated(ob) - shown
    assert np.abs(change[edges[:, 0]] - change[edges[:, 1]]).max() < 0.2


# Reaches that are shared

def test_another_radius_while_handles_share_a_reach(part):
    ob = make_grid()
    brush((-0.3, 0, 0), (0, 0, 0.3), 0.3)
    first, shown = members(ob, "Reach"), evaluated(ob)
    brushes = part('setup.brush_pulling')
    surface = brushes.BrushedSurface(ob)
    grip = brushes.grip(ob, surface, nearest(own(ob), (0.3, 0, 0)), 0, 0.1, False)
    pulled = brushes.BrushPull(bpy.context, ob, grip, 0.9, 'MESH', 'TARGET')
    for _ in pulled.stages(wait=True):
        pass

    def change_radius(radius):
        pulled.change_radius(radius)
        part('follow.lifecycle').wait(ob, bpy.context.evaluated_depsgraph_get())
        update()

    assert len({handle.reach for handle in ob.detail_deform.handles}) == 1, "they share it"
    change_radius(1.0)
    assert ob.detail_deform.is_bound and members(ob, "Reach").sum() > first.sum()
    change_radius(0.25)
    assert ob.detail_deform.is_bound and (members(ob, "Reach") == first).all()
    assert len({handle.reach for handle in ob.detail_deform.handles}) == 2, "and share it no more"
    assert np.abs(evaluated(ob) - shown).max() < 1e-6
    pulled.undo()
    update()
    assert len(ob.detail_deform.handles) == 1 and len(ob.vertex_groups) == 2 and ob.detail_deform.is_bound
    assert (members(ob, "Reach") == first).all() and np.abs(evaluated(ob) - shown).max() < 1e-6


@pytest.mark.parametrize('end', ['apply', 'remove'])
def test_no_group_is_left_of_reaches_that_have_become_one(end):
    ob = make_grid()
    for x in (-0.6, 0.6):
        brush((x, 0, 0), (0, 0, 0.2), 0.2)
    brush((0, 0, 0), (0, 0, 0.2), 0.8)
    assert len({handle.reach for handle in ob.detail_deform.handles}) == 1
    if end == 'apply':
        bpy.ops.object.detail_deform_apply(remove_handles=True)
    else:
        bpy.ops.object.detail_deform_remove()
    assert not ob.vertex_groups


# Apply

def test_apply_keeps_masks_face_sets_and_colours():
    ob = make_grid()
    rest = own(ob)
    put(ob.data, '.sculpt_mask', 'FLOAT', 'POINT', np.where(rest[:, 0] > 0.5, 1.0, 0.1))
    put(ob.data, '.sculpt_face_set', 'INT', 'FACE', np.arange(len(ob.data.polygons), dtype=np.int32) % 5 + 1)
    colours = ob.data.color_attributes.new("Colour", 'FLOAT_COLOR', 'POINT')
    colours.data.foreach_set('color', np.tile(np.linspace(0, 1, len(rest)), (4, 1)).T.ravel())
    brush((0, 0, 0), (0, 0, 0.3), 0.5)
    kept, shown = _sculpted(ob), evaluated(ob)
    assert bpy.ops.object.detail_deform_apply(remove_handles=True) == {'FINISHED'}
    assert ob.mode == 'SCULPT' and np.abs(own(ob) - shown).max() < 1e-6
    assert all(np.array_equal(*both) for both in zip(kept, _sculpted(ob)))
    assert not (ob.modifiers or ob.vertex_groups or ob.detail_deform.handles or ob.detail_deform.region)
    assert not [other for other in bpy.data.objects if other.type == 'EMPTY']


def _sculpted(ob):
    """[values]: mask, face sets and colours."""
    mask = ob.data.attributes.get('.sculpt_mask') or ob.data.vertex_paint_masks[0]
    found = []
    for layer, field, size, kind in ((mask, 'value', 1, np.float32),
                                     (ob.data.attributes['.sculpt_face_set'], 'value', 1, np.int32),
                                     (ob.data.color_attributes["Colour"], 'color', 4, np.float32)):
        found.append(np.empty(size * len(layer.data), kind))
        layer.data.foreach_get(field, found[-1])
    return found


def test_a_pull_may_become_part_of_the_sculpt_at_once():
    ob = make_grid()
    rest = own(ob)
    for _ in range(2):
        brush((0, 0, own(ob)[nearest(rest, (0, 0, 0)), 2]), (0, 0, 0.2), 0.4, apply=True)
        assert not (ob.modifiers or ob.vertex_groups or ob.detail_deform.handles) and ob.mode == 'SCULPT'
    middle = nearest(rest, (0, 0, 0))
    assert np.allclose(own(ob)[middle] - rest[middle], (0, 0, 0.4), atol=1e-5)


def test_with_other_handles_there_it_stays_a_handle():
    ob = make_grid()
    brush((-0.5, 0, 0), (0, 0, 0.2), 0.3)
    brush((0.5, 0, 0), (0, 0, 0.2), 0.3, apply=True)
    assert len(ob.detail_deform.handles) == 2 and moved(ob) > 0.19


def test_apply_keeps_the_levels_of_multires():
    ob = enter(make_sculpt())
    for index in reversed(range(len(ob.detail_deform.handles))):
        ob.detail_deform.handles.remove(index)
    ob.detail_deform.region = ""
    brush((0.5, 0.5, 0), (0, 0, 0.2), 0.4)
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    shown = evaluated(ob)
    bpy.ops.object.mode_set(mode='SCULPT')
    assert bpy.ops.object.detail_deform_apply(remove_handles=True) == {'FINISHED'}
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert ob.modifiers["Multires"].total_levels == 3 and np.abs(evaluated(ob) - shown).max() < 1e-5


# After an edit, and bad input

def test_a_handle_of_an_edited_mesh_is_bound_again_when_it_is_dragged():
    ob = make_grid()
    brush((0, 0, 0), (0, 0, 0.3), 0.5)
    points = own(ob)
    points[points[:, 0] > 0.8, 2] += 0.1  # as a stroke does
    ob.data.vertices.foreach_set('co', points.astype(np.float32).ravel())
    ob.data.update()
    update()
    brush((0, 0, 0.3), (0, 0, 0.1), 0.5)
    middle = nearest(points, (0, 0, 0))
    assert len(ob.detail_deform.handles) == 1 and not ob.detail_deform.stale
    assert np.allclose(evaluated(ob)[middle] - points[middle], (0, 0, 0.4), atol=1e-5)


def test_a_handle_that_is_not_bound_any_more_is_bound_and_dragged():
    ob = make_grid()
    brush((0, 0, 0), (0, 0, 0.3), 0.5)
    bpy.ops.object.detail_deform_unbind()
    brush((0, 0, 0), (0, 0, 0.1), 0.5)
    middle = nearest(own(ob), (0, 0, 0))
    assert len(ob.detail_deform.handles) == 1 and ob.detail_deform.is_bound
    assert np.allclose(evaluated(ob)[middle] - own(ob)[middle], (0, 0, 0.1), atol=1e-5)


def test_handles_that_the_brush_cannot_move_are_told():
    ob = make_grid()
    brush((0, 0, 0), (0, 0, 0), 0.5)
    pull = bpy.ops.object.detail_deform_brush_pull
    sets = np.ones(len(ob.data.polygons), np.int32)
    put(ob.data, '.sculpt_face_set', 'INT', 'FACE', sets)
    assert "another handle" in refusal(pull, point=(0.8, 0.8, 0), radius=0.1, hold='FACE_SET')
    ob.modifiers["Detail Deform"].show_viewport = False
    assert "hidden" in refusal(pull, point=(0.8, 0.8, 0), radius=0.1)
    ob.modifiers["Detail Deform"].show_viewport = True
    bpy.data.objects.remove(ob.detail_deform.handles[0].target)
    update()
    assert "Bring Back Empties" in refusal(pull, point=(0, 0, 0), radius=0.5)
    assert len(ob.detail_deform.handles) == 1


def test_one_vertex_that_is_no_number_does_not_hide_the_others():
    ob = make_grid()
    points = own(ob)
    points[5] = np.nan
    ob.data.vertices.foreach_set('co', points.astype(np.float32).ravel())
    brush((0, 0, 0), (0, 0, 0.2), 0.3)
    middle = nearest(np.nan_to_num(points, nan=9), (0, 0, 0))
    assert np.allclose(evaluated(ob)[middle] - points[middle], (0, 0, 0.2), atol=1e-5)


def test_bad_input_is_refused_by_a_sentence_and_changes_nothing():
    ob = make_grid()
    pull = bpy.ops.object.detail_deform_brush_pull
    assert "radius" in refusal(pull, point=(0, 0, 0))
    bpy.ops.object.mode_set(mode='OBJECT')
    with pytest.raises(RuntimeError, match="Sculpt Mode"):
        pull(point=(0, 0, 0), radius=1.0)
    ob.data.clear_geometry()
    ob.data.from_pydata([(0, 0, 0), (1, 0, 0)], [(0, 1)], [])
    enter(ob)
    assert "no faces" in refusal(pull, point=(0, 0, 0), radius=1.0)
    assert not (ob.modifiers or ob.vertex_groups or ob.detail_deform.handles)


def test_dynamic_topology_is_refused(part, monkeypatch):
    class Sculpted:
        name, use_dynamic_topology_sculpting = "Clay", True
    with pytest.raises(part('scene.mesh_data').MeshProblem, match="Dyntopo"):
        part('scene.sculpted').check(Sculpted)


# Searches, against others

def test_the_triangle_under_a_ray_is_that_of_blenders_search_tree(part):
    hit = part('scene.picking').hit
    ob = make_grid(relief=0.2)
    points = own(ob).astype(np.float32)
    ob.data.calc_loop_triangles()
    triangles = np.array([triangle.vertices[:] for triangle in ob.data.loop_triangles], np.int32)
    tree = BVHTree.FromPolygons(points.tolist(), triangles.tolist())
    random, hits = np.random.default_rng(5), 0
    for _ in range(300):
        origin, aim = random.normal(size=3), random.uniform(-1.2, 1.2, 3) * (1, 1, 0.1)
        place, _, triangle, _ = tree.ray_cast(Vector(origin), Vector(aim - origin))
        found = hit(points, triangles, origin, aim - origin)
        assert (found is None) == (place is None)
        if found is None:
            continue
        hits += 1
        assert np.abs(found.point - place).max() < 1e-5
        assert found.triangle == triangle or np.abs(found.point - place).max() < 1e-6
        corners = points[triangles[found.triangle]]
        assert found.vertex in triangles[found.triangle] and len(corners) == 3
    assert hits > 100


def test_a_line_is_met_first_where_it_comes_from(part):
    hit = part('scene.picking').hit
    layers = [[(-1, -1, z), (1, -1, z), (0, 1, z)] for z in (0.0, 1.0, 2.0)]
    points, triangles = np.float32(list(itertools.chain(*layers))), np.arange(9).reshape(3, 3)
    assert hit(points, triangles, (0, 0, 1.5), (0, 0, -1)).triangle == 1
    assert hit(points, triangles, (0, 0, 1.5), (0, 0, -1), both_ways=True).triangle == 2
    assert hit(points, triangles, (0, 0, 1.5), (0, 0, 1), both_ways=True).triangle == 0
    assert hit(points, triangles, (5, 0, 1.5), (0, 0, 1), both_ways=True) is None


def test_distances_around_the_brush_are_those_over_the_whole_surface(part):
    """The brush searches a part of the mesh only; the whole mesh is searched by the library."""
    ob = make_grid(relief=0.1)
    surface = part('setup.brush_pulling').BrushedSurface(ob)
    for chosen in (0, 1830, 3000):
        start = np.arange(len(surface.local)) == chosen
        whole = part('library.native').distances(surface.local, surface.triangles, start)
        for limit in (0.05, 0.3, 1.0):
            assert (surface.within([chosen], limit) == (whole <= limit)).all()


def test_a_pulled_patch_keeps_its_relief():
    """What the method is for: within the handle the relief is moved as one piece, and it is only turned around it."""
    ob = make_grid()
    brush((0, 0, 0), (0.2, 0, 0.4), 0.6, turns='FREE', handle_size=0.2)
    rest, now = own(ob), evaluated(ob)
    held = members(ob, ob.detail_deform.handles[0].vertex_group)
    assert np.abs(rigid_motion(rest[held], now[held])[1]).max() < 1e-3
