# SPDX-License-Identifier: GPL-3.0-or-later
"""Peculiarities of Windows: drives, backslashes, and files that are locked while a program has them open.

The environment variables DD_TEST_DRIVE and DD_TEST_READ_ONLY_DRIVE name a writable and a read-only drive for these
tests, such as T: and R:."""

import os
import shutil
import stat
import string
import sys
from pathlib import Path

import bpy
import pytest

from conftest import activate, refusal
from test_file_names import bake, keyed, risen
from test_paths import check_all_that_is_written_to

pytestmark = pytest.mark.skipif(sys.platform != 'win32', reason="Windows' drives and locks")
ALEMBIC = pytest.mark.skipif(not bpy.app.build_options.alembic, reason="this Blender was built without Alembic")


@pytest.fixture
def strip():
    return keyed("Strip", 0.5)


def drive(variable):
    if variable not in os.environ:
        pytest.skip(f"there is no drive in {variable}")
    return Path(os.environ[variable] + '\\')


@pytest.fixture
def other_drive():
    return drive('DD_TEST_DRIVE')


@pytest.fixture
def read_only_drive():
    return drive('DD_TEST_READ_ONLY_DRIVE')


# ---- drives

def test_all_that_is_written_to_another_drive(other_drive):
    folder = other_drive / 'Größe 画像'
    folder.mkdir()
    check_all_that_is_written_to(folder)


def test_a_cache_on_another_drive_than_the_file(strip, other_drive, tmp_path):
    live = risen(strip)
    for blend, cache in ((tmp_path / 'shot.blend', other_drive / 'strip.pc2'),
                         (other_drive / 'shot.blend', tmp_path / 'strip.pc2')):
        bpy.ops.wm.save_as_mainfile(filepath=str(blend), relative_remap=True)
        bake(bpy.data.objects["Strip"], filepath=str(cache))
        bpy.ops.wm.save_mainfile()
        bpy.ops.wm.open_mainfile(filepath=str(blend))
        assert abs(risen(bpy.data.objects["Strip"]) - live) < 1e-6


def test_a_drive_that_may_only_be_read(strip, read_only_drive):
    for options in ({'filepath': str(read_only_drive / 'strip.pc2')},
                    {'filepath': str(read_only_drive / 'strip.pc2'), 'frame_start': 2, 'cache_start': 1}):
        sentence = refusal(bpy.ops.object.detail_deform_bake, **options)
        assert "can't be written: " in sentence and [m.type for m in strip.modifiers] == ['NODES']


@ALEMBIC
def test_alembic_where_it_may_not_be_written(strip, read_only_drive):
    path = str(read_only_drive / 'strip.abc')
    assert "can't be written: " in refusal(bpy.ops.object.detail_deform_bake, filepath=path, mode='ALEMBIC')


def test_a_drive_that_is_not_there(strip):
    missing = next(letter for letter in string.ascii_uppercase[3:] if not os.path.exists(f'{letter}:\\'))
    path = f'{missing}:\\strip.pc2'
    assert f"'{path}' can't be written: " in refusal(bpy.ops.object.detail_deform_bake, filepath=path)
    assert f"'{path}' can't be read: " in refusal(bpy.ops.object.detail_deform_bake_use, filepath=path)
    assert [m.type for m in strip.modifiers] == ['NODES']


# ---- backslashes

@pytest.mark.parametrize('path', ['//caches\\strip.pc2', '//caches/strip.pc2', '//..\\shots\\caches/strip.pc2',
                                  '{}\\caches\\strip.pc2', '{}/caches/strip.pc2'])
def test_paths_with_slashes_of_both_kinds(strip, tmp_path, path):
    folder = tmp_path / 'shots'
    (folder / 'caches').mkdir(parents=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / 'shot.blend'))
    live = risen(strip)
    bake(strip, filepath=path.format(folder))
    assert os.listdir(folder / 'caches') == ['strip.pc2']
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    assert abs(risen(bpy.data.objects["Strip"]) - live) < 1e-6


def test_a_cache_s_name_is_not_taken_twice_because_it_is_spelled_otherwise(strip, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'shot.blend'))
    bake(strip, filepath=str(tmp_path / 'SHOT_Other.PC2').replace('\\', '/'))
    other = keyed("Other", 1.5)
    bake(other)
    assert other.modifiers["Detail Deform Cache"].filepath == '//shot_Other 2.pc2'


# ---- locked files

def check_that_it_stays(path, write, why):
    """A refused write leaves the file as it was, and no other file beside it."""
    before = path.read_bytes()
    assert f"'{path}' can't be written: " in refusal(write, filepath=str(path)), why
    assert path.read_bytes() == before and os.listdir(path.parent) == [path.name]


@pytest.fixture
def baked(strip, tmp_path):
    folder = tmp_path / 'caches'
    folder.mkdir()
    bake(strip, filepath=str(folder / 'strip.pc2'))
    return folder / 'strip.pc2'


def test_a_cache_that_another_program_has_open(baked):
    with open(baked, 'rb'):
        check_that_it_stays(baked, bpy.ops.object.detail_deform_bake, "it is open")
    assert bpy.ops.object.detail_deform_bake(filepath=str(baked)) == {'FINISHED'}


def takes_the_place_of_what_may_only_be_read(folder):
    """Whether a file can replace a read-only one: in Wine it can, on Windows it can't."""
    old, new = folder / 'old', folder / 'new'
    for path in (old, new):
        path.write_bytes(b'')
    os.chmod(old, stat.S_IREAD)
    try:
        os.replace(new, old)
        return True
    except PermissionError:
        return False
    finally:
        os.chmod(old, stat.S_IREAD | stat.S_IWRITE)


def test_a_cache_that_may_only_be_read(baked, tmp_path):
    os.chmod(baked, stat.S_IREAD)
    try:
        if not takes_the_place_of_what_may_only_be_read(tmp_path):
            check_that_it_stays(baked, bpy.ops.object.detail_deform_bake, "it is read-only")
    finally:
        os.chmod(baked, stat.S_IREAD | stat.S_IWRITE)
    assert bpy.ops.object.detail_deform_bake(filepath=str(baked)) == {'FINISHED'}


def test_a_cache_that_is_played_is_baked_anew(strip, baked):
    handle = strip.detail_deform.handles[0].target
    activate(strip)
    for height in (0.7, 0.9):
        bpy.ops.object.detail_deform_bake_drop()
        handle.location.z = height
        handle.keyframe_insert('location', frame=3)
        bake(strip, filepath=str(baked))
        assert abs(risen(strip) - height) < 0.1


def test_the_folder_of_an_unfinished_cache_cannot_be_deleted(strip, tmp_path):
    folder, refused = tmp_path / 'caches', []
    folder.mkdir()

    def delete(scene, _):
        if scene.frame_current == 2:
            try:
                shutil.rmtree(folder)
            except OSError:
                refused.append(scene.frame_current)
    bpy.app.handlers.frame_change_post.append(delete)
    try:
        bake(strip, filepath=str(folder / 'strip.pc2'))
    finally:
        bpy.app.handlers.frame_change_post.remove(delete)
    assert refused and os.listdir(folder) == ['strip.pc2']
