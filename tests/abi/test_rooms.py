# SPDX-License-Identifier: GPL-3.0-or-later
"""The folders of the add-on and of the core know those below them alone, as their imports and includes say."""

import ast
import re

import pytest
from conftest import ADDON

# From the bottom up. The modules beside them (properties, handlers) come where their imports put them.
FOLDERS = ['library', 'scene', 'follow', 'setup', 'results', 'operators']
ALSO = {'ui': 'operators'}  # of the same height, and neither knows the other
MODULES = sorted(ADDON.rglob('*.py'))


def _module_of(path):
    """('follow', 'life') of follow/life.py, () of __init__.py."""
    parts = path.relative_to(ADDON).with_suffix('').parts
    return parts[:-1] if parts[-1] == '__init__' else parts


def _is_module(parts):
    return ADDON.joinpath(*parts).with_suffix('.py').exists() or ADDON.joinpath(*parts, '__init__.py').exists()


def imports(path):
    """The add-on's modules that this one imports, wherever it does."""
    package = path.relative_to(ADDON).parent.parts
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if not isinstance(node, ast.ImportFrom) or not node.level:
            continue
        base = package[:len(package) + 1 - node.level] + tuple((node.module or '').split('.') if node.module else ())
        for name in node.names:
            yield (*base, name.name) if _is_module((*base, name.name)) else base


def room(module):
    """A folder, or a module that lies beside the folders; '' is the add-on itself."""
    return module[0] if module else ''


def arrows():
    """{(room, room that it knows)}"""
    found = {(room(_module_of(path)), room(other)) for path in MODULES for other in imports(path)}
    return {(one, other) for one, other in found if one != other}


def height(folder):
    return FOLDERS.index(ALSO.get(folder, folder))


def test_the_folders_are_those_that_have_an_order():
    folders = {path.parent.name for path in ADDON.glob('*/__init__.py')}
    assert folders == {*FOLDERS, *ALSO}


@pytest.mark.parametrize('folder', [*FOLDERS, *ALSO])
def test_a_folder_knows_those_below_it_alone(folder):
    known = {other for one, other in arrows() if one == folder and other in {*FOLDERS, *ALSO}}
    assert not [other for other in known if height(other) >= height(folder)]


def test_only_what_is_above_a_folder_is_known_by_what_lies_beside():
    """Through modules beside the folders no way leads back up: no room is reached from itself."""
    known = {}
    for one, other in arrows():
        known.setdefault(one, set()).add(other)

    def reached(start):
        found, left = set(), [start]
        while left:
            for other in known.get(left.pop(), ()):
                if other not in found:
                    found.add(other)
                    left.append(other)
        return found

    assert not [one for one in known if one in reached(one)]


def test_a_module_is_not_imported_in_a_circle():
    graph = {_module_of(path): set(imports(path)) for path in MODULES}
    free = set()
    while len(free) < len(graph):
        more = {module for module, others in graph.items() if module not in free and others - {module} <= free}
        assert more, sorted(set(graph) - free)
        free |= more


def test_nobody_imports_the_add_on_by_its_name():
    """It has another one as an extension."""
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            names = [node.module or ''] if isinstance(node, ast.ImportFrom) and not node.level else [
                alias.name for alias in getattr(node, 'names', ())] if isinstance(node, ast.Import) else []
            assert not any(name.split('.')[0] == 'detail_deform' for name in names), path


def test_both_kinds_of_what_follows_have_all_that_their_life_asks_for():
    def tree(name):
        return ast.parse((ADDON / 'follow' / f'{name}.py').read_text(encoding='utf-8'))

    asked = {node.attr for node in ast.walk(tree('life'))
             if isinstance(node, ast.Attribute) and getattr(node.value, 'id', None) == 'kind'}
    assert {'cache', 'has', 'check', 'Frame'} <= asked
    for kind in ('bound', 'fed'):
        names = {name for node in tree(kind).body for name in (
            [target.id for target in node.targets] if isinstance(node, ast.Assign) else [getattr(node, 'name', None)])}
        assert asked <= names, asked - names


# The core's, from the bottom up, with those that each may know.
CORE = ADDON.parents[1] / 'native' / 'src'
CORE_KNOWS = {
    'support': (), 'mesh': ('support',), 'kernels': ('support', 'mesh'), 'solver': ('support', 'kernels'),
    'systems': ('support', 'mesh', 'kernels', 'solver'),
    'reconstruction': ('support', 'mesh', 'kernels', 'solver', 'systems'),
    'base': ('support', 'mesh', 'kernels', 'solver', 'systems', 'reconstruction'),
    'methods': ('support', 'mesh', 'kernels', 'solver', 'systems', 'reconstruction', 'base'),
    'match': ('support', 'mesh', 'kernels', 'solver', 'systems', 'reconstruction'),
    'transfer': ('support', 'mesh', 'kernels', 'solver', 'systems', 'reconstruction'),
    'wear': ('support', 'mesh', 'kernels', 'solver', 'systems', 'reconstruction', 'transfer'),
}
CORE_FRONT = ('deform', 'api')  # each knows all above


def core_arrows():
    found = {}
    for path in sorted(CORE.rglob('*')):
        if path.suffix in {'.h', '.cpp'}:
            room = path.relative_to(CORE).parts[0]
            for other in re.findall(r'^#include "(\w+)/', path.read_text(encoding='utf-8'), re.MULTILINE):
                if other not in {room, 'detail_deform'}:
                    found.setdefault(room, set()).add(other)
    return found


def test_the_core_has_those_folders():
    assert {path.name for path in CORE.iterdir() if path.is_dir()} == {*CORE_KNOWS, *CORE_FRONT}


def test_a_folder_of_the_core_knows_those_below_it_alone():
    arrows = core_arrows()
    assert not {room: others - set(CORE_KNOWS[room]) for room, others in arrows.items()
                if room in CORE_KNOWS and others - set(CORE_KNOWS[room])}
    assert 'api' not in arrows['deform']


# Modules with names that change while the add-on runs, beside session.py, which holds the others: the library's own
# life, which needs no Blender; whether the add-on is registered, and what of Blender's it has added to.
OF_THEIR_OWN = {('session',), ('timers',), ('library', 'loading'), (), ('ui', 'sidebar')}


def test_memory_between_calls_is_declared_in_the_session():
    """Each with the event that ends it: a bare dict, list or set of a module would outlive undo and loading."""
    found = {}
    for path in MODULES:
        tree = ast.parse(path.read_text(encoding='utf-8'))
        empty = [target.id for node in tree.body if isinstance(node, ast.Assign) and (
            isinstance(node.value, (ast.Dict, ast.List)) and not ast.unparse(node.value).strip('{}[]') or
            ast.unparse(node.value) == 'set()') for target in node.targets]
        assigned = [name for node in ast.walk(tree) if isinstance(node, ast.Global) for name in node.names]
        if (empty or assigned) and _module_of(path) not in OF_THEIR_OWN:
            found['.'.join(_module_of(path))] = sorted({*empty, *assigned})
    assert not found
