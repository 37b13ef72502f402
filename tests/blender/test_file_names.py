# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of files that an operating system takes for the same as another name, for a device, or doesn't allow."""

import os
import sys
from types import SimpleNamespace

import bpy
import pytest

from conftest import activate, bind, evaluated, make_strip, refusal

windows = sys.platform == 'win32'
FRAMES = range(1, 4)


def keyed(name, height):
    """A bound strip whose handle rises to this height in three frames."""
    ob = bind(make_strip(9, name))
    target = ob.detail_deform.handles[0].target
    for frame in FRAMES:
        target.location.z = height * (frame - 1) / 2
        target.keyframe_insert('location', frame=frame)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = FRAMES[0], FRAMES[-1]
    bpy.context.scene.frame_set(1)
    return ob


def risen(ob):
    """The greatest height shown at the last frame."""
    bpy.context.scene.frame_set(FRAMES[-1])
    return evaluated(ob)[:, 2].max()


def bake(ob, **options):
    activate(ob)
    assert bpy.ops.object.detail_deform_bake(**options) == {'FINISHED'}


# ---- names that only Blender takes for different ones

ALIKE = pytest.mark.parametrize('first, second', [
    ("Strip", "STRIP"), ("Straße", "STRASSE"), ("Head?", "head*"),
    ("Caf\N{LATIN SMALL LETTER E WITH ACUTE}", "CafE\N{COMBINING ACUTE ACCENT}")])


@ALIKE
def test_names_that_a_disk_takes_for_the_same_have_caches_of_their_own(tmp_path, first, second):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'shot.blend'))
    obs = keyed(first, 0.5), keyed(second, 1.5)
    live = [risen(ob) for ob in obs]
    for ob in obs:
        bake(ob)
    for ob, height in zip(obs, live):
        assert abs(risen(ob) - height) < 1e-6
    names = [first.replace('?', '_'), second.replace('*', '_') + " 2"]
    assert [m.filepath for ob in obs for m in ob.modifiers if m.type == 'MESH_CACHE'] == [
        f'//shot_{name}.pc2' for name in names]
    assert sum(name.endswith('.pc2') for name in os.listdir(tmp_path)) == 2
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    assert [abs(risen(bpy.data.objects[name]) - height) < 1e-6 for name, height in zip((first, second), live)] == [
        True, True]


@ALIKE
@pytest.mark.parametrize('options, ending', [
    ({'use': False}, '.pc2'),
    pytest.param({'mode': 'ALEMBIC'}, '.abc', marks=pytest.mark.skipif(
        not bpy.app.build_options.alembic, reason="this Blender was built without Alembic"))])
def test_names_that_a_disk_takes_for_the_same_have_files_of_their_own(tmp_path, first, second, options, ending):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'shot.blend'))
    obs = keyed(first, 0.5), keyed(second, 1.5)
    for _ in range(2):  # the second time over the same two files
        for ob in obs:
            bake(ob, **options)
    names = [name for name in os.listdir(tmp_path) if name.endswith(ending)]
    assert len(names) == 2 and len({name.casefold() for name in names}) == 2


def test_baking_again_without_playing_writes_over_the_same_file(tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'shot.blend'))
    ob = keyed("Strip", 0.5)
    bake(ob, use=False)
    activate(ob)
    bpy.ops.object.duplicate()
    bake(ob, use=False)
    assert [name for name in os.listdir(tmp_path) if name.endswith('.pc2')] == ['shot_Strip.pc2']


def test_a_list_belongs_to_the_object_that_has_its_name(tmp_path, part):
    list_in = part('setup.matching').list_file
    (tmp_path / 'A_B.txt').write_text("0 0\n", encoding='ascii')
    named, alike = make_strip(5, "A_B"), make_strip(5, "A:B")
    assert list_in(str(tmp_path), named)[0] == str(tmp_path / 'A_B.txt')
    with pytest.raises(part('scene.mesh_data').MeshProblem, match="is the list of 'A_B', and that of 'A:B' would"):
        list_in(str(tmp_path), alike)
    named.name = "C"
    assert list_in(str(tmp_path), alike)[0] == str(tmp_path / 'A_B.txt')


