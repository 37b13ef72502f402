# SPDX-License-Identifier: GPL-3.0-or-later
"""The zips that users install: with the library in the add-on's folder, and in a wheel."""

import base64
import hashlib
import io
import os
import re
import subprocess
import sys
import zipfile

import pytest
from conftest import ADDON


def packed(native, path, *options, platforms='linux-x64', **environment):
    subprocess.run([sys.executable, ADDON.parent / 'make_zip.py', native.library_path(), platforms, path, *options],
                   check=True, env={**os.environ, **environment})
    return path


@pytest.mark.parametrize('options', [(), ('--wheel',)], ids=['folder', 'wheel'])
def test_the_same_sources_make_the_same_bytes(native, tmp_path, options):
    moment = {'SOURCE_DATE_EPOCH': '1700000000'}
    first = packed(native, tmp_path / 'one.zip', *options, TZ='Asia/Tokyo', **moment)
    before = os.umask(0o77)
    try:
        os.utime(ADDON.parent / 'MANUAL.md')
        second = packed(native, tmp_path / 'two.zip', *options, TZ='UTC', **moment)
    finally:
        os.umask(before)
    assert first.read_bytes() == second.read_bytes()
    with zipfile.ZipFile(first) as made:
        assert {entry.date_time for entry in made.infolist()} == {(2023, 11, 14, 22, 13, 20)}


def test_contents_of_the_zip(native, tmp_path):
    with zipfile.ZipFile(packed(native, tmp_path / 'made.zip')) as made:
        names = [entry.filename for entry in made.infolist()]
        manifest = made.read('detail_deform/blender_manifest.toml').decode()
        assert made.testzip() is None
        assert made.read('detail_deform/lib/' + os.path.basename(native.library_path()))
        assert {entry.external_attr >> 16 for entry in made.infolist()} == {0o40755, 0o100644}
        assert names[0] == 'detail_deform/' and made.infolist()[0].is_dir()
    assert 'platforms = ["linux-x64"]\n' in manifest and 'website' not in manifest
    assert {name.split('/')[0] for name in names} == {'detail_deform'}
    # Blender shows the reasons when it installs the extension. It takes at most 64 characters and no full stop.
    reasons = dict(re.findall('\n([a-z]+) = "(.*)"', manifest.split('[permissions]')[1]))
    assert set(reasons) == {'files', 'clipboard'}
    assert all(len(reason) <= 64 and reason[-1].isalpha() for reason in reasons.values())
    for name in ('__init__.py', 'LICENSE', 'LICENSES.md', 'MANUAL.html', 'manual/overview.png', 'library/loading.py'):
        assert f'detail_deform/{name}' in names
    assert not [name for name in names if '__pycache__' in name or name.endswith('.pyc')]


def read_all(path):
    with zipfile.ZipFile(path) as made:
        assert made.testzip() is None
        return {name.removeprefix('detail_deform/'): made.read(name) for name in made.namelist()}


def test_the_extension_has_the_library_in_a_wheel_alone(native, tmp_path):
    """All other files are the same in both zips, but for those that say where the library is."""
    one = read_all(packed(native, tmp_path / 'one.zip'))
    other = read_all(packed(native, tmp_path / 'other.zip', '--wheel'))
    library = os.path.basename(native.library_path())
    name = f'wheels/detail_deform_library-{native.version()}-py3-none-manylinux_2_17_x86_64.whl'
    assert set(one) - set(other) == {f'lib/{library}', f'lib/{library}.sha256'} and set(other) - set(one) == {name}
    assert {name for name in set(one) & set(other) if one[name] != other[name]} == {
        '__init__.py', 'library/wheel.py', 'blender_manifest.toml'}
    assert f'platforms = ["linux-x64"]\nwheels = ["./{name}"]\n' in other['blender_manifest.toml'].decode()
    package = f"detail_deform_library_{native.version().replace('.', '_')}"
    assert f'PACKAGE = "{package}"\n' in other['library/wheel.py'].decode()
    assert "'blender': (4, 2, 0)," in other['__init__.py'].decode()
    held = read_all(io.BytesIO(other[name]))
    assert held[f'{package}/{library}'] == one[f'lib/{library}']
    assert held[f'{package}/{library}.sha256'] == one[f'lib/{library}.sha256']


def test_a_wheel_has_the_files_that_installers_read(native, tmp_path):
    files = read_all(packed(native, tmp_path / 'made.zip', '--wheel'))
    (name,) = (name for name in files if name.endswith('.whl'))
    distribution, version, _, _, tag = name.removeprefix('wheels/').removesuffix('.whl').split('-')
    held = read_all(io.BytesIO(files[name]))
    info = f'{distribution}-{version}.dist-info'
    assert f'\nName: {distribution}\nVersion: {version}\n' in held[f'{info}/METADATA'].decode()
    assert f'\nTag: py3-none-{tag}\n' in held[f'{info}/WHEEL'].decode()
    record = [line.split(',') for line in held.pop(f'{info}/RECORD').decode().splitlines()]
    assert record.pop() == [f'{info}/RECORD', '', '']
    assert {path: (of_it, int(size)) for path, of_it, size in record} == {
        path: (f'sha256={digest(content)}', len(content)) for path, content in held.items()}


def digest(content):
    """SHA-256 in the form of a wheel's RECORD."""
    return base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip('=')


@pytest.mark.parametrize('platforms, tag', [('linux-arm64', 'manylinux_2_17_aarch64'), ('windows-x64', 'win_amd64'),
                                            ('macos-arm64,macos-x64', 'macosx_11_0_universal2')])
def test_a_wheel_has_the_tag_of_its_platforms(native, tmp_path, platforms, tag):
    files = read_all(packed(native, tmp_path / 'made.zip', '--wheel', platforms=platforms))
    assert [name for name in files if name.endswith(f'-py3-none-{tag}.whl')]
    listed = ', '.join(f'"{platform}"' for platform in platforms.split(','))
    assert f'\nplatforms = [{listed}]\n' in files['blender_manifest.toml'].decode()


@pytest.mark.parametrize('options', [(), ('--wheel',)], ids=['folder', 'wheel'])
def test_the_website_is_in_all_files_that_link_to_it(native, tmp_path, options):
    files = read_all(packed(native, tmp_path / 'made.zip', 'https://example.org/dd', *options))
    for name, line in (('blender_manifest.toml', '\nwebsite = "https://example.org/dd"\n'),
                       ('website.py', 'WEBSITE = "https://example.org/dd"\n'),
                       ('__init__.py', "'tracker_url': \"https://example.org/dd/issues\",\n")):
        assert line in files[name].decode()


@pytest.mark.parametrize('name, line', [('CMakeLists.txt', 'VERSION {}.{}.{} '),
                                        ('addon/detail_deform/blender_manifest.toml', 'version = "{}.{}.{}"\n'),
                                        ('addon/detail_deform/__init__.py', "'version': ({}, {}, {}),"),
                                        ('CHANGELOG.md', '## [{}.{}.{}]')])
def test_one_version_everywhere(native, name, line):
    text = (ADDON.parents[1] / name).read_text(encoding='utf-8')
    assert line.format(*native.version().split('.')) in text
