# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on is updated while another Blender of the same user has its library loaded; the user's folder has a name
outside of ASCII."""

import os
import subprocess

import pytest

from conftest import FIXTURES, starts_blender
from test_bake import command
from test_updating import NEWER, OF_BOTH, OLDER, zip_of

INSTALL = '''
older, newer, role, _ = sys.argv[-4:]
extension = bpy.app.version >= (4, 2, 0)
module = 'bl_ext.user_default.detail_deform' if extension else 'detail_deform'

def install(path):
    if extension:
        bpy.ops.extensions.package_install_files(filepath=path, repo='user_default', enable_on_install=True)
    else:
        bpy.ops.preferences.addon_install(filepath=path, overwrite=True)
        bpy.ops.preferences.addon_enable(module=module)

def wait():
    print('waits', flush=True)
    sys.stdin.readline()

if role == 'updates':
    install(older)
else:
    bpy.ops.preferences.addon_enable(module=module)
bpy.ops.wm.open_mainfile(filepath=fixture)
deforms(module)
wait()
if role == 'updates':
    install(newer)
deforms(module)
wait()
'''


class Other:
    """Another Blender, which runs a script and waits at each wait() in it."""

    def __init__(self, arguments, environment):
        self._process = subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                         stderr=subprocess.STDOUT, text=True, encoding='utf-8', env=environment)

    def step(self):
        """Runs up to the next wait(); returns the lines that start with "deforms", and all lines."""
        lines = []
        for line in self._process.stdout:
            if line.startswith('waits'):
                return [said for said in lines if said.startswith('deforms')], lines
            lines.append(line.strip())
        raise AssertionError('\n'.join(lines))

    def go_on(self):
        self._process.stdin.write('\n')
        self._process.stdin.flush()

    def end(self):
        self._process.communicate('\n')
        return self._process.returncode


@pytest.mark.thorough
@starts_blender
def test_an_update_while_another_blender_has_the_library(tmp_path, part):
    library = part('library.native').library_path()
    script, profile = tmp_path / 'script.py', tmp_path / 'Größe 画像'
    script.write_text(OF_BOTH.replace(', version(module)', '') + INSTALL, encoding='utf-8')
    profile.mkdir()
    # Blender's Python prints UTF-8 on every system, but Python with the module bpy prints in Windows' own encoding, in
    # which the installer of 5.2 fails to print the folder's name.
    environment = {**os.environ, 'BLENDER_USER_RESOURCES': str(profile), 'DETAIL_DEFORM_LIBRARY': '',
                   'PYTHONIOENCODING': 'utf-8'}
    others = {}
    for role in ('updates', 'uses'):
        folder = tmp_path / role
        folder.mkdir()
        arguments = [zip_of(OLDER, folder, library), zip_of(NEWER, folder, library), role,
                     str(FIXTURES / 'animated.blend')]
        others[role] = Other(command(script, *arguments), environment)
        assert others[role].step()[0] == [f"deforms True {OLDER} ['folder'] []"], role
    others['updates'].go_on()
    said, all_of_it = others['updates'].step()
    assert said == [f"deforms True {NEWER} ['folder'] []"], '\n'.join(all_of_it)
    others['uses'].go_on()
    said, all_of_it = others['uses'].step()
    assert len(said) == 1 and said[0].startswith(f"deforms True {OLDER}"), '\n'.join(all_of_it)
    assert [other.end() for other in others.values()] == [0, 0]