# ---- paths without a drive or a folder

@pytest.mark.parametrize('path', ['cache.pc2', *(['{}/cache.pc2', '{}\\cache.pc2'] if windows else [])])
def test_a_cache_is_played_from_where_it_was_written(tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    path = path.format(os.path.splitdrive(tmp_path)[1])
    ob = keyed("Strip", 0.5)
    height = risen(ob)
    bake(ob, filepath=path)
    assert os.path.samefile(ob.modifiers["Detail Deform Cache"].filepath, tmp_path / 'cache.pc2')
    assert os.path.isabs(ob.modifiers["Detail Deform Cache"].filepath) and abs(risen(ob) - height) < 1e-6
    bpy.ops.object.detail_deform_bake_drop()
    bpy.ops.object.detail_deform_bake_use(filepath=path)
    assert os.path.isabs(ob.modifiers["Detail Deform Cache"].filepath) and abs(risen(ob) - height) < 1e-6


def test_a_path_relative_to_the_blend_file_stays_relative(tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'shot.blend'))
    ob = keyed("Strip", 0.5)
    bake(ob, filepath='//cache.pc2')
    assert ob.modifiers["Detail Deform Cache"].filepath == '//cache.pc2'


# ---- names that are too long, or not allowed

def test_a_name_that_is_too_long_is_said(tmp_path):
    ob = keyed("Strip", 0.5)
    for name in ('x' * 250, '字' * 250):
        sentence = refusal(bpy.ops.object.detail_deform_bake, filepath=str(tmp_path / f'{name}.pc2'))
        assert "its name has 254 characters, of which " in sentence and "choose a shorter one" in sentence
    assert os.listdir(tmp_path) == []
    most = int(sentence.split("of which ")[1].split()[0])
    bake(ob, filepath=str(tmp_path / ('字' * (most - 4) + '.pc2')))


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="names have fewer characters")
def test_a_long_name_of_an_object_is_cut(tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'shot.blend'))
    obs = [keyed('x' * 250 + end, height) for end, height in (("a", 0.5), ("b", 1.5))]
    live = [risen(ob) for ob in obs]
    for ob in obs:
        bake(ob)
    assert all(abs(risen(ob) - height) < 1e-6 for ob, height in zip(obs, live))


def test_no_object_s_file_is_called_as_a_device(part):
    name_for = part('scene.files').name_for
    assert [name_for(name) for name in ("aux", "Con.001", "COM1 .x", "Auxiliary", "com10")] == [
        "_aux", "_Con.001", "_COM1 .x", "Auxiliary", "com10"]


@pytest.fixture
def on_windows(part, monkeypatch):
    """On other systems, makes the add-on's module take the system for Windows."""
    if not windows:
        monkeypatch.setattr(part('scene.files'), 'sys', SimpleNamespace(platform='win32'))


@pytest.mark.parametrize('name, why', [
    ('aux.pc2', "is the name of a device"), ('nul', "is the name of a device"),
    ('LPT1/x.pc2', "is the name of a device"), ('a?.pc2', "Windows allows no ? in a name"),
    ('ab:c.pc2', "Windows allows no : in a name")])
def test_names_that_windows_takes_for_something_else(tmp_path, on_windows, name, why):
    keyed("Strip", 0.5)
    path = str(tmp_path / name)
    assert why in refusal(bpy.ops.object.detail_deform_bake, filepath=path)
    assert why in refusal(bpy.ops.object.detail_deform_bake_use, filepath=path)
    if bpy.app.build_options.alembic:
        assert why in refusal(bpy.ops.object.detail_deform_bake, filepath=path, mode='ALEMBIC')
    assert os.listdir(tmp_path) == []


def test_the_sentence_for_a_path_too_long_for_windows(part, on_windows):
    reason = part('scene.files').reason
    assert "its path has 300 characters" in reason(FileNotFoundError(2, "No such file or directory"), 300 * 'x')
    assert reason(FileNotFoundError(2, "No such file or directory"), 'x') == "No such file or directory"
