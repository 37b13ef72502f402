# SPDX-License-Identifier: GPL-3.0-or-later
"""Files with content that the add-on doesn't write, broken by mistake or on purpose: they give a sentence or nothing,
never an exception, an endless update or a crash; and no path in them is written to."""

import os
import struct

import bpy
import numpy as np
import pytest

from conftest import activate, bind, evaluated, make_strip, new_scene, own, refusal, update
from test_transfer import add_key, bent, raw_strip

NAN = float('nan')
BUTTONS = ('update', 'bind', 'handle_reset', 'save_key', 'copy_settings', 'place', 'base_make', 'bake', 'bake_drop',
           'transfer_match', 'transfer', 'transfer_live', 'transfer_forget', 'own_empties', 'examples_from_keys',
           'handle_mirror', 'unbind', 'bind', 'apply', 'remove')


def stored(ob):
    """The settings as a file stores them: custom properties, without limits or types."""
    return (ob.bl_system_properties_get() if bpy.app.version >= (5, 0) else ob)['detail_deform']


def use(ob, buttons=BUTTONS):
    """Plays frames, reads all that panels show, moves the handles, presses buttons and undoes."""
    settings = ob.detail_deform
    for frame in (3, 4):
        bpy.context.scene.frame_set(frame)
        told = settings.transfer.state if settings.transfer.live else settings.stale or settings.problem
        assert settings.status and told in settings.status
        assert np.isfinite((settings.update_ms, settings.bind_ms)).all()
        for handle in settings.handles:
            if handle.target:
                handle.target.location.z += 0.1
        update()
        assert np.isfinite(evaluated(ob)).all()
    settings.refine = 2
    ob.data.update_tag()
    update()
    bpy.ops.ed.undo_push(message="used")
    name = ob.name
    for operator in buttons:
        if name not in bpy.data.objects:
            break
        activate(bpy.data.objects[name])
        try:
            getattr(bpy.ops.object, f'detail_deform_{operator}')()
        except RuntimeError:
            pass  # refused by a sentence, or by poll()
        update()
    bpy.ops.ed.undo_push(message="pressed")
    bpy.ops.ed.undo()
    update()


@pytest.fixture
def opened(tmp_path, part):
    """opened(change): saves a bound and posed strip, changed by change(ob), opens the file, and returns the strip."""
    def make(change, prepare=lambda: bind(make_strip(11))):
        ob = prepare()
        for handle in ob.detail_deform.handles:
            handle.target.location.z += 0.3
        update()
        change(ob)
        bpy.context.scene.frame_end = 3
        path = str(tmp_path / 'hostile.blend')
        bpy.ops.wm.save_as_mainfile(filepath=path)
        new_scene()
        bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
        return activate(bpy.data.objects[ob_name])
    ob_name = "Strip"
    return make


def setting(name, value):
    def change(ob):
        stored(ob)[name] = value
    change.__name__ = f'{name}={str(value)[:12]}'
    return change


def of_handle(name, value):
    def change(ob):
        stored(ob)['handles'][0][name] = value
    change.__name__ = f'handle.{name}={str(value)[:12]}'
    return change


def of_mesh(name, value):
    def change(ob):
        ob.data[name] = value
    change.__name__ = f'mesh.{name}={str(value)[:12]}'
    return change


def of_group(name, value):
    def change(ob):
        group = ob.modifiers['Detail Deform'].node_group
        group[name] = value
    change.__name__ = f'group.{name}={str(value)[:12]}'
    return change


