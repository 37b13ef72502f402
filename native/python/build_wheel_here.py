# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the wheel of the library: a backend as pip asks for one, which needs nothing beside Python and CMake.

DETAIL_DEFORM_LIBRARY: a library that is built already, to be packed as it is."""

import base64
import hashlib
import os
import re
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / 'addon' / 'detail_deform' / 'library'
NAME = 'detail_deform_native'
NAMES = {'win32': 'detail_deform.dll', 'darwin': 'libdetail_deform.dylib'}
INIT = '''"""Detail-preserving surface deformation for numpy."""

from .library.native import *  # noqa: F403
from .library.native import __all__, version  # noqa: F401
'''


def _version():
    return re.search(r'project\(detail_deform VERSION ([0-9.]+)', (ROOT / 'CMakeLists.txt').read_text())[1]


def _metadata():
    text = (Path(__file__).parent / 'README.md').read_text(encoding='utf-8')
    return (f"Metadata-Version: 2.1\nName: {NAME}\nVersion: {_version()}\nLicense: GPL-3.0-or-later\n"
            "Requires-Python: >=3.10\nRequires-Dist: numpy\nDescription-Content-Type: text/markdown\n\n" + text)


def _library(folder):
    given = os.environ.get('DETAIL_DEFORM_LIBRARY')
    if given:
        return Path(given).read_bytes()
    build = Path(folder) / 'build'
    subprocess.run(['cmake', '-S', ROOT, '-B', build, '-DCMAKE_BUILD_TYPE=Release', '-DDETAIL_DEFORM_TESTS=OFF',
                    '-DDETAIL_DEFORM_BENCH=OFF', '-DDETAIL_DEFORM_UNITY=ON', '-DDETAIL_DEFORM_STAGE=OFF'], check=True)
    subprocess.run(['cmake', '--build', build, '--config', 'Release', '--parallel', '--target', 'detail_deform'],
                   check=True)
    name = NAMES.get(sys.platform, 'libdetail_deform.so')
    return next(path for path in sorted((build / 'native').rglob(name))).read_bytes()


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """As PEP 517 has it: the name of the wheel in that folder."""
    platform = sysconfig.get_platform().replace('-', '_').replace('.', '_')
    tag, info = f'py3-none-{platform}', f'{NAME}-{_version()}.dist-info'
    files = {f'{NAME}/library/{path.name}': path.read_bytes() for path in sorted(SOURCES.glob('*.py'))}
    files[f'{NAME}/__init__.py'] = INIT.encode()
    files[f"{NAME}/lib/{NAMES.get(sys.platform, 'libdetail_deform.so')}"] = _library(wheel_directory)
    files[f'{info}/METADATA'] = _metadata().encode()
    files[f'{info}/WHEEL'] = f"Wheel-Version: 1.0\nGenerator: {NAME}\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    lines = []
    for name, content in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b'=').decode()
        lines.append(f'{name},sha256={digest},{len(content)}')
    files[f'{info}/RECORD'] = '\n'.join([*lines, f'{info}/RECORD,,', '']).encode()
    wheel = f'{NAME}-{_version()}-{tag}.whl'
    with zipfile.ZipFile(Path(wheel_directory) / wheel, 'w', zipfile.ZIP_DEFLATED) as target:
        for name, content in files.items():
            target.writestr(name, content)
    return wheel


class UnsupportedOperation(Exception):
    """What PEP 517 has a backend raise that makes no source archive."""


def build_sdist(sdist_directory, config_settings=None):
    raise UnsupportedOperation("There is no source archive: build the wheel, from the project's sources.")
