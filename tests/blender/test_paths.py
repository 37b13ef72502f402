# SPDX-License-Identifier: GPL-3.0-or-later
"""Files in folders with unusual and long names are written, read and found again."""

import os

import bpy
import pytest

from conftest import activate, make_strip
from test_file_names import bake, keyed, risen

NAME = "Größe 画像 \N{DRAGON}"


def check_all_that_is_written_to(folder):
    """Writes and reads every kind of file in a folder: .blend files, caches, Alembic files, and lists of pairs and of
    key names."""
    blend = str(folder / f'{NAME}.blend')
    ob = keyed(NAME, 0.5)
    live = risen(ob)
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bake(ob)
    assert abs(risen(ob) - live) < 1e-6
    bpy.ops.object.detail_deform_bake_drop()
    cache = str(folder / f'{NAME}.pc2')
    bake(ob, filepath=cache, use=False)
    if bpy.app.build_options.alembic:
        bake(ob, mode='ALEMBIC')
        assert (folder / f'{NAME}_{NAME}.abc').stat().st_size > 1000
    bpy.ops.object.detail_deform_bake_use(filepath=cache)
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=blend)
    ob = bpy.data.objects[NAME]
    assert ob.modifiers["Detail Deform Cache"].filepath == cache and abs(risen(ob) - live) < 1e-6
    check_lists(folder)
    assert not [name for name in os.listdir(folder) if 'unfinished' in name]


def check_lists(folder):
    source, target = make_strip(5, f"{NAME} 1"), make_strip(5, f"{NAME} 2")
    for ob in (source, target):
        ob.shape_key_add(name="Basis")
    source.shape_key_add(name="Öffnen").data[24].co.z = 1
    target.shape_key_add(name="開く")
    pairs, names = folder / f'{NAME} 2.txt', folder / f'{NAME} names.txt'
    pairs.write_text(''.join(f"{k} {k}\n" for k in range(25)), encoding='utf-8')
    names.write_text("Öffnen -> 開く\n", encoding='utf-8')
    activate(target)
    assert bpy.ops.object.detail_deform_transfer(
        source=source.name, what='ALL_KEYS', correspondence='LIST', filepath=str(pairs), pairs_of='VERTICES',
        names_file=str(names), replace=True) == {'FINISHED'}
    assert abs(target.data.shape_keys.key_blocks["開く"].data[24].co.z - 1) < 1e-5
    pairs.unlink()
    bpy.ops.object.detail_deform_transfer_save(source=source.name, filepath=str(pairs))
    assert "pairs of vertices" in pairs.read_text(encoding='utf-8')


@pytest.mark.parametrize('name', ["ordinary", "Größe und Maß 画像 \N{DRAGON}", "with 'quotes', %s, {0} and #"])
def test_folders_of_any_name(tmp_path, name):
    folder = tmp_path / name
    folder.mkdir()
    check_all_that_is_written_to(folder)


def test_paths_longer_than_260_characters(tmp_path):
    folder = tmp_path.joinpath(*['a folder whose name is long'] * 10)
    try:
        folder.mkdir(parents=True)
        (folder / 'file').write_bytes(b'')
    except OSError:
        pytest.skip("long paths are not switched on here")
    assert len(str(folder)) > 260
    check_all_that_is_written_to(folder)
