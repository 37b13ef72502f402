# SPDX-License-Identifier: GPL-3.0-or-later
"""Reloads the add-on's modules when Blender reloads only its top-level file: up to 4.1 when a new version replaces one
that is in use, and in any Blender by Reload Scripts."""

import ast
import sys
from importlib import reload
from pathlib import Path


def reload_modules(package, folder):
    """Reloads each loaded module after those that its present file imports, so that names imported from a module are of
    the new version. New modules are loaded by their importers; removed ones have none."""
    for parts in _in_order(Path(folder)):
        module = sys.modules.get('.'.join((package, *parts)))
        if module and module.__name__ != __name__:
            reload(module)


def _in_order(folder):
    """The modules below a folder, ('scene', 'files') for scene/files.py, each after those that it imports:
    depth-first, in post-order."""
    paths = {_parts(path.relative_to(folder)): path for path in sorted(folder.rglob('*.py'))}
    begun, order = {()}, []

    def visit(parts):
        if parts in paths and parts not in begun:
            begun.add(parts)
            for other in _imports(paths[parts], parts):
                visit(other)
            order.append(parts)
    for parts in paths:
        visit(parts)
    return order


def _parts(path):
    parts = path.with_suffix('').parts
    return parts[:-1] if parts[-1] == '__init__' else parts


def _imports(path, parts):
    """Yields the modules that a file imports relatively, its packages, and imported names, which may be modules."""
    package = parts if path.name == '__init__.py' else parts[:-1]
    yield package
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.ImportFrom) and node.level:
            start = (*package[:len(package) + 1 - node.level], *(node.module.split('.') if node.module else ()))
            yield start
            yield from ((*start, alias.name) for alias in node.names)
