# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh data that is read in bulk equals Blender's data of each element, in any mode. Bind reads it once, and writes
only a changed result."""

import bpy
import numpy as np
import pytest
from conftest import activate, add_handle, bind, evaluated, group, make_strip, moved, update


def mixed():
    """A mesh of triangles, quads, a larger face, a loose edge and a loose vertex, with shape keys."""
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
    check(ob.data, mesh_data)  # the mesh before the edit, until update_from_editmode()
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
    """An unchanged result isn't written again, which would make Blender evaluate the mesh. Offsets that were changed by
    others are replaced."""
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


def test_bound_again_unchanged_the_driver_is_kept():
    """A new driver would make Blender rebuild the dependencies of the whole scene."""
    ob = bind(make_strip())
    ob.animation_data.drivers[0].lock = True  # marks the driver
    bind(ob)
    assert ob.animation_data.drivers[0].lock
    left = bpy.data.objects.new("Left", None)
    bpy.context.scene.collection.objects.link(left)
    group(ob, 'left', range(300, 310))
    add_handle(ob, 'left', left)
    bind(ob)
    (driver,) = ob.animation_data.drivers
    assert [v.targets[0].id for v in driver.driver.variables] == [bpy.data.objects["Right"], left]


# ---- vertex groups read as columns, by geometry nodes

@pytest.fixture
def columns(part, monkeypatch):
    """The module scene.group_columns, made to read meshes of any size by nodes."""
    module = part('scene.group_columns')
    for name in ('_VERTICES_A_GROUP', '_VERTICES_AN_OBJECT'):
        monkeypatch.setattr(module, name, 0)
    return module


def grouped():
    """A hidden, rotated object with shape keys and a modifier that makes vertices. Its groups have unusual names, and
    weights from 0.25 to 1; one is empty."""
    ob = mixed()
    randomness = np.random.default_rng(5)
    for name in ("Region", "Ünïcödé", ".hidden", "with 'quotes' and\\", "position.001", "Empty"):
        group_of = ob.vertex_groups.new(name=name)
        for vertex in range(0 if name == "Empty" else len(ob.data.vertices)):
            if (weight := randomness.choice([None, 0.25, 0.5, 0.5000001, 1.0, randomness.random()])) is not None:
                group_of.add([vertex], weight, 'REPLACE')
    ob.modifiers.new("Subdivision", 'SUBSURF')
    ob.rotation_euler.x = 1
    ob.hide_viewport = True
    return ob


def as_dictionary(entries):
    vertices, places, weights = (values.tolist() for values in entries)
    result = dict(zip(zip(vertices, places), weights))
    assert len(result) == len(vertices)  # no entry is there twice
    return result


def data():
    """Numbers of data-blocks."""
    return [len(getattr(bpy.data, kind)) for kind in ('scenes', 'objects', 'meshes', 'node_groups', 'collections')]


def test_groups_at_once_are_those_of_each_vertex(columns, part, monkeypatch):
    ob, mesh_data = grouped(), part('scene.mesh_data')
    names = [*(name for name in ob.vertex_groups.keys() if name != "Empty"), "Region"]
    expected, before = as_dictionary(mesh_data.group_entries(ob, names)), data()
    monkeypatch.setattr(mesh_data, 'group_entries', None)
    assert as_dictionary(columns.entries(ob, names)) == expected and len(expected) > 40
    # Other groups, in another order, with weights that Blender hasn't evaluated since they were changed.
    ob.vertex_groups["Region"].add([0, 3], 0.875, 'REPLACE')
    ob.vertex_groups["Empty"].add([7], 1.0, 'REPLACE')
    found = as_dictionary(columns.entries(ob, ["Empty", "Region"]))
    assert found[7, 0] == 1 and found[0, 1] == found[3, 1] == 0.875 and sum(place == 0 for _, place in found) == 1
    assert data() == before


# Names of attributes that Blender uses, or used in earlier versions.
@pytest.mark.parametrize('name', ["position", "normal", "id", "index", "radius", "crease", "material_index", "UVMap",
                                  "shade_smooth", "sharp_face", "sharp_edge", ".corner_vert", ".select_vert", "Own"])
@pytest.mark.parametrize('weight', [1.0, 0.3])
def test_groups_with_names_of_attributes(columns, part, name, weight):
    ob, mesh_data = mixed(), part('scene.mesh_data')
    ob.data.uv_layers.new(name="UVMap")
    ob.data.attributes.new("Own", 'FLOAT', 'POINT').data[4].value = 1
    ob.data.materials.append(None)
    ob.data.materials.append(None)
    ob.data.polygons[1].material_index = 1
    group(ob, "Before", [1, 2, 3])
    ob.vertex_groups.new(name="Any").name = name
    name = ob.vertex_groups[-1].name  # some versions change a name that an attribute has
    ob.vertex_groups[name].add([1, 2, 3, 5, 8, 13], weight, 'REPLACE')
    asked = ["Before", name]
    assert as_dictionary(columns.entries(ob, asked)) == as_dictionary(mesh_data.group_entries(ob, asked))


def test_groups_that_nodes_can_not_read_are_read_one_by_one(columns, part, monkeypatch):
    ob, mesh_data = grouped(), part('scene.mesh_data')
    asked, read = [], mesh_data.group_entries
    monkeypatch.setattr(mesh_data, 'group_entries', lambda *of: asked.append(of) or read(*of))
    assert [len(values) for values in columns.entries(ob, [])] == [0, 0, 0]
    assert as_dictionary(columns.entries(ob, ["Region", "Empty"])) == as_dictionary(read(ob, ["Region", "Empty"]))
    ob.hide_viewport = False
    bpy.ops.object.mode_set(mode='EDIT')
    assert as_dictionary(columns.entries(ob, ["Ünïcödé"])) == as_dictionary(read(ob, ["Ünïcödé"]))
    assert len(asked) == 3


def test_groups_at_once_where_it_takes_less(part, monkeypatch):
    """Groups are read one by one where that takes less: for few vertices, in many groups, among many objects, and where
    drivers would be evaluated."""
    columns, ob = part('scene.group_columns'), grouped()
    monkeypatch.setattr(part('scene.mesh_data'), 'group_entries', lambda *_: False)
    monkeypatch.setattr(columns, '_columns', lambda mesh, names: dict.fromkeys(names, (np.zeros(1), np.zeros(1))))
    monkeypatch.setattr(columns, '_is_of', lambda *_: True)

    def is_at_once():
        return columns.entries(ob, ob.vertex_groups.keys()) is not False
    assert not is_at_once()
    monkeypatch.setattr(columns, '_VERTICES_A_GROUP', 1)
    monkeypatch.setattr(columns, '_VERTICES_AN_OBJECT', 0)
    assert is_at_once()
    monkeypatch.setattr(columns, '_VERTICES_AN_OBJECT', len(ob.data.vertices))
    assert not is_at_once()
    monkeypatch.setattr(columns, '_VERTICES_AN_OBJECT', 0)
    glass = bpy.data.materials.new("Glass")
    glass.use_nodes = True
    ob.data.materials.append(glass)
    for driven in ((ob.data.shape_keys.key_blocks["Up"], 'value'), (glass, 'roughness'),
                   (glass.node_tree.nodes[0], 'location')):
        driven[0].driver_add(driven[1])
        assert not is_at_once()
        driven[0].driver_remove(driven[1])
        assert is_at_once()
    for number in range(len(ob.data.vertices)):
        ob.vertex_groups.new(name=f"One more {number}")
    assert not is_at_once()
    monkeypatch.setattr(columns, '_VERTICES_A_GROUP', 0)
    assert is_at_once()
    monkeypatch.setattr(columns, '_MAX_GROUPS', len(ob.vertex_groups) - 1)
    assert not is_at_once()


def test_a_bind_by_groups_at_once(columns, part, monkeypatch):
    """Handlers aren't called for the scratch scene and hear of no edit of the mesh; afterwards they are called as
    usual."""
    ob = make_strip()
    bind(ob)
    expected, before = ob.detail_deform.signature, data()
    monkeypatch.setattr(part('scene.mesh_data'), 'group_entries', None)
    told, edited = [], []

    def listens(scene, depsgraph=None):
        told.append(scene)
        edited.extend(update.id for update in getattr(depsgraph, 'updates', ())
                      if update.is_updated_geometry and not isinstance(update.id, bpy.types.Collection))
    events = [f'{event}_{when}' for event in ('depsgraph_update', 'frame_change') for when in ('pre', 'post')]
    for event in events:
        getattr(bpy.app.handlers, event).append(listens)
    try:
        assert len(columns.entries(ob, ob.vertex_groups.keys())[0]) and not told
        update()
        assert told and not edited
        bind(ob)
        assert set(told) == {bpy.context.scene}
        assert ob.detail_deform.signature == expected and data() == before
        ob.detail_deform.handles[0].target.location.z += 0.5
        update()
        assert moved(ob) > 0.1
    finally:
        for event in events:
            getattr(bpy.app.handlers, event).remove(listens)


def test_groups_at_once_evaluate_no_animation(columns, part):
    """Animated values that were changed since the last frame, and not keyed, stay."""
    ob = mixed()
    group(ob, "A", [1, 2, 3])
    ob.data.materials.append(bpy.data.materials.new("Glass"))
    value = ob.data.materials[0]
    value.use_nodes = True
    key = ob.data.shape_keys.key_blocks["Up"]
    for frame, amount in ((1, 0.0), (20, 1.0)):
        value.roughness = key.value = amount
        value.keyframe_insert('roughness', frame=frame)
        key.keyframe_insert('value', frame=frame)
    bpy.context.scene.frame_set(10)
    value.roughness, key.value = 0.125, 0.25
    assert len(columns.entries(ob, ["A"])[0]) == 3
    assert (value.roughness, key.value, bpy.context.scene.frame_current) == (0.125, 0.25, 10)


@pytest.mark.parametrize('name', ['_copy', '_depsgraph'])
def test_groups_are_read_one_by_one_where_nodes_fail(columns, part, monkeypatch, name):
    """No copy could be made, or Blender gives no depsgraph, such as while its interface is locked."""
    ob, mesh_data = mixed(), part('scene.mesh_data')
    group(ob, "A", [1, 2, 3])
    monkeypatch.setattr(columns, name, lambda *_: None)
    before = data()
    assert as_dictionary(columns.entries(ob, ["A"])) == as_dictionary(mesh_data.group_entries(ob, ["A"]))
    assert data() == before


@pytest.mark.parametrize('name', ['_copy', '_shown', '_depsgraph'])
def test_groups_at_once_that_fail_leave_nothing(columns, monkeypatch, name):
    ob, before = grouped(), data()

    def fails(*_):
        raise MemoryError("Unable to allocate 923. KiB for an array")
    monkeypatch.setattr(columns, name, fails)
    with pytest.raises(MemoryError):
        columns.entries(ob, ["Region"])
    assert data() == before


def test_frames_of_many_bound_meshes_read_no_groups(part, monkeypatch):
    """Nor do they look for split vertices."""
    strips = [bind(make_strip(9 + number, name=f"Strip {number}")) for number in range(12)]
    read, split, mesh_data = [], part('scene.split'), part('scene.mesh_data')
    for module, name in ((split, 'WeldedMesh'), (mesh_data, 'group_entries')):
        function = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *of, name=name, function=function: read.append(name) or function(*of))
    for frame in range(2, 5):
        for strip in strips:
            strip.detail_deform.handles[0].target.location.z += 0.1
        bpy.context.scene.frame_set(frame)
        update()
    assert all(moved(strip) > 0.2 for strip in strips) and not read
