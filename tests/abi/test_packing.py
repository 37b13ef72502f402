# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip that users install."""

import os
import subprocess
import sys
import zipfile

import pytest
from conftest import ADDON


def packed(native, path, *website, **environment):
    subprocess.run([sys.executable, ADDON.parent / 'make_zip.py', native.library_path(), 'linux-x64', path, *website],
                   check=True, env={**os.environ, **environment})
    return path


def test_the_same_sources_make_the_same_bytes(native, tmp_path):
    moment = {'SOURCE_DATE_EPOCH': '1700000000'}
    first = packed(native, tmp_path / 'one.zip', TZ='Asia/Tokyo', **moment)
    before = os.umask(0o77)
    try:
        os.utime(ADDON.parent / 'MANUAL.md')
        second = packed(native, tmp_path / 'two.zip', TZ='UTC', **moment)
    finally:
        os.umask(before)
    assert first.read_bytes() == second.read_bytes()
    with zipfile.ZipFile(first) as made:
        assert {entry.date_time for entry in made.infolist()} == {(2023, 11, 14, 22, 13, 20)}


def test_what_is_in_it(native, tmp_path):
    with zipfile.ZipFile(packed(native, tmp_path / 'made.zip')) as made:
        names = [entry.filename for entry in made.infolist()]
        manifest = made.read('detail_deform/blender_manifest.toml').decode()
        assert made.testzip() is None
        assert made.read('detail_deform/lib/' + os.path.basename(native.library_path()))
        assert {entry.external_attr >> 16 for entry in made.infolist()} == {0o40755, 0o100644}
        assert names[0] == 'detail_deform/' and made.infolist()[0].is_dir()
    assert 'platforms = ["linux-x64"]\n' in manifest and 'website' not in manifest
    assert {name.split('/')[0] for name in names} == {'detail_deform'}
    for name in ('__init__.py', 'LICENSE', 'LICENSES.md', 'MANUAL.md', 'manual/overview.png', 'library/loading.py'):
        assert f'detail_deform/{name}' in names
    assert not [name for name in names if '__pycache__' in name or name.endswith('.pyc')]


@pytest.mark.parametrize('name, line', [('CMakeLists.txt', 'VERSION {}.{}.{} '),
                                        ('addon/detail_deform/blender_manifest.toml', 'version = "{}.{}.{}"\n'),
                                        ('addon/detail_deform/__init__.py', "'version': ({}, {}, {}),"),
                                        ('CHANGELOG.md', '## [{}.{}.{}]')])
def test_one_version_everywhere(native, name, line):
    text = (ADDON.parents[1] / name).read_text(encoding='utf-8')
    assert line.format(*native.version().split('.')) in text
