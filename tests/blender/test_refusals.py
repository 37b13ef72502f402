# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad input is refused by a sentence that names it, and the mesh stays untouched."""
import bpy
import numpy as np
import pytest

from conftest import (activate, add_empty, add_handle, bind, evaluated, group, make_strip, members,
                      own, refusal, update)

BIND = bpy.ops.object.detail_deform_bind


def make_mesh(positions, faces, edges=()):
    mesh = bpy.data.meshes.new('Mesh')
    mesh.from_pydata(positions, list(edges), faces)
    ob = bpy.data.objects.new('Mesh', mesh)
    bpy.context.scene.collection.objects.link(ob)
    return activate(ob)


def extended(positions, faces=(), edges=()):
    """The strip with more vertices, faces and edges, all in the region."""
    ob = make_strip()
    n = len(ob.data.vertices)
    old_faces = [tuple(p.vertices) for p in ob.data.polygons]
    old_positions = own(ob).tolist()
    region, right = np.flatnonzero(members(ob, 'region')), np.flatnonzero(members(ob, 'right'))
    mesh = bpy.data.meshes.new('Extended')
    mesh.from_pydata(old_positions + [list(p) for p in positions], list(edges), old_faces + list(faces))
    ob.data = mesh
    ob.vertex_groups.clear()
    group(ob, 'region', [*region, *range(n, n + len(positions))])
    group(ob, 'right', right)
    update()
    return ob, n


def lift(ob, height=0.4):
    ob.detail_deform.handles[0].target.location.z += height
    update()
    return evaluated(ob)


def assert_refused(ob, sentence):
    before = [tuple(v.co) for v in ob.data.vertices]
    groups = [g.name for g in ob.vertex_groups]
    said = refusal(BIND, wait=True)
    assert sentence in said
    assert repr([tuple(v.co) for v in ob.data.vertices]) == repr(before)
    assert [g.name for g in ob.vertex_groups] == groups
    assert 'detail_deform_offset' not in ob.data.attributes
    assert not ob.detail_deform.is_bound


def test_no_region_vertices():
    ob = make_strip()
    ob.vertex_groups['region'].remove(range(625))
    assert_refused(ob, "The region group 'region' has no vertex with a weight over 0.5")


def test_region_group_missing():
    ob = make_strip()
    ob.detail_deform.region = 'nowhere'
    assert_refused(ob, "'nowhere', which 'Strip' does not have")


def test_handle_group_missing_empty_or_not_chosen():
    ob = make_strip()
    handle = ob.detail_deform.handles[0]
    handle.vertex_group = 'gone'
    assert_refused(ob, "Handle 'right' refers to the vertex group 'gone'")
    handle.vertex_group = ''
    assert_refused(ob, "Handle 'right' has no vertex group")
    group(ob, 'hollow', [])
    handle.vertex_group = 'hollow'
    assert_refused(ob, "its group 'hollow' has no vertex with a weight over 0.5")


def test_a_handle_that_loses_all_vertices_to_another():
    ob = make_strip()
    light = group(ob, 'light', [])
    light.add([600, 601], 0.7, 'REPLACE')
    add_handle(ob, 'light', add_empty('Light', (0, 0, 0)))
    assert_refused(ob, "every vertex of its group 'light' has a larger weight in another handle")


@pytest.mark.parametrize('change', [
    lambda of: of.handles.clear(), lambda of: setattr(of.handles[0], 'enabled', False)], ids=['removed', 'disabled'])
def test_no_handle(change):
    ob = make_strip()
    change(ob.detail_deform)
    assert_refused(ob, "There is no handle")


@pytest.mark.parametrize('change', [
    lambda handle: setattr(handle, 'target', None), lambda handle: bpy.data.objects.remove(handle.target)],
    ids=['never chosen', 'deleted'])
def test_handle_without_empty(change):
    ob = make_strip()
    change(ob.detail_deform.handles[0])
    assert_refused(ob, "Handle 'right' has no empty")


def test_empty_outside_the_scene():
    ob = make_strip()
    bpy.context.scene.collection.objects.unlink(ob.detail_deform.handles[0].target)
    update()
    assert_refused(ob, "empty 'Right' is not in this scene")


def test_empty_with_zero_scale():
    ob = make_strip()
    ob.detail_deform.handles[0].target.scale = (0, 0, 0)
    update()
    assert_refused(ob, "Handle 'right': its empty has a scale of zero")


