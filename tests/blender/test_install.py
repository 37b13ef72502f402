# SPDX-License-Identifier: GPL-3.0-or-later
"""The installed zip: it is the code that is tested, it unregisters completely, Blender's validator accepts it, and
scripts that use it end."""
import os
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

from conftest import FIXTURES, bind, evaluated, make_strip, make_zip, own, update
from in_memory import libraries

EVENTS = ('depsgraph_update_post', 'frame_change_post', 'undo_post', 'redo_post', 'load_post')


def test_the_installed_zip_is_what_runs(module, part):
    resources = Path(os.environ['BLENDER_USER_RESOURCES']).resolve()
    assert resources in Path(module.__file__).resolve().parents
    native = part('library.native')
    assert resources in Path(native.library_path()).resolve().parents
    bind(make_strip(9))
    loaded = libraries('detail_deform')
    # A system that can't be asked what it has loaded is taken at ctypes' word.
    assert native.library_path() in ([native.library()._name] if loaded is None else loaded)


def our_handlers(module):
    return [f for event in EVENTS for f in getattr(bpy.app.handlers, event)
            if getattr(f, '__module__', '').startswith(module.__name__)]


def our_menu_entries(module):
    return [f for menu in dir(bpy.types) if menu.startswith(('VIEW3D_MT', 'OBJECT_MT'))
            for f in getattr(getattr(bpy.types, menu).draw, '_draw_funcs', ())
            if getattr(f, '__module__', '').startswith(module.__name__)]


def our_types():
    return [name for name in dir(bpy.types) if 'detail_deform' in name.lower() or name.startswith('DetailDeform')]


def test_unregister_leaves_nothing_and_register_brings_all_back(module):
    types, entries = our_types(), len(our_menu_entries(module))
    assert len(our_handlers(module)) == len(EVENTS) and len(types) > 20 and entries >= 2
    module.unregister()
    try:
        assert our_handlers(module) == []
        assert our_menu_entries(module) == []
        assert our_types() == []
        assert not hasattr(bpy.types.Object, 'detail_deform')
        assert not [name for name in dir(bpy.ops.object) if name.startswith('detail_deform')]
    finally:
        module.register()
    assert len(our_handlers(module)) == len(EVENTS)
    assert our_types() == types and len(our_menu_entries(module)) == entries


def test_bindings_come_back_after_disabling_and_enabling(module):
    ob = bind(make_strip())
    ob.detail_deform.handles[0].target.location.z += 0.4
    update()
    posed = evaluated(ob)
    module.unregister()
    module.register()
    assert not ob.detail_deform.is_bound
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    assert ob.detail_deform.is_bound
    ob.detail_deform.handles[0].target.location.z -= 0.1
    update()
    assert abs(evaluated(ob) - posed).max() < 1e-6
    assert abs(posed - own(ob)).max() > 0.3


@pytest.mark.skipif(bpy.app.version < (4, 2, 0), reason="extensions came with 4.2")
@pytest.mark.parametrize('options', [None, (), ('--wheel',)], ids=['tested', 'folder', 'wheel'])
def test_blenders_own_validator_accepts_the_zip(part, tmp_path, options):
    """The tested zip, and both kinds that are packed from the sources here."""
    tool = Path(bpy.utils.system_resource('SCRIPTS'), 'addons_core', 'bl_pkg', 'cli', 'blender_ext.py')
    assert tool.exists()
    path = os.environ['DD_TEST_ZIP']
    if options is not None:
        path = tmp_path / 'made.zip'
        make_zip(part('library.native').library_path(), path, *options)
    # sys.executable is Blender's Python, or with the module bpy the Python that runs this.
    checked = subprocess.run([sys.executable, tool, 'validate', path], capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout + checked.stderr


@pytest.mark.skipif(not getattr(bpy.app, 'module', False), reason="Blender as a Python module only")
def test_a_script_that_enables_it_ends_without_a_word(module):
    script = "import sys, addon_utils; assert addon_utils.enable(sys.argv[1]); print('enabled')"
    ended = subprocess.run([sys.executable, '-c', f'import bpy; {script}', module.__name__], capture_output=True,
                           text=True, timeout=60)
    assert ended.returncode == 0 and 'enabled' in ended.stdout, ended.stdout + ended.stderr
    assert 'Traceback' not in ended.stdout + ended.stderr, ended.stderr


@pytest.mark.skipif(not getattr(bpy.app, 'module', False), reason="Blender as a Python module only")
def test_a_script_that_only_registers_ends(module):
    script = ("import sys; sys.path.insert(0, sys.argv[1])\n"
              "import bpy, detail_deform\n"
              "detail_deform.register()\n"
              "bpy.ops.wm.open_mainfile(filepath=sys.argv[2])\n"
              "bpy.context.view_layer.objects.active = bpy.data.objects['Tentacle']\n"
              "bpy.ops.object.detail_deform_bind(wait=True)\n"
              "print(bpy.data.objects['Tentacle'].detail_deform.status)\n")
    ended = subprocess.run([sys.executable, '-c', script, str(Path(module.__file__).parents[1]),
                            str(FIXTURES / 'animated.blend')],
                           capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0 and 'Bound' in ended.stdout, ended.stdout[-2000:] + ended.stderr[-2000:]
