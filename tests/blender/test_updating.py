# SPDX-License-Identifier: GPL-3.0-or-later
"""Versions that follow one another: installed, used, updated while in use, and removed, in a profile of its own."""
import os
import re
import subprocess
import sys
import zipfile

import bpy
import pytest
from conftest import FIXTURES

OLDER, NEWER = '98.0.0', '99.0.0'
OF_BOTH = '''
import os, sys
import bpy
fixture = sys.argv[-1]

def deforms(module):
    ob = bpy.data.objects['Tentacle']
    bpy.context.view_layer.objects.active = ob
    if not ob.detail_deform.is_bound:
        bpy.ops.object.detail_deform_bind(wait=True)
    moved = []
    for shift in (0.3, -0.3):
        before = offsets(ob)
        ob.detail_deform.handles[0].target.location.z += shift
        bpy.context.view_layer.update()
        moved.append(abs(offsets(ob) - before).max())
    print('deforms', min(moved) > 0.01, sys.modules[module + '.handlers'].VERSION, version(module), loaded(),
          stale(module))

def version(module):
    """Of the files it was loaded from."""
    with open(os.path.join(os.path.dirname(sys.modules[module].__file__), 'blender_manifest.toml')) as file:
        return next(line.split('"')[1] for line in file if line.startswith('version ='))

def offsets(ob):
    import numpy as np
    found = np.zeros(3 * len(ob.data.vertices), np.float32)
    ob.data.attributes['detail_deform_offset'].data.foreach_get('vector', found)
    return found

def stale(module):
    """The classes and functions that a module has of another one, and that one has not any more."""
    ours = {name: part for name, part in sys.modules.items()
            if name.startswith(module + '.') and os.path.exists(part.__file__)}
    return [f'{name}.{key}' for name, part in ours.items() for key, value in vars(part).items()
            if getattr(value, '__qualname__', '').isidentifier() and getattr(value, '__module__', None) in ours
            and getattr(ours[value.__module__], value.__name__, value) is not value]

def loaded():
    """The libraries in memory, and whether their files are there."""
    if not os.path.exists('/proc/self/maps'):
        return [True]
    lines = [line.split(maxsplit=5)[5].strip() for line in open('/proc/self/maps') if 'libdetail_deform' in line]
    return sorted({not line.endswith('(deleted)') for line in lines})

def left(folder):
    files = [os.path.join(at, name) for at, _, names in os.walk(folder) for name in names]
    return [path for path in files if 'detail_deform' in path]
'''
LEGACY = """
def install(path):
    bpy.ops.preferences.addon_install(filepath=path, overwrite=True)
    bpy.ops.preferences.addon_enable(module='detail_deform')

older, newer = sys.argv[-3:-1]
install(older)
bpy.ops.wm.open_mainfile(filepath=fixture)
deforms('detail_deform')
install(newer)  # over one that is enabled and bound
deforms('detail_deform')
import addon_utils
addon_utils.disable('detail_deform', default_set=True)
print('switched off', loaded())
import shutil
shutil.rmtree(os.path.join(bpy.utils.user_resource('SCRIPTS', path='addons'), 'detail_deform'))
print('left', left(os.environ['BLENDER_USER_RESOURCES']))
"""
EXTENSION = '''
import shutil
module = 'bl_ext.detail_deform_test.detail_deform'
older, newer = sys.argv[-3:-1]
repository = os.path.join(os.environ['BLENDER_USER_RESOURCES'], 'published')
scripts = os.path.join(bpy.utils.resource_path('LOCAL'), 'scripts', 'addons_core', 'bl_pkg', 'cli', 'blender_ext.py')

def publish(path):
    """As the release does it: one version, and the index by Blender's own tool."""
    import subprocess
    shutil.rmtree(repository, ignore_errors=True)
    os.makedirs(repository)
    shutil.copy(path, repository)
    subprocess.run([sys.executable, scripts, 'server-generate', '--repo-dir', repository], check=True,
                   stdout=subprocess.DEVNULL)

publish(older)
bpy.context.preferences.system.use_online_access = True
bpy.ops.preferences.extension_repo_add(name='detail_deform_test', type='REMOTE',
                                       remote_url='file://' + repository + '/index.json')
repos = bpy.context.preferences.extensions.repos
index = next(k for k, repo in enumerate(repos) if repo.remote_url.startswith('file://'))
repos[index].module = 'detail_deform_test'

def sync():
    bpy.ops.extensions.repo_sync(repo_index=index)

sync()
bpy.ops.extensions.package_install(repo_index=index, pkg_id='detail_deform', enable_on_install=True)
bpy.ops.wm.open_mainfile(filepath=fixture)
deforms(module)
publish(newer)
sync()
bpy.ops.extensions.package_upgrade_all()
deforms(module)
bpy.ops.extensions.package_uninstall(repo_index=index, pkg_id='detail_deform')
print('switched off', loaded())
print('enabled', module in bpy.context.preferences.addons)
shutil.rmtree(repository)
print('left', [path for path in left(repos[index].directory) if '.blender_ext' not in path])
'''


