# SPDX-License-Identifier: GPL-3.0-or-later
"""Zips the add-on as users install it, with a library: the same bytes from the same sources, whenever and wherever that
is.

    python3 addon/make_zip.py LIBRARY PLATFORMS ZIP [WEBSITE]

PLATFORMS: Blender's names, with commas between; the library may be for several. WEBSITE: where Blender's own buttons
and the add-on's lead, if there is a place. One zip serves Blender 3.4 (legacy, by bl_info) and 4.2 on (extension, by
the manifest)."""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import time
import zipfile
from pathlib import Path

ADDON = Path(__file__).resolve().parent
SOURCE = ADDON / 'detail_deform'


def contents(library, platforms, website):
    """(name in the zip, bytes) of each file."""
    files = {path.relative_to(SOURCE): path.read_bytes() for path in SOURCE.rglob('*.py')}
    files[Path('LICENSE')] = (ADDON.parent / 'LICENSE').read_bytes()
    for name in ('LICENSES.md', 'MANUAL.md'):
        files[Path(name)] = (ADDON / name).read_bytes()
    files.update({path.relative_to(ADDON): path.read_bytes() for path in (ADDON / 'manual').iterdir()})
    files[Path('lib', library.name)] = library.read_bytes()
    # What the add-on knows the whole library by: a part of one ends Blender where it is loaded.
    digest = hashlib.sha256(library.read_bytes()).hexdigest()
    files[Path('lib', f'{library.name}.sha256')] = f'{digest}\n'.encode()
    manifest = (SOURCE / 'blender_manifest.toml').read_text(encoding='utf-8')
    # A zip must not offer itself to those that its library is not for.
    listed = ', '.join(f'"{platform}"' for platform in platforms)
    manifest = replaced(r'\nplatforms = .*', f'\nplatforms = [{listed}]', manifest)
    if website:
        manifest = replaced('\nmaintainer = ', f'\nwebsite = "{website}"\nmaintainer = ', manifest)
        init = files[Path('__init__.py')].decode()
        files[Path('__init__.py')] = replaced(
            'bl_info = {\n',
            f"bl_info = {{\n    'doc_url': \"{website}\",\n    'tracker_url': \"{website}/issues\",\n", init).encode()
        files[Path('website.py')] = f'WEBSITE = "{website}"\n'.encode()
    files[Path('blender_manifest.toml')] = manifest.encode()
    return sorted((f'detail_deform/{path.as_posix()}', content) for path, content in files.items())


def replaced(pattern, text, source):
    result, count = re.subn(pattern, lambda match: text, source)
    if count != 1:
        sys.exit(f"{pattern!r} is there {count} times, not once.")
    return result


def moment():
    """Of the sources, as a zip has it: SOURCE_DATE_EPOCH's, the commit's, or now."""
    seconds = os.environ.get('SOURCE_DATE_EPOCH')
    if not seconds and shutil.which('git'):
        seconds = subprocess.run(['git', '-C', ADDON, 'log', '-1', '--format=%ct'], capture_output=True,
                                 text=True).stdout.strip()
    return time.gmtime(int(seconds) if seconds else time.time())[:6]


def main(library, platforms, path, website=''):
    date = moment()
    with zipfile.ZipFile(path, 'w') as target:
        # Blender 3.4 to 4.1 removes what is there before it unpacks, by the folder's own entry: or it would write into
        # a library that is loaded.
        folder = zipfile.ZipInfo('detail_deform/', date)
        folder.create_system = 3
        folder.external_attr = 0o40755 << 16 | 0x10
        target.writestr(folder, b'')
        for name, content in contents(Path(library), platforms.split(','), website):
            entry = zipfile.ZipInfo(name, date)
            entry.create_system = 3  # Unix, wherever it is made
            entry.external_attr = 0o100644 << 16
            target.writestr(entry, content, zipfile.ZIP_DEFLATED, 9)


if __name__ == '__main__':
    main(*sys.argv[1:])
