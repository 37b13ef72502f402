# SPDX-License-Identifier: GPL-3.0-or-later
"""Each folder of the add-on and of the core uses only those on floors below its own (CONTRIBUTING.md), as its imports
and includes say."""

import ast
import re

import pytest
from conftest import ADDON

# From the lowest floor up. Modules beside the folders (properties, handlers) have no floor, but may not close a circle.
FOLDERS = ['library', 'scene', 'follow', 'setup', 'results', 'operators']
ALSO = {'ui': 'operators'}  # on the same floor: neither may use the other
MODULES = sorted(ADDON.rglob('*.py'))


def _module_of(path):
    """('follow', 'lifecycle') of follow/lifecycle.py, () of __init__.py."""
    parts = path.relative_to(ADDON).with_suffix('').parts
    return parts[:-1] if parts[-1] == '__init__' else parts


def _is_module(parts):
    return ADDON.joinpath(*parts).with_suffix('.py').exists() or ADDON.joinpath(*parts, '__init__.py').exists()


def imports(path):
    """The add-on's modules that a file imports, at its top and in functions."""
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
    """{(room, another room that it uses)}"""
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


def test_no_room_is_reached_from_itself():
    """Nor through the modules that lie beside the folders."""
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
    """An extension's package has another name."""
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            names = [node.module or ''] if isinstance(node, ast.ImportFrom) and not node.level else [
                alias.name for alias in getattr(node, 'names', ())] if isinstance(node, ast.Import) else []
            assert not any(name.split('.')[0] == 'detail_deform' for name in names), path


def test_both_kinds_of_followers_define_all_that_life_uses():
    def tree(name):
        return ast.parse((ADDON / 'follow' / f'{name}.py').read_text(encoding='utf-8'))

    asked = {node.attr for node in ast.walk(tree('lifecycle'))
             if isinstance(node, ast.Attribute) and getattr(node.value, 'id', None) == 'kind'}
    assert {'cache', 'has', 'compare', 'Frame'} <= asked
    for kind in ('handle_follower', 'source_follower'):
        names = {name for node in tree(kind).body for name in (
            [target.id for target in node.targets] if isinstance(node, ast.Assign) else [getattr(node, 'name', None)])}
        assert asked <= names, asked - names


# The core's folders from the lowest floor up, with those that each may use.
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
CORE_FRONT = ('deform', 'api')  # may use all of the above


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
