# SPDX-License-Identifier: GPL-3.0-or-later
"""Zips the add-on with its library, as users install it. The zip is reproducible: the same sources and library give the
same bytes on any machine and at any time.

    python3 addon/make_zip.py LIBRARY PLATFORMS ZIP [WEBSITE] [--wheel]

PLATFORMS: Blender's names of the platforms that the library is for, separated by commas. WEBSITE: the project's
address, if it has one, to which Blender's and the add-on's buttons lead. The zip serves Blender 3.4 (legacy, by
bl_info) and 4.2 on (extension, by the manifest). With --wheel it is for 4.2 on alone: the library is in a wheel, as
Blender's extensions site wants it."""

import argparse
import base64
import hashlib
import io
import os
import re
import shutil
import subprocess
import sys
import time
import zipfile
from pathlib import Path

from manual_page import page

ADDON = Path(__file__).resolve().parent
SOURCE = ADDON / 'detail_deform'
LICENSES = (ADDON.parent / 'LICENSE', ADDON / 'LICENSES.md')
DISTRIBUTION = 'detail_deform_library'  # the wheel's name


# Blender's name of each platform, and pip's tag for it. The tag names the oldest system that the library is built for.
TAGS = {'linux-x64': 'manylinux_2_17_x86_64', 'linux-arm64': 'manylinux_2_17_aarch64', 'windows-x64': 'win_amd64',
        'macos-arm64': 'macosx_11_0_arm64', 'macos-x64': 'macosx_11_0_x86_64',
        'macos-arm64,macos-x64': 'macosx_11_0_universal2'}


def contents(library, platforms, website, date, in_wheel):
    """(name in the zip, bytes) of each file."""
    files = {path.relative_to(SOURCE): path.read_bytes() for path in SOURCE.rglob('*.py')}
    files.update({Path(path.name): path.read_bytes() for path in LICENSES})
    files[Path('MANUAL.html')] = page((ADDON / 'MANUAL.md').read_text(encoding='utf-8')).encode()
    files.update({path.relative_to(ADDON): path.read_bytes() for path in (ADDON / 'manual').iterdir()})
    manifest = (SOURCE / 'blender_manifest.toml').read_text(encoding='utf-8')
    # An extension repository must not offer the zip to platforms that its library isn't built for.
    listed = ', '.join(f'"{platform}"' for platform in platforms.split(','))
    fields = f'platforms = [{listed}]'
    if in_wheel:
        version = re.search('\nversion = "(.*)"', manifest)[1]
        # The version is in the package's name, so that files of an older version that Windows keeps locked, or that
        # were left behind, don't stand in a new version's way.
        package = f"{DISTRIBUTION}_{version.replace('.', '_')}"
        path = Path('wheels', f'{DISTRIBUTION}-{version}-py3-none-{TAGS[platforms]}.whl')
        files[path] = wheel(library, package, version, TAGS[platforms], date)
        fields += f'\nwheels = ["./{path.as_posix()}"]'
        replace_in(files, 'library/wheel.py', '\nPACKAGE = ""', f'\nPACKAGE = "{package}"')
        replace_in(files, '__init__.py', r"'blender': \(3, 4, 0\)", "'blender': (4, 2, 0)")
    else:
        files.update({Path('lib', name): content for name, content in with_digest(library)})
    manifest = replaced(r'\nplatforms = .*', f'\n{fields}', manifest)
    if website:
        manifest = replaced('\nmaintainer = ', f'\nwebsite = "{website}"\nmaintainer = ', manifest)
        replace_in(files, '__init__.py', 'bl_info = {\n',
                   f"bl_info = {{\n    'doc_url': \"{website}\",\n    'tracker_url': \"{website}/issues\",\n")
        files[Path('website.py')] = f'WEBSITE = "{website}"\n'.encode()
    files[Path('blender_manifest.toml')] = manifest.encode()
    return sorted((f'detail_deform/{path.as_posix()}', content) for path, content in files.items())


def with_digest(library):
    """(name, bytes) of the library's file, and of its checksum, by which the add-on recognizes an incomplete file:
    loading one would crash Blender."""
    content = library.read_bytes()
    return [(library.name, content), (f'{library.name}.sha256', f'{hashlib.sha256(content).hexdigest()}\n'.encode())]


def wheel(library, package, version, tag, date):
    """The bytes of a wheel with the library in a package of this name."""
    info = f'{DISTRIBUTION}-{version}.dist-info'
    metadata = (f'Metadata-Version: 2.1\nName: {DISTRIBUTION}\nVersion: {version}\n'
                'Summary: The C library of the Blender add-on Detail Deform\nLicense: GPL-3.0-or-later\n')
    files = [(f'{package}/__init__.py', b'"""The C library of the Blender add-on Detail Deform, which loads it."""\n'),
             *((f'{package}/{name}', content) for name, content in with_digest(library)),
             *((f'{info}/{path.name}', path.read_bytes()) for path in LICENSES),
             (f'{info}/METADATA', metadata.encode()),
             (f'{info}/WHEEL', f'Wheel-Version: 1.0\nGenerator: make_zip\nRoot-Is-Purelib: false\n'
                               f'Tag: py3-none-{tag}\n'.encode())]
    record = ''.join(f'{name},sha256={digest(content)},{len(content)}\n' for name, content in files)
    made = io.BytesIO()
    with zipfile.ZipFile(made, 'w') as target:
        add_files(target, [*files, (f'{info}/RECORD', f'{record}{info}/RECORD,,\n'.encode())], date)
    return made.getvalue()


def digest(content):
    return base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b'=').decode()


def replace_in(files, name, pattern, text):
    files[Path(name)] = replaced(pattern, text, files[Path(name)].decode()).encode()


def replaced(pattern, text, source):
    result, count = re.subn(pattern, lambda match: text, source)
    if count != 1:
        sys.exit(f"{pattern!r} is there {count} times, not once.")
    return result


def moment():
    """The date for all files in the zip: SOURCE_DATE_EPOCH, else that of the sources' commit, else now."""
    seconds = os.environ.get('SOURCE_DATE_EPOCH')
    if not seconds and shutil.which('git'):
        seconds = subprocess.run(['git', '-C', ADDON, 'log', '-1', '--format=%ct'], capture_output=True,
                                 text=True).stdout.strip()
    return time.gmtime(int(seconds) if seconds else time.time())[:6]


def add_files(target, files, date):
    for name, content in files:
        entry = zipfile.ZipInfo(name, date)
        entry.create_system = 3  # Unix, on every system, for the same bytes
        entry.external_attr = 0o100644 << 16
        target.writestr(entry, content, zipfile.ZIP_DEFLATED, 9)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('library', type=Path)
    parser.add_argument('platforms')
    parser.add_argument('zip')
    parser.add_argument('website', nargs='?', default='')
    parser.add_argument('--wheel', action='store_true')
    asked, date = parser.parse_args(), moment()
    with zipfile.ZipFile(asked.zip, 'w') as target:
        # Before it unpacks a zip, Blender 3.4 to 4.1 removes the folders that the zip has an entry for. Without the
        # entry it would write over the library while that is loaded.
        folder = zipfile.ZipInfo('detail_deform/', date)
        folder.create_system = 3
        folder.external_attr = 0o40755 << 16 | 0x10
        target.writestr(folder, b'')
        add_files(target, contents(asked.library, asked.platforms, asked.website, date, asked.wheel), date)


if __name__ == '__main__':
    main()