# Modules that one version has and the other hasn't, and two that import one another the other way round.
MODULES = {OLDER: {'scene/only_older.py': "from .made_first import VERSION, Made\n",
                   'scene/made_first.py': "from .made_second import VERSION, Made\n",
                   'scene/made_second.py': f"VERSION = '{OLDER}'\n\n\nclass Made:\n    pass\n",
                   'handlers.py': "\nfrom .scene.only_older import VERSION, Made\n"},
           NEWER: {'follow/only_newer.py': "from ..scene.made_second import VERSION, Made\n",
                   'scene/made_second.py': "from .made_first import VERSION, Made\n",
                   'scene/made_first.py': f"VERSION = '{NEWER}'\n\n\nclass Made:\n    pass\n",
                   'handlers.py': "\nfrom .follow.only_newer import VERSION, Made\n"}}


def zip_of(version, folder):
    """The tested zip as that version, which a module inside knows, too."""
    tested = os.environ['DD_TEST_ZIP']
    path = folder / re.sub(r'-[0-9.]+-', f'-{version}-', os.path.basename(tested))
    added = {f'detail_deform/{name}': text.encode() for name, text in MODULES[version].items()}
    with zipfile.ZipFile(tested) as source, zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as target:
        for entry in source.infolist():
            content = source.read(entry)
            if entry.filename.endswith('blender_manifest.toml'):
                content = re.sub(rb'\nversion = "[0-9.]+"', b'\nversion = "%s"' % version.encode(), content)
            if entry.filename == 'detail_deform/__init__.py':
                content = re.sub(rb"'version': \([0-9, ]+\)", b"'version': (%s)" % version.replace('.', ', ').encode(),
                                 content)
            target.writestr(entry, content + added.pop(entry.filename, b''))
        for name, content in added.items():
            target.writestr(name, content)
    return str(path)


@pytest.mark.skipif(sys.platform != 'linux', reason="reads /proc, and starts Blender as on Linux")
def test_a_version_replaces_another_that_is_in_use(tmp_path, module):
    script = tmp_path / 'script.py'
    script.write_text(OF_BOTH + (EXTENSION if bpy.app.version >= (4, 2, 0) else LEGACY))
    arguments = [zip_of(OLDER, tmp_path), zip_of(NEWER, tmp_path), str(FIXTURES / 'animated.blend')]
    profile = tmp_path / 'profile'
    profile.mkdir()
    is_module = not bpy.app.binary_path or getattr(bpy.app, 'module', False)
    blender = [sys.executable, str(script), *arguments] if is_module else [
        bpy.app.binary_path, '--background', '--factory-startup', '--python-exit-code', '1', '--python', str(script),
        '--', *arguments]
    ended = subprocess.run(blender, capture_output=True, text=True, timeout=120,
                           env={**os.environ, 'BLENDER_USER_RESOURCES': str(profile), 'DETAIL_DEFORM_LIBRARY': ''})
    said = [line for line in ended.stdout.splitlines() if line.startswith(('deforms', 'switched', 'left', 'enabled'))]
    wanted = [*(f"deforms True {version} {version} [True] []" for version in (OLDER, NEWER)), "switched off []", "left []"]
    if bpy.app.version >= (4, 2, 0):
        wanted.insert(3, "enabled False")
    assert said == wanted, ended.stdout[-3000:] + ended.stderr[-3000:]
    assert 'Traceback' not in ended.stderr, ended.stderr[-3000:]