def test_an_empty_with_zero_scale_leaves_the_binding():
    """A new Bind in this pose is refused, as a matrix with a scale of zero is no rest pose."""
    ob = bind(make_strip())
    empty = ob.detail_deform.handles[0].target
    empty.scale = (0, 0, 0)
    update()
    shown = evaluated(ob)
    assert "Handle 'right': its empty has a scale of zero" in refusal(BIND, wait=True)
    assert ob.detail_deform.is_bound and np.abs(evaluated(ob) - shown).max() == 0
    empty.scale = (1, 1, 1)
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6


def test_the_owner_of_a_location_that_is_no_number_is_named():
    ob = bind(make_strip())
    target, shown = ob.detail_deform.handles[0].target, lift(ob)
    for owner, sentence in ((ob, "Object 'Strip' has a location"),
                            (target, "Handle 'right': empty 'Right' has a location")):
        owner.location.x = float('nan')
        update()
        assert sentence in ob.detail_deform.status
        assert np.abs(evaluated(ob) - shown).max() < 1e-6
        owner.location.x = 0 if owner == ob else 1
        update()
        assert ob.detail_deform.is_bound and sentence not in ob.detail_deform.status
        assert np.abs(evaluated(ob) - shown).max() < 1e-6
    target.location.x = float('nan')
    update()
    bpy.ops.object.detail_deform_unbind()
    assert_refused(ob, "Handle 'right': empty 'Right' has a location")
    assert (evaluated(ob) == own(ob)).all()


def test_object_with_zero_scale():
    ob = make_strip()
    ob.scale = (1, 0, 1)
    update()
    assert_refused(ob, "'Strip' has a scale of zero")


def test_no_free_vertex():
    ob = make_strip()
    ob.detail_deform.handles[0].vertex_group = 'region'
    assert_refused(ob, "No vertex is free to follow")


def test_nothing_fixed_and_no_handle_in_a_part():
    ob, first = extended([(3, 0, 0), (4, 0, 0), (3, 1, 0)], [(625, 626, 627)])
    bind(ob)
    status = ob.detail_deform.status
    assert "1 loose part of the region (3 vertices, such as vertex 625) stays at rest" in status
    rest = own(ob)
    moved = lift(ob) - rest
    assert np.abs(moved[first:]).max() == 0
    assert np.isfinite(moved).all() and np.abs(moved).max() > 0.39


def test_edit_mode():
    ob = make_strip()
    bpy.ops.object.mode_set(mode='EDIT')
    try:
        assert "is in Edit Mode" in refusal(BIND, wait=True)
    finally:
        bpy.ops.object.mode_set(mode='OBJECT')
    assert 'detail_deform_offset' not in ob.data.attributes


def test_multi_user_mesh():
    ob = make_strip()
    twin = bpy.data.objects.new('Twin', ob.data)
    bpy.context.scene.collection.objects.link(twin)
    assert_refused(ob, "used by 2 objects")


