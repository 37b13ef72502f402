# SPDX-License-Identifier: GPL-3.0-or-later
"""Loading and unloading of the library, on which updates of the add-on and switching it off rest."""

import os
import shutil
import subprocess
import sys
import threading

import numpy as np
import pytest
from conftest import ADDON, IDENTITY, Strip, is_sanitized, part

# A sanitizer needs the shared C++ library, and symbols that are unique in a process keep libraries in memory.
leaves_memory = pytest.mark.skipif(is_sanitized(), reason="what is built for a sanitizer stays loaded")
WINDOWS = sys.platform == 'win32'
AS_INSTALLED = """
import ctypes, gc, os, shutil, sys
package, here = sys.argv[1:]
sys.path[:0] = [package, here]
from conftest import IDENTITY, Strip
from library import loading, native
mesh = Strip(20)

def bound():
    return native.Bind(mesh.positions, mesh.triangles, mesh.roles, 1).finish()

def is_mapped():
    name = os.path.basename(native.library_path())
    if sys.platform == 'win32':
        of_module = ctypes.WinDLL('kernel32').GetModuleHandleW
        of_module.restype = ctypes.c_void_p
        # Its name in memory stays that with which it was loaded.
        return of_module(name) is not None
    return sys.platform == 'linux' and name in open('/proc/self/maps', encoding='utf-8').read()
"""


@pytest.fixture
def installed(native, tmp_path):
    """run(script): runs it in a process of its own, with the add-on's package and the library in a folder with letters
    of several alphabets, and returns what it prints."""
    package = tmp_path / 'Ünïcode 目录 и' / 'detail_deform'
    shutil.copytree(ADDON / 'library', package / 'library', ignore=shutil.ignore_patterns('__pycache__'))
    (package / 'lib').mkdir()
    environment = {**os.environ, 'PYTHONIOENCODING': 'utf-8', 'TMP': str(tmp_path), 'TMPDIR': str(tmp_path)}
    name = os.path.basename(native.library_path())
    shutil.copy(native.library_path(), package / 'lib' / name)
    environment.pop('DETAIL_DEFORM_LIBRARY', None)

    def run(script):
        ended = subprocess.run([sys.executable, '-c', AS_INSTALLED + script, str(package), os.path.dirname(__file__)],
                               capture_output=True, env=environment, timeout=300)
        errors = ended.stderr.decode('utf-8', 'replace')
        assert ended.returncode == 0, errors
        return ended.stdout.decode('utf-8').splitlines(), errors
    run.package, run.temporary = package, tmp_path
    return run


@leaves_memory
def test_objects_that_are_alive_go_with_the_library(installed):
    lines, errors = installed("""
deformer, running = bound(), native.Bind(mesh.positions, mesh.triangles, mesh.roles, 1)
first = deformer.offsets(IDENTITY + .1)
print(loading.unload(), is_mapped())
for use in (lambda: deformer.offsets(IDENTITY), running.finish, running.progress):
    try:
        use()
    except native.NativeError as error:
        print(error)
del deformer, running
gc.collect()
print((bound().offsets(IDENTITY + .1) == first).all(), loading.unload(), is_mapped())
""")
    assert lines[0] == 'True False' and lines[-1] == 'True True False', lines
    assert len(lines) == 5 and all(line.endswith(" is null.") for line in lines[1:4]), lines
    assert not errors


@leaves_memory
def test_loading_again_and_again(installed):
    """Windows has 1,088 slots for threads' own data; a runtime linked into the library must free its own."""
    lines, errors = installed("""
for k in range(1300):
    native.library()
    assert sys.platform == 'darwin' or is_mapped()
    if k % 100 == 0:
        kept = bound()
        kept.offsets(IDENTITY)
    assert loading.unload() and not is_mapped()
print(k)
""")
    assert lines == ['1299'] and not errors


def test_a_folder_whose_library_is_loaded_can_be_replaced(installed):
    """An update does so, on Windows too, where a loaded file is locked. The file set aside goes at the next start."""
    lines, errors = installed("""
deformer = bound()
shutil.copytree(package, package + ' 2')
shutil.rmtree(package)
os.rename(package + ' 2', package)
print(abs(deformer.offsets(IDENTITY + .1)).max() > .05)
""")
    assert lines == ['True'] and not errors
    left = [name for name in os.listdir(installed.temporary) if name.startswith('detail_deform-')]
    assert len(left) == WINDOWS
    installed("bound()")
    again = [name for name in os.listdir(installed.temporary) if name.startswith('detail_deform-')]
    assert len(again) == WINDOWS and (not WINDOWS or again != left)
    assert len(os.listdir(installed.package / 'lib')) == 1


