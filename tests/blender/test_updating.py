# SPDX-License-Identifier: GPL-3.0-or-later
"""A version of the add-on is installed, used, replaced by another while in use, and removed, in new user folders."""
import os
import re
import shutil
import subprocess

import bpy
import pytest
from conftest import FIXTURES, REPOSITORY, make_zip, starts_blender
from test_bake import command

OLDER, NEWER = '98.0.0', '99.0.0'
OF_BOTH = '''
import os, pathlib, sys
import bpy
fixture = sys.argv[-1]
sys.path.append(os.path.join(os.path.dirname(fixture), os.pardir, 'tests', 'blender'))
from in_memory import libraries

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
    manifest = pathlib.Path(sys.modules[module].__file__).with_name('blender_manifest.toml').read_text(encoding='utf-8')
    return next(line.split('"')[1] for line in manifest.splitlines() if line.startswith('version ='))

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
    """Where the libraries in memory are from, and whether their files are gone."""
    return sorted({'gone' if not os.path.exists(path) else 'wheel' if '.local' in pathlib.Path(path).parts else 'folder'
                   for path in libraries('detail_deform')})

def is_mended(module):
    """Whether a damaged library is whole again after what the sentence about it says; of a wheel, which isn't unpacked
    again for the same version."""
    native, said = sys.modules[module + '.library.native'], ''
    path = native.library_path()
    native.unload()
    os.remove(path)
    with open(path, 'wb') as file:
        file.write(b'damaged')
    try:
        native.library()
    except native.NativeError as error:
        said = str(error)
    bpy.ops.preferences.addon_disable(module=module)
    bpy.ops.preferences.addon_enable(module=module)
    native.library()
    return "Switch the add-on off and on again" in said

def left():
    """Files of the add-on in the profile, but for Blender's lists of what there is to install."""
    files = [pathlib.Path(at, name).as_posix() for at, _, names in os.walk(os.environ['BLENDER_USER_RESOURCES'])
             for name in names]
    return [path for path in files if '.blender_ext' not in path and (
        'libdetail_deform' in path or 'detail_deform_library' in path or '/detail_deform/' in path)]
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
print('left', left())
"""
EXTENSION = '''
import shutil
module = 'bl_ext.detail_deform_test.detail_deform'
older, newer = sys.argv[-3:-1]
repository = os.path.join(os.environ['BLENDER_USER_RESOURCES'], 'published')
scripts = os.path.join(bpy.utils.system_resource('SCRIPTS'), 'addons_core', 'bl_pkg', 'cli', 'blender_ext.py')

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
                                       remote_url=pathlib.Path(repository, 'index.json').as_uri())
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
if loaded() == ['wheel']:
    print('mended', is_mended(module))
    deforms(module)
bpy.ops.extensions.package_uninstall(repo_index=index, pkg_id='detail_deform')
print('switched off', loaded())
print('enabled', module in bpy.context.preferences.addons)
shutil.rmtree(repository)
print('left', left())
'''


# Code added to the sources of each version: a module that the other version doesn't have, and two modules of which the
# first imports the second in one version and the other way round in the other.
MODULES = {OLDER: {'scene/only_older.py': "from .made_first import VERSION, Made\n",
                   'scene/made_first.py': "from .made_second import VERSION, Made\n",
                   'scene/made_second.py': f"VERSION = '{OLDER}'\n\n\nclass Made:\n    pass\n",
                   'handlers.py': "\nfrom .scene.only_older import VERSION, Made\n"},
           NEWER: {'follow/only_newer.py': "from ..scene.made_second import VERSION, Made\n",
                   'scene/made_second.py': "from .made_first import VERSION, Made\n",
                   'scene/made_first.py': f"VERSION = '{NEWER}'\n\n\nclass Made:\n    pass\n",
                   'handlers.py': "\nfrom .follow.only_newer import VERSION, Made\n"}}


def zip_of(version, folder, library, *options):
    """Packs the sources as that version, which is also the constant VERSION of a module in it."""
    sources = folder / version
    shutil.copytree(REPOSITORY / 'addon', sources / 'addon', ignore=shutil.ignore_patterns('lib', '__pycache__'))
    shutil.copy(REPOSITORY / 'LICENSE', sources)
    addon = sources / 'addon' / 'detail_deform'
    for name, written in (('blender_manifest.toml', f'\nversion = "{version}"'),
                          ('__init__.py', f"'version': ({version.replace('.', ', ')})")):
        text = (addon / name).read_text(encoding='utf-8')
        text, count = re.subn(r'\nversion = "[0-9.]+"|\'version\': \([0-9, ]+\)', written, text)
        assert count == 1
        (addon / name).write_text(text, encoding='utf-8')
    for name, text in MODULES[version].items():
        with open(addon / name, 'a', encoding='utf-8') as file:
            file.write(text)
    path = folder / f'detail_deform-{version}.zip'
    make_zip(library, path, *options, sources=sources)
    return str(path)


IN_WHEEL = ('--wheel',)
since_4_2 = pytest.mark.skipif(bpy.app.version < (4, 2, 0), reason="wheels came with 4.2")


@starts_blender
@pytest.mark.parametrize('older, newer', [pytest.param((), (), id='folder'),
                                          pytest.param(IN_WHEEL, IN_WHEEL, id='wheel', marks=since_4_2),
                                          pytest.param((), IN_WHEEL, id='folder-wheel', marks=since_4_2)])
def test_a_version_replaces_another_that_is_in_use(tmp_path, part, older, newer):
    """Also where one has its library in the add-on's folder and the other in a wheel, as from Blender's extensions
    site."""
    library = part('library.native').library_path()
    script = tmp_path / 'script.py'
    script.write_text(OF_BOTH + (EXTENSION if bpy.app.version >= (4, 2, 0) else LEGACY), encoding='utf-8')
    arguments = [zip_of(OLDER, tmp_path, library, *older), zip_of(NEWER, tmp_path, library, *newer),
                 str(FIXTURES / 'animated.blend')]
    profile = tmp_path / 'profile'
    profile.mkdir()
    ended = subprocess.run(command(script, '--', *arguments), capture_output=True, text=True, timeout=300,
                           env={**os.environ, 'BLENDER_USER_RESOURCES': str(profile), 'DETAIL_DEFORM_LIBRARY': ''})
    said = [line for line in ended.stdout.splitlines()
            if line.startswith(('deforms', 'mended', 'switched', 'left', 'enabled'))]
    wanted = [f"deforms True {version} {version} {['wheel' if options else 'folder']} []"
              for version, options in ((OLDER, older), (NEWER, newer))]
    wanted += ["mended True", wanted[1]] * bool(newer) + ["switched off []"]
    wanted += ["enabled False"] * (bpy.app.version >= (4, 2, 0)) + ["left []"]
    assert said == wanted, ended.stdout[-3000:] + ended.stderr[-3000:]
    assert 'Traceback' not in ended.stderr, ended.stderr[-3000:]