CHANGES = [
    *(setting(name, 99) for name in ('method', 'base', 'base_metric', 'smoothness', 'output', 'base_deformer',
                                     'weights_by', 'preview')), setting('method', -1),
    *(setting(name, number) for name in ('refine', 'levels', 'steps', 'handle_index', 'example_index')
      for number in (2**31 - 1, -2**31)),
    *(setting(name, number) for name in ('rim_smoothing', 'rotation_smoothing', 'solidity', 'soft_border',
                                         'metric_smoothing', 'volume_tolerance') for number in (NAN, 1e38)),
    *(setting('signature', text) for text in ('x', '....', 'a.b.c.d', '\n{0}%s', 'é' * 20000)),
    *(setting(name, '{0} %s %n \n\t\x1b[31m') for name in ('stale', 'problem', 'compared_handles', 'cache_modifier',
                                                            'baked_file', 'region', 'own_region', 'influence')),
    of_handle('rest_matrix', [NAN] * 16), of_handle('rest_matrix', [1e38] * 16), of_handle('home_matrix', [NAN] * 16),
    of_handle('rest_euler', [1e38] * 3), of_handle('rest_order', '{0}%s'), of_handle('mirror_space', [NAN] * 16),
    of_handle('mirror_space', [1.0] * 16), of_handle('home_order', 'XXX'), setting('bound_points', 'é{0}'),
    setting('bound_points', 'abcd'), setting('render_problem', '{0} %s'), of_handle('turns', 77),
    of_handle('mirror_axis', 77),
    of_handle('mirrors', 'right'), of_handle('mirrors', '{0}%s'), of_handle('name', '{0}%s\n'),
    of_handle('vertex_group', '..'), of_handle('own_group', 'region'),
    of_mesh('detail_deform_written', [1, 2]), of_mesh('detail_deform_written', {'a': 1}),
    of_mesh('detail_deform_match', 7), of_mesh('detail_deform_match', {}), of_mesh('detail_deform_match', 'text'),
    of_mesh('detail_deform_transferred_keys', 7), of_mesh('detail_deform_transferred_keys', {'a': 1}),
    of_group('detail_deform_nodes', 'text'), of_group('detail_deform_nodes', {'a': 1}),
    of_group('detail_deform_nodes', -1)]


@pytest.mark.parametrize('change', CHANGES, ids=lambda change: change.__name__)
def test_a_setting_that_no_button_gives(opened, change):
    use(opened(change), ('update', 'handle_reset', 'bind', 'remove'))


# ---- pointers

def _following():
    source, target = raw_strip("Source", 11), raw_strip("Strip", 11)
    add_key(source, "Bend", bent(own(source)))
    target.detail_deform.transfer.source = source
    activate(target)
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    return target


def pointer(**chosen):
    """Sets pointers of the settings to the objects of these names."""
    def change(ob):
        for name, other in chosen.items():
            owner = ob.detail_deform.transfer if name == 'source' else ob.detail_deform
            setattr(owner, name, bpy.data.objects[other])
    return change


def base_of_one_another(ob):
    other = make_strip(11, "Other")
    for one, another in ((ob, other), (other, ob)):
        one.detail_deform.base, one.detail_deform.base_object = 'OBJECT', another
        activate(one)
        try:
            bpy.ops.object.detail_deform_bind(wait=True)
        except RuntimeError:
            pass


def followers_in_a_circle(ob):
    first = bpy.data.objects["Source"]
    for key in ('live', 'prepared_for'):
        setattr(first.detail_deform.transfer, key, getattr(ob.detail_deform.transfer, key))
    first.detail_deform.transfer.source = ob


def itself(ob):
    ob.detail_deform.transfer.source = ob


def examples_of_all_kinds(ob):
    for other in (ob, bpy.data.objects["Right"]):
        example = ob.detail_deform.examples.add()
        example.object, example.is_object = other, True
    ob.detail_deform.method = 'EXAMPLES'


