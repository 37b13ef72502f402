# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources from other files: linked, as library overrides, and in instanced collections; and targets from other files,
which are refused."""

import bpy
import numpy as np
import pytest

from conftest import activate, add_empty, evaluated, group, in_a_collection, new_scene, own, refusal, update
from rigs import make_rigged
from test_transfer import add_key, copy_of_rest, raw_strip

transfer = bpy.ops.object.detail_deform_transfer
live = bpy.ops.object.detail_deform_transfer_live
KINDS = ('LINKED', 'OVERRIDE', 'INSTANCE')


@pytest.fixture
def library(tmp_path):
    """The path of a file with the collection "Character": a rigged mesh with a driven shape key and a subdivision."""
    source, rig = make_rigged()
    add_key(source, "Fat", own(source) * (1, 1.5, 1.5))
    source.data.shape_keys.key_blocks["Fat"].driver_add('value').driver.expression = "0.25"
    source.modifiers.new("Subdivision", 'SUBSURF')
    in_a_collection(source, rig, name="Character")
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    new_scene()
    return path


def bring(library, kind):
    """Brings the collection into the scene; returns its mesh object, the source."""
    with bpy.data.libraries.load(library, link=True) as (_, into):
        into.collections = ["Character"]
    collection, scene = into.collections[0], bpy.context.scene
    if kind == 'INSTANCE':
        instance = add_empty("Instance", (1, 2, 3))
        instance.instance_type, instance.instance_collection = 'COLLECTION', collection
    elif kind == 'OVERRIDE':
        collection = collection.override_hierarchy_create(scene, bpy.context.view_layer)
    if kind != 'INSTANCE' and collection.name not in scene.collection.children:
        scene.collection.children.link(collection)
    update()
    source = next(ob for ob in collection.all_objects if ob.type == 'MESH')
    assert bool(source.override_library) == (kind == 'OVERRIDE')
    assert bool(source.library) == (kind != 'OVERRIDE')
    return source


def truth(library, frames):
    """{frame: positions of the source without its subdivision}, evaluated in the library's own file."""
    bpy.ops.wm.open_mainfile(filepath=library)
    source = bpy.data.objects["Limb"]
    source.modifiers["Subdivision"].show_viewport = False
    found = {}
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        found[frame] = evaluated(source)
    new_scene()
    return found


def assert_follows(target, poses):
    for frame, pose in poses.items():
        bpy.context.scene.frame_set(frame)
        assert target.detail_deform.transfer.state == f"Follows '{target.detail_deform.transfer.source.name}'."
        assert np.abs(evaluated(target) - pose).max() < 1e-3, frame


@pytest.mark.parametrize('kind', KINDS)
def test_pose_keys_and_animation(library, tmp_path, kind):
    poses = truth(library, (11, 16))
    source = bring(library, kind)
    target = copy_of_rest(source)
    bpy.context.scene.frame_set(11)
    assert transfer(what='POSE') == {'FINISHED'}
    update()
    assert np.abs(evaluated(target) - poses[11]).max() < 1e-4
    target.data.shape_keys.key_blocks[1].value = 0
    transfer(what='ALL_KEYS', drivers=True)
    update()
    fat = target.data.shape_keys.key_blocks["Fat"]
    assert abs(fat.value - 0.25) < 1e-6 and not fat.id_data.library
    fat.driver_remove('value')
    fat.value = 0
    transfer(what='ANIMATION', frame_start=11, frame_end=16, cache_path=str(tmp_path / "target.pc2"))
    for frame, pose in poses.items():
        bpy.context.scene.frame_set(frame)
        assert np.abs(evaluated(target) - pose).max() < 1e-4


