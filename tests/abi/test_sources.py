# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's sources keep SECURITY.md's promises: nothing but the library is loaded, no text becomes code,
no other program is started, nothing is sent."""

import ast

import pytest
from conftest import ADDON

# All modules that the add-on imports besides its own. Think before adding one: none may use the network, start
# programs, or make objects or code of files.
IMPORTS = {'_ctypes', 'array', 'ast', 'atexit', 'blf', 'bmesh', 'bpy', 'bpy_extras', 'collections', 'colorsys',
           'contextlib', 'copy', 'ctypes', 'dataclasses', 'enum', 'fnmatch', 'functools', 'glob', 'gpu', 'gpu_extras',
           'hashlib', 'importlib', 'itertools', 'json', 'math', 'mathutils', 'numpy', 'os', 'pathlib', 'platform',
           're', 'shlex', 'shutil', 'struct', 'sys', 'tempfile', 'textwrap', 'threading', 'time', 'types', 'typing',
           'unicodedata', 'uuid', 'weakref', 'webbrowser'}
OF_OS = {'O_BINARY', 'O_CREAT', 'O_RDWR', 'environ', 'fdopen', 'fstat', 'getpid', 'listdir', 'open', 'path', 'remove',
         'rename', 'replace', 'urandom'}
# Names and attributes, whoever they belong to.
NEVER = {'__import__', 'allow_pickle', 'breakpoint', 'driver_namespace', 'eval', 'exec', 'execfile', 'exec_module',
         'fromstring', 'import_module', 'loads', 'memmap', 'use_scripts_auto_execute', 'urlopen'}
# Names that could do harm, and the only files that may use them.
ONLY_IN = {'CDLL': {'library/loading.py'}, '_ctypes': {'library/loading.py'}, 'rename': {'library/unlocking.py'},
           'tempfile': {'library/unlocking.py'}, 'webbrowser': {'ui/preferences.py'}, 'environ': {'library/loading.py'},
           'open': {'library/packed.py', 'results/alembic.py', 'scene/files.py', 'scene/pc2.py', 'ui/preferences.py'},
           'write_text': {'ui/preferences.py'}, 'savetxt': {'setup/pair_lists.py'},
           'handlers': {'handlers.py', '__init__.py'}, 'reload': {'__init__.py', 'reloading.py'}}
READING = {'get', 'items', 'keys', 'values'}  # of a dictionary
SOURCES = sorted(ADDON.rglob('*.py'))


def names(tree):
    """(name, line) of all names, attributes and keyword arguments."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.id, node.lineno
        elif isinstance(node, ast.Attribute):
            yield node.attr, node.lineno
        elif isinstance(node, ast.keyword) and node.arg:
            yield node.arg, node.value.lineno


def imports(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.split('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module.split('.')[0]


@pytest.mark.parametrize('path', SOURCES, ids=lambda path: path.relative_to(ADDON).as_posix())
def test_a_source_does_nothing_that_it_must_not(path):
    tree, where = ast.parse(path.read_text(encoding='utf-8')), path.relative_to(ADDON).as_posix()
    assert set(imports(tree)) <= IMPORTS
    for name, line in names(tree):
        assert name not in NEVER, f"{where}:{line}: {name}"
        allowed = ONLY_IN.get(name)
        assert allowed is None or where in allowed, f"{where}:{line}: {name}"
    for call in ast.walk(tree):
        if isinstance(call, ast.Call) and getattr(call.func, 'id', getattr(call.func, 'attr', "")) == 'compile':
            assert isinstance(call.func, ast.Attribute) and call.func.value.id == 're', f"{where}:{call.lineno}"
        if isinstance(call, ast.Attribute) and getattr(call.value, 'id', "") == 'os':
            assert call.attr in OF_OS, f"{where}:{call.lineno}: os.{call.attr}"


@pytest.mark.parametrize('path', SOURCES, ids=lambda path: path.relative_to(ADDON).as_posix())
def test_the_table_of_modules_is_only_read(path):
    """sys.modules belongs to all add-ons, and to Blender."""
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        changed = getattr(node, 'targets', None) or [getattr(node, 'target', None)]
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr not in READING:
            changed = [node.func.value]
        changed = [ast.unparse(target) for target in changed if target]
        assert not [target for target in changed if target.startswith('sys.modules')], node.lineno


def test_no_driver_runs_a_text():
    """A driver of type SCRIPTED would run its expression."""
    text = (ADDON / 'scene' / 'dependency.py').read_text(encoding='utf-8')
    assert "driver.type = 'SUM'" in text
    assert not [path for path in SOURCES if 'SCRIPTED' in path.read_text(encoding='utf-8')
                or '.expression =' in path.read_text(encoding='utf-8')]
