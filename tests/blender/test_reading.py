# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read of a mesh all at once is what Blender says of each item, in any mode; Bind reads it once, and writes
what has become another thing."""

import bpy
import numpy as np
import pytest
from conftest import activate, add_handle, bind, evaluated, group, make_strip, moved, update


def mixed():
    """Triangles, quads and a larger face, a loose edge and a loose vertex; with shape keys."""
    points = [(x, y, 0.1 * x * y) for y in range(3) for x in range(4)] + [(5, 0, 1), (5, 1, 1), (6, 0, 2)]
    faces = [(0, 1, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 7, 11, 10, 6), (4, 5, 9, 8)]
    mesh = bpy.data.meshes.new("Mixed")
    mesh.from_pydata(points, [(12, 13)], faces)
    ob = bpy.data.objects.new("Mixed", mesh)
    bpy.context.scene.collection.objects.link(ob)
    ob.shape_key_add(name="Basis")
    ob.shape_key_add(name="Up").data[3].co.z += 1
    update()
    return activate(ob)


def check(mesh, mesh_data):
    corners, starts = mesh_data.faces(mesh)
    assert corners.tolist() == [loop.vertex_index for loop in mesh.loops]
    assert starts.tolist() == [face.loop_start for face in mesh.polygons]
    assert mesh_data.edges(mesh).tolist() == [list(edge.vertices) for edge in mesh.edges]
    assert mesh_data.triangles(mesh).tolist() == [list(triangle.vertices) for triangle in mesh.loop_triangles]
    assert {array.dtype for array in (corners, starts, mesh_data.edges(mesh), mesh_data.triangles(mesh))} == {
        np.dtype(np.int32)}
    assert mesh_data.positions(mesh).tolist() == [list(vertex.co) for vertex in mesh.vertices]


def test_meshes_in_any_mode(part):
    mesh_data, ob = part('scene.mesh_data'), mixed()
    check(ob.data, mesh_data)
    bpy.ops.object.mode_set(mode='EDIT')
    check(ob.data, mesh_data)
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.ops.mesh.subdivide()
    check(ob.data, mesh_data)  # as it was, until the edit is taken over
    ob.update_from_editmode()
    assert len(ob.data.vertices) > 15
    check(ob.data, mesh_data)
    bpy.ops.object.mode_set(mode='OBJECT')
    check(ob.data, mesh_data)
    check(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data, mesh_data)


@pytest.mark.parametrize('mode', ['OBJECT', 'EDIT'])
def test_shape_keys(part, mode):
    mesh_data, ob = part('scene.mesh_data'), mixed()
    ob.active_shape_key_index = 1
    bpy.ops.object.mode_set(mode=mode)
    for key in ob.data.shape_keys.key_blocks:
        assert mesh_data.key_positions(key).tolist() == [list(point.co) for point in key.data]


def test_a_mesh_without_anything(part):
    check(bpy.data.meshes.new("Empty"), part('scene.mesh_data'))


@pytest.mark.parametrize('mode', ['OBJECT', 'EDIT'])
def test_groups(part, mode):
    ob = mixed()
    assert [len(values) for values in part('scene.mesh_data').group_entries(ob, [])] == [0, 0, 0]
    for name, members, weight in (("A", (0, 1, 2), 1.0), ("Other", (1, 4), 0.25), ("B", (2, 3), 0.75)):
        ob.vertex_groups.new(name=name).add(members, weight, 'REPLACE')
    bpy.ops.object.mode_set(mode=mode)
    entries = part('scene.mesh_data').group_entries(ob, ["B", "A", "B"])
    assert sorted(zip(*(values.tolist() for values in entries))) == [
        (0, 1, 1.0), (1, 1, 1.0), (2, 0, 0.75), (2, 1, 1.0), (2, 2, 0.75), (3, 0, 0.75), (3, 2, 0.75)]
    assert [len(values) for values in part('scene.mesh_data').group_entries(ob, [])] == [0, 0, 0]


def test_bind_reads_once(part, monkeypatch):
    ob = make_strip()
    ob.shape_key_add(name="Basis")
    ob.shape_key_add(name="Up").data[40].co.z += 0.1
    ob.detail_deform.examples.add().name = "Up"
    bind(ob)
    read = []

    def counting(module, name):
        function = getattr(part(module), name)
        monkeypatch.setattr(part(module), name, lambda *of: read.append(name) or function(*of))
    for place in (('scene.mesh_data', 'group_entries'), ('scene.mesh_data', 'faces'), ('scene.mesh_data', 'triangles'),
                  ('scene.examples', 'positions')):
        counting(*place)
    bind(ob, keep_rest=True)
    assert sorted(read) == ['faces', 'group_entries', 'positions']
    ob.detail_deform.smoothness = 3
    update()
    read.clear()
    bind(ob)
    assert sorted(read) == ['faces', 'group_entries', 'positions', 'triangles']


def test_bound_again_unchanged_the_result_stays():
    """Blender need not evaluate the mesh anew. What isn't the result any more is replaced."""
    ob = bind(make_strip())
    ob.detail_deform.handles[0].target.location.z += 0.3
    update()
    written, shown = ob.data['detail_deform_written'], evaluated(ob)
    bind(ob, keep_rest=True)
    assert ob.data['detail_deform_written'] == written and np.array_equal(evaluated(ob), shown)
    ob.data.attributes['detail_deform_offset'].data[7].vector = (1, 2, 3)
    bind(ob, keep_rest=True)
    assert ob.data['detail_deform_written'] != written and np.array_equal(evaluated(ob), shown)
    bind(ob)
    assert moved(ob) == 0


def test_bound_again_unchanged_the_scene_needs_what_it_needed():
    """What an object depends on is not told anew, as Blender would then find it out for the whole scene."""
    ob = bind(make_strip())
    ob.animation_data.drivers[0].lock = True  # by which it is known again
    bind(ob)
    assert ob.animation_data.drivers[0].lock
    left = bpy.data.objects.new("Left", None)
    bpy.context.scene.collection.objects.link(left)
    group(ob, 'left', range(300, 310))
    add_handle(ob, 'left', left)
    bind(ob)
    (driver,) = ob.animation_data.drivers
    assert [v.targets[0].id for v in driver.driver.variables] == [bpy.data.objects["Right"], left]