def a_kept_base_of_another_mesh(ob):
    mesh = bpy.data.meshes.new("Odd")
    mesh.from_pydata([(0, 0, NAN), (1e38, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    other = make_strip(11, "Other")
    ob.detail_deform.base, ob.detail_deform.base_object = 'OBJECT', other
    ob.detail_deform.base_rest_mesh = mesh


def empties_that_are_none(ob):
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    ob.detail_deform.handles[0].target = camera
    again = ob.detail_deform.handles.add()
    again.vertex_group, again.target = 'right', ob  # the mesh itself


def handles_in_thousands(ob):
    for _ in range(3000):
        ob.detail_deform.handles.add()


@pytest.mark.parametrize('change', [
    pointer(base_object="Right"), pointer(base_object="Strip"), base_of_one_another, examples_of_all_kinds,
    a_kept_base_of_another_mesh, empties_that_are_none, handles_in_thousands])
def test_pointers_that_no_button_gives(opened, change):
    use(opened(change))


@pytest.mark.parametrize('change', [
    followers_in_a_circle, itself, of_mesh('detail_deform_match', 7)])
def test_followers_that_no_button_gives(opened, change):
    use(opened(change, _following))


def test_a_source_that_is_no_mesh(opened):
    def change(ob):
        ob.detail_deform.transfer.source = bpy.data.objects.new("Empty", None)
        bpy.context.scene.collection.objects.link(ob.detail_deform.transfer.source)
    use(opened(change, _following))


def match(**parts):
    """Replaces parts of a saved match; None deletes a part."""
    def change(ob):
        record = ob.data['detail_deform_match']
        for name, value in parts.items():
            changed = record if name in record.keys() else record['arrays']
            if value is None:
                del changed[name]
            else:
                changed[name] = value
    return change


def _matched(tmp_path):
    source, target = raw_strip("Source", 11), raw_strip("Strip", 11)
    target.detail_deform.transfer.source = source
    path = tmp_path / 'pairs.txt'
    path.write_text('\n'.join(f'{k} {k}' for k in range(200)), encoding='ascii')
    settings = target.detail_deform.transfer
    settings.correspondence, settings.filepath = 'LIST', str(path)
    activate(target)
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    return target


@pytest.mark.parametrize('change', [
    match(arrays=None), match(arrays=5),
    match(pairs=None), match(digest=None), match(digest=5), match(pairs=[1, 2, 3]), match(pairs=[5, 10**9]),
    match(pairs=[-1, -1]), match(pairs='text'), match(target_triangles=[0, 1, -5] * 200),
    match(target_triangles=[0, 1, 10**8] * 200), match(source_triangles=[0, 10**9, 2] * 200),
    match(confidence=[NAN]), match(confidence=None), match(pairs_of='{0}'), match(pairs_of=4),
    match(target_topology=3), match(source=[1]), match(point_triangles=[0], point_weights=[NAN]),
    match(point_triangles=[10**9] * 121, point_weights=[0.5] * 363)])
def test_a_saved_match_that_no_search_gives(opened, tmp_path, part, change):
    ob = opened(change, lambda: _matched(tmp_path))
    part('scene.saved_match').vertex_confidence(ob)  # read by Show Match
    bpy.ops.ed.undo_push(message="opened")
    try:
        bpy.ops.object.detail_deform_transfer_save(filepath=str(tmp_path / 'written.txt'))
    except RuntimeError:
        pass
    use(ob)


def other_sockets(ob):
    """Replaces the sockets of the add-on's node group by sockets of other types with the same names."""
    group = ob.modifiers['Detail Deform'].node_group
    kinds = {'Factor': 'NodeSocketString', 'Influence': 'NodeSocketGeometry', 'Invert': 'NodeSocketObject',
             'Base': 'NodeSocketFloat'}
    for name, kind in kinds.items():
        if hasattr(group, 'interface'):
            group.interface.remove(next(s for s in group.interface.items_tree if s.name == name))
            group.interface.new_socket(name, in_out='INPUT', socket_type=kind)
        else:
            group.inputs.remove(group.inputs[name])
            group.inputs.new(kind, name)


def no_nodes(ob):
    ob.modifiers['Detail Deform'].node_group.nodes.clear()


def values_of_other_kinds(ob):
    modifier = ob.modifiers['Detail Deform']
    for key in list(modifier.keys()):
        del modifier[key]  # otherwise the property keeps its type
        modifier[key] = [1, 2]


@pytest.mark.parametrize('change', [
    other_sockets, no_nodes,
    pytest.param(values_of_other_kinds, marks=pytest.mark.skipif(bpy.app.version >= (5, 2), reason="they have kinds"))])
def test_nodes_that_are_not_ours(opened, change):
    use(opened(change))


# ---- files that are read, and paths

HEADER = struct.Struct('<12siiffi')


def cache_of(points=121, frames=3, mark=b'POINTCACHE2\0'):
    return HEADER.pack(mark, 1, points, 1.0, 1.0, frames) + bytes(12 * 121 * 3)


@pytest.mark.parametrize('content', [
    *(cache_of()[:length] for length in (0, 1, 11, 12, 31, 32, 33, 4387)), cache_of() + b'\0',
    cache_of(mark=b'POINTCACHE3\0'), cache_of(-121, -3), cache_of(-121, 3), cache_of(2**31 - 1, 2**31 - 1),
    cache_of(0, 2**31 - 1), cache_of(121, -2**31)],
    ids=lambda content: f'{len(content)}-{content[12:32].hex()[:40]}')
def test_caches_that_are_none(tmp_path, content):
    ob = bind(make_strip(11))
    path = tmp_path / 'cache.pc2'
    path.write_bytes(content)
    assert "is not" in refusal(bpy.ops.object.detail_deform_bake_use, filepath=str(path))
    assert [m.type for m in ob.modifiers] == ['NODES']


@pytest.mark.parametrize('content', [
    b'', b'\0' * 5000, b'\xff\xfe1 2', b'1', b'1 2 3\nx', b'9' * 10000 + b' 1', b'-1 0', b'0 -5', b'1e5 2', b'0 99999',
    b'4294967296 0', b'{0} {1}', b'%s %d', '１ ２'.encode() + b' \n' * 3 + b'99999 0'],
    ids=lambda content: repr(content[:12]))
def test_lists_that_are_none(tmp_path, content):
    ob = _matched(tmp_path)
    bpy.ops.object.detail_deform_transfer_live(on=False)
    path = tmp_path / 'list.txt'
    path.write_bytes(content)
    ob.detail_deform.transfer.correspondence, ob.detail_deform.transfer.filepath = 'LIST', str(path)
    assert str(path) in refusal(bpy.ops.object.detail_deform_transfer_live)


@pytest.mark.skipif(not hasattr(os, 'mkfifo'), reason="no such files on this system")
def test_devices_pipes_and_folders_are_not_read(tmp_path):
    bind(make_strip(11))
    os.mkfifo(tmp_path / 'pipe')
    for path in ('/dev/zero', str(tmp_path / 'pipe'), str(tmp_path)):
        assert "it is no file" in refusal(bpy.ops.object.detail_deform_bake_use, filepath=path)
    ob = _matched(tmp_path)
    bpy.ops.object.detail_deform_transfer_live(on=False)
    for path in ('/dev/zero', str(tmp_path / 'pipe'), str(tmp_path)):
        ob.detail_deform.transfer.correspondence, ob.detail_deform.transfer.filepath = 'LIST', path
        assert "it is no file" in refusal(bpy.ops.object.detail_deform_transfer_live)


def test_no_path_within_a_blend_file_is_written_to(tmp_path):
    """A bake without a path goes beside the .blend file, whatever names and paths are stored in that."""
    inside, victims = tmp_path / 'inside', [tmp_path / 'victim.pc2', tmp_path / 'list.txt']
    inside.mkdir()
    for victim in victims:
        victim.write_bytes(b'precious')
    ob = bind(make_strip(11, "../victim"))
    cache = ob.modifiers.new("Detail Deform Cache", 'MESH_CACHE')
    ob.detail_deform.cache_modifier, cache.filepath = cache.name, str(victims[0])
    ob.detail_deform.transfer.filepath = str(victims[1])
    bpy.context.scene.frame_end = 2
    bpy.ops.wm.save_as_mainfile(filepath=str(inside / 'file.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(inside / 'file.blend'), load_ui=False)
    activate(bpy.data.objects["../victim"])
    assert bpy.ops.object.detail_deform_bake() == {'FINISHED'}
    assert sorted(os.listdir(inside)) == ['file.blend', 'file_.._victim.pc2']
    assert [victim.read_bytes() for victim in victims] == [b'precious'] * 2