@pytest.mark.parametrize('kind', KINDS)
def test_follows_saved_reloaded_and_as_the_library_changes(library, tmp_path, kind):
    poses = truth(library, (11, 16, 31))
    target = copy_of_rest(bring(library, kind))
    assert live() == {'FINISHED'}
    assert_follows(target, poses)
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert_follows(bpy.data.objects["Target"], poses)
    # The library's mesh is changed; the file that links to it is opened again.
    bpy.ops.wm.open_mainfile(filepath=library)
    bpy.data.objects["Limb"].data.shape_keys.key_blocks["Fat"].driver_remove('value')
    bpy.data.objects["Limb"].data.shape_keys.key_blocks["Fat"].value = 1.0
    bpy.ops.wm.save_mainfile()
    poses = truth(library, (11, 31))
    bpy.ops.wm.open_mainfile(filepath=path)
    assert_follows(bpy.data.objects["Target"], poses)


@pytest.mark.parametrize('kind', ['LINKED', 'OVERRIDE'])  # an instance's mesh can't be the active object
def test_to_many_with_one_that_fails(library, kind, capfd):
    """A linked source can't store which targets failed; the text data-block lists them."""
    source = bring(library, kind)
    good, odd = copy_of_rest(source, "Good"), raw_strip("Odd", 9)
    activate(source)
    good.select_set(True)
    odd.select_set(True)
    bpy.ops.object.detail_deform_transfer_many(what='ALL_KEYS')
    assert "1 of 2 targets done, 1 failed: 'Odd'" in capfd.readouterr().out
    assert "Odd" in bpy.data.texts["Detail Deform Transfer"].as_string()
    assert not source.detail_deform.transfer.failed and "Fat" in good.data.shape_keys.key_blocks


def test_empties_mark_a_linked_source(library):
    source = bring(library, 'LINKED')
    target = copy_of_rest(source)
    for number, vertex in enumerate((3, 100, 300, 500), 1):
        place = own(source)[vertex]
        add_empty(f"Marker {number}.001", place, parent=source)
        group(target, f"Marker {number}", [vertex])
    update()
    activate(target)
    assert bpy.ops.object.detail_deform_transfer_match() == {'FINISHED'}
    assert target.detail_deform.transfer.correspondence == 'STORED'


def test_a_target_that_belongs_to_another_file_is_refused_by_name(library):
    source = bring(library, 'LINKED')
    other = copy_of_rest(source, "Other")
    activate(source)
    for operator in (transfer, live):
        said = refusal(operator, source="Other")
        assert "'Limb' is linked from another file, 'library.blend'" in said and "Make Local > All" in said
    local = bpy.data.objects.new("Local", source.data)
    bpy.context.scene.collection.objects.link(local)
    activate(local)
    for operator in (transfer, live):
        said = refusal(operator, source="Other")
        assert "The mesh of 'Local', 'Limb', is linked from another file, 'library.blend'" in said
    bpy.ops.object.make_local(type='SELECT_OBDATA')  # Make Local > All, as the sentence advises
    assert transfer(source="Other") == {'FINISHED'} and local.data.shape_keys and not other.data.shape_keys


def test_an_override_is_refused_as_a_target_until_it_is_local(library):
    source = bring(library, 'OVERRIDE')
    # Without a user of the source: Blender 3.4 makes no object local that is in use.
    copy_of_rest(source, "Other").detail_deform.transfer.source = None
    activate(source)
    for operator in (transfer, live):
        assert "'Limb' is a library override of 'library.blend'" in refusal(operator, source="Other")
    source.select_set(True)
    bpy.ops.object.make_local(type='SELECT_OBDATA')
    local = next(ob for ob in bpy.context.scene.objects if ob.name == "Limb")
    activate(local)
    assert transfer(source="Other") == {'FINISHED'} and not local.override_library


def test_a_source_that_was_deleted_is_still_known_as_gone():
    source = raw_strip("Source")
    target = copy_of_rest(source)
    live()
    bpy.context.scene.collection.objects.unlink(source)
    update()
    target.data.update_tag()
    update()
    assert "was deleted" in target.detail_deform.transfer.state
