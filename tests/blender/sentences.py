# SPDX-License-Identifier: GPL-3.0-or-later
"""All texts that users read: the sentences in the sources of the add-on and of the C library, and the labels that
Blender shows. In a sentence, … stands for each part that is filled in when it is shown."""

import ast
import re

import bpy

# Exceptions and functions whose first argument is the sentence of a refusal.
SPEAKERS = {'MeshProblem', 'MirrorsItself', 'NotACache', 'poll_message_set'}


def literals(tree):
    """Every text of a Python source but docstrings and the pieces of f-strings, with its node."""
    skipped = set()
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node) is not None:
            skipped.add(node.body[0].value)
        if isinstance(node, ast.JoinedStr):
            skipped.update(node.values)
    for node in ast.walk(tree):
        text = text_of(node)
        if text is not None and node not in skipped:
            yield node, text


def text_of(node):
    """The text of a node that is a string or an f-string, else None."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return ''.join(part.value if isinstance(part, ast.Constant) else '…' for part in node.values)
    return None


def sources(folder):
    """(path, tree) of each Python file."""
    for path in sorted(folder.rglob('*.py')):
        yield path, ast.parse(path.read_text(encoding='utf-8'))


def texts(folder):
    """(file:line, text) of all texts with more than one word or with a full stop."""
    return [(f'{path.relative_to(folder)}:{node.lineno}', text) for path, tree in sources(folder)
            for node, text in literals(tree) if ' ' in text.strip() or text.endswith('.')]


def refusals(folder):
    """(file:line, sentence) of all refusals of the add-on."""
    for path, tree in sources(folder):
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and getattr(call.func, 'attr', getattr(call.func, 'id', "")) in SPEAKERS:
                text = text_of(call.args[0]) if call.args else None
                if text and text != '…':
                    yield f'{path.relative_to(folder)}:{call.lineno}', text


def native_sentences(folder):
    """The C library's sentences: the string literals of each statement of its sources, joined."""
    for path in sorted((*folder.rglob('*.cpp'), *folder.rglob('*.h'))):
        source = re.sub(r'//.*', '', path.read_text(encoding='utf-8'))
        for statement in source.split(';'):
            pieces = re.split(r'"((?:[^"\\]|\\.)*)"', statement)
            text = pieces[1] if len(pieces) > 1 else ""
            for between, piece in zip(pieces[2::2], pieces[3::2]):
                text += '…' * bool(between.strip()) + piece
            if text:
                yield text


def labels(folder):
    """The labels of all buttons, fields, menus and panels of the add-on."""
    found = set()
    settings = bpy.types.Object.bl_rna.properties['detail_deform'].fixed_type
    groups = [settings, *(settings.properties[name].fixed_type
                          for name in ('handles', 'examples', 'missing_examples', 'expressions', 'transfer'))]
    operators = [getattr(kind, name).get_rna_type() for kind in (bpy.ops.object, bpy.ops.wm) for name in dir(kind)
                 if name.startswith('detail_deform')]
    found.update(operator.name for operator in operators)
    for rna in (*groups, *operators):
        for prop in rna.properties:
            found.add(prop.name)
            if prop.type == 'ENUM':
                found.update(item.name for item in prop.enum_items)
    for kind in dir(bpy.types):
        if 'detail_deform' in kind:
            found.add(getattr(getattr(bpy.types, kind), 'bl_label', ""))
    for _, tree in sources(folder / 'ui'):
        found.update(text_of(keyword.value) for call in ast.walk(tree) if isinstance(call, ast.Call)
                     for keyword in call.keywords if keyword.arg == 'text' and text_of(keyword.value))
        found.update(text for node, text in literals(tree) if text in {"Cancel", "Follow"})
    return {label.replace('{}', '').strip(' ,') for label in found} - {"", "…"}