def test_a_call_under_way_is_waited_for(native):
    """The library is unloaded between two calls of another thread, never during one."""
    loading = part('library.loading')
    mesh, said, stop = Strip(60), [], threading.Event()

    def work():
        while not stop.is_set():
            try:
                deformer = native.Bind(mesh.positions, mesh.triangles, mesh.roles, 1).finish()
                for _ in range(20):
                    assert np.isfinite(deformer.offsets(IDENTITY + .1)).all()
            except native.NativeError as error:
                said.append(str(error))

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    try:
        assert all(loading.unload() for _ in range(30))
    finally:
        stop.set()
        for thread in threads:
            thread.join()
    assert said and all("switched off" in sentence or "null" in sentence for sentence in said), said


def test_a_library_in_use_stays(native, monkeypatch):
    loading = part('library.loading')
    monkeypatch.setattr(loading, '_LEAVE_SECONDS', 0.05)
    before = native.library()
    with loading.staying():
        assert not loading.unload()
    assert native.library() is before


def test_objects_of_a_library_that_could_not_be_unloaded_stay_its_own(installed):
    """As when an update loads the add-on's modules again while a call is still under way."""
    lines, errors = installed("""
import importlib
kept, loading._LEAVE_SECONDS = bound(), .05
with loading.staying():
    print(loading.unload())
    shutil.copytree(package, package + ' 2')
    os.rename(package, package + ' 1')
    os.rename(package + ' 2', package)
    importlib.reload(loading)
    native.library = loading.library
    loading.library()
del kept
gc.collect()
print(loading.unload())
""")
    assert lines == ['False', 'True'] and not errors


def test_only_outside_of_blenders_extensions_is_a_file_set_aside(installed):
    """Blender replaces the files of its extensions in its own way."""
    lines, errors = installed("""
import importlib
extension = os.path.join(os.path.dirname(package), 'bl_ext', 'user_default', 'detail_deform')
shutil.copytree(package, extension)
sys.path[:0] = [os.path.dirname(package)]
for name in ('library', 'bl_ext.user_default.detail_deform.library'):
    unlocking = importlib.import_module(f'{name}.unlocking')
    unlocking.unlock = lambda path: print(path == native.library_path())
    importlib.import_module(f'{name}.loading').library()
""")
    assert lines == ['True'] and not errors


def test_a_library_in_a_wheel(installed):
    """Blender unpacks the wheel, maybe after Python has looked into that folder."""
    (installed.package / 'library' / 'wheel.py').write_text("PACKAGE = 'detail_deform_library_1_0_0'\n")
    lines, errors = installed("""
import hashlib
site = os.path.join(package, 'site-packages')
os.mkdir(site)
sys.path.append(site)
cure = "Switch the add-on off and on again"

def refused(words):
    try:
        native.library()
    except native.NativeError as error:
        return words in str(error) and cure in str(error)

os.rename(os.path.join(package, 'lib'), os.path.join(site, 'unpacked'))
print(refused("is missing: there is no file " + os.path.join(package, 'detail_deform_library_1_0_0')))
os.rename(os.path.join(site, 'unpacked'), os.path.join(site, 'detail_deform_library_1_0_0'))
with open(os.path.join(site, 'detail_deform_library_1_0_0', '__init__.py'), 'w'):
    pass
path = native.library_path()
print(os.path.dirname(os.path.dirname(path)) == site, abs(bound().offsets(IDENTITY + .1)).max() > .05)
loading.unload()
with open(path + '.sha256', 'w') as record:
    print(64 * '0', file=record)
print(refused("damaged"))
""")
    assert lines == ['True', 'True True', 'True'] and not errors


def test_a_file_that_cannot_be_set_aside_stays(installed, tmp_path):
    lines, errors = installed("""
from library import unlocking
path = native.library_path()
size = os.path.getsize(path)
print(unlocking.set_aside(path), os.path.getsize(path) == size, os.listdir(os.path.dirname(path)))
unlocking.tempfile.tempdir = os.path.join(package, 'nowhere')
print(unlocking.set_aside(path), os.path.getsize(path) == size, os.listdir(os.path.dirname(path)))
""")
    name = os.listdir(installed.package / 'lib')
    assert len(name) == 1 and lines == [f"True True {name}", f"False True {name}"] and not errors