def test_linked_mesh(tmp_path):
    make_strip()
    path = str(tmp_path / 'library.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_source, target):
        target.meshes = ['Strip']
        target.objects = ['Right']
    ob = bpy.data.objects.new('Local', bpy.data.meshes['Strip'])
    bpy.context.scene.collection.objects.link(ob)
    activate(ob)
    assert "linked from another file" in refusal(BIND, wait=True)


@pytest.mark.parametrize('value, sentence', [
    (float('nan'), "Vertex 311 has a coordinate that is not a finite number"),
    (float('inf'), "Vertex 311 has a coordinate of 3.4")])  # Blender clamps infinity to the largest float
def test_coordinates_that_are_nan_or_infinite(value, sentence):
    ob = make_strip()
    ob.data.vertices[311].co.y = value
    assert_refused(ob, sentence)


def test_no_vertices_and_no_faces():
    ob = make_mesh([], [])
    empty = add_empty('Empty', (0, 0, 0))
    group(ob, 'handle', [])
    add_handle(ob, 'handle', empty)
    assert "has no vertex" in refusal(BIND, wait=True)
    line = make_mesh([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [], [(0, 1), (1, 2)])
    group(line, 'handle', [0])
    add_handle(line, 'handle', empty)
    update()
    assert_refused(line, "has no faces")


def test_loose_vertices_and_edges_stay_and_are_reported():
    ob, first = extended([(0.5, 0.5, 1), (0.6, 0.5, 1), (0.5, 0.5, 2)], edges=[(625, 626)])
    bind(ob)
    assert "3 vertices without faces (such as vertex 625) stay at rest" in ob.detail_deform.status
    moved = lift(ob) - own(ob)
    assert np.abs(moved[first:]).max() == 0 and np.isfinite(moved).all()


def test_triangles_without_area_give_a_finite_result_and_are_reported():
    middle = 12 * 25 + 12
    ob, _ = extended([(0.5, 0.5, 0.1)], [(middle, middle + 1, 625)])
    ob.data.vertices[625].co = ob.data.vertices[middle].co
    update()
    bind(ob)
    assert "next to no area" in ob.detail_deform.status
    moved = lift(ob) - own(ob)
    assert np.isfinite(moved).all() and np.abs(moved).max() < 0.45


def test_non_manifold_edges_give_a_finite_result():
    middle = 12 * 25 + 12
    ob, first = extended([(0.5, 0.52, 0.3), (0.5, 0.52, -0.3)],
                         [(middle, middle + 1, 625), (middle, middle + 1, 626)])
    bind(ob)
    moved = lift(ob) - own(ob)
    assert np.isfinite(moved).all()
    assert 0.1 < moved[first, 2] < 0.4 and 0.1 < moved[first + 1, 2] < 0.4


def test_one_vertex_handles_work():
    ob = make_strip()
    group(ob, 'point', [12 * 25 + 12])
    add_handle(ob, 'point', add_empty('Point', (0.5, 0.5, 0)))
    bind(ob)
    ob.detail_deform.handles[1].target.location.z += 0.1
    update()
    moved = evaluated(ob) - own(ob)
    assert moved[12 * 25 + 12, 2] == pytest.approx(0.1, abs=1e-6)
    assert np.isfinite(moved).all() and np.abs(moved).max() < 0.15


def test_handles_far_out_of_range_are_reported():
    ob = bind(make_strip())
    shown = evaluated(ob)
    ob.detail_deform.handles[0].target.location.z = 3e38
    update()
    assert "Handle 'right' is moved so far that" in ob.detail_deform.status
    assert np.abs(evaluated(ob) - shown).max() < 1e-6
    ob.detail_deform.handles[0].target.location.z = 0.1
    update()
    assert "Bound" in ob.detail_deform.status


def test_library_missing_or_of_another_version(part, monkeypatch, tmp_path):
    ob = make_strip()
    monkeypatch.setattr(part('library.loading'), '_library', None)
    monkeypatch.setenv('DETAIL_DEFORM_LIBRARY', str(tmp_path / 'none.so'))
    assert_refused(ob, "library is missing")
    monkeypatch.delenv('DETAIL_DEFORM_LIBRARY')
    monkeypatch.setattr(part('library.structs'), 'ABI_VERSION', 99)
    assert_refused(ob, "of another version")


def test_binding_from_a_file_without_the_library_is_reported(part, monkeypatch, tmp_path):
    cache = part('follow.handle_follower').cache
    ob = bind(make_strip())
    cache.clear()
    monkeypatch.setattr(part('library.loading'), '_library', None)
    monkeypatch.setenv('DETAIL_DEFORM_LIBRARY', str(tmp_path / 'none.so'))
    ob.detail_deform.handles[0].target.location.z += 0.2
    update()
    assert "library is missing" in ob.detail_deform.status
    monkeypatch.delenv('DETAIL_DEFORM_LIBRARY')
    ob.detail_deform.handles[0].target.location.z += 0.2
    update()
    assert ob.detail_deform.is_bound


def test_wrong_object_types_and_missing_parts_of_operators():
    empty = add_empty('Empty', (0, 0, 0))
    activate(empty)
    for name in ('add', 'remove', 'handle_add', 'handle_remove', 'bind', 'unbind', 'update', 'apply'):
        operator = getattr(bpy.ops.object, f'detail_deform_{name}')
        assert not operator.poll()
    make_strip()
    assert "no vertex group 'nowhere'" in refusal(bpy.ops.object.detail_deform_handle_add, vertex_group='nowhere')
    assert "is not bound" in refusal(bpy.ops.object.detail_deform_update)
    assert "There is no handle 7" in refusal(bpy.ops.object.detail_deform_handle_remove, index=7)


def test_handle_add_in_edit_mode_needs_a_selection():
    ob = make_strip()
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='DESELECT')
    try:
        assert "No vertex is selected" in refusal(bpy.ops.object.detail_deform_handle_add)
    finally:
        bpy.ops.object.mode_set(mode='OBJECT')
    assert len(ob.detail_deform.handles) == 1
