# SPDX-License-Identifier: GPL-3.0-or-later
"""Matches names of shape keys on two rigs: by a text file, or if they differ in spelling only. Doesn't use Blender."""

import re

from ..scene import files
from ..scene.mesh_data import MeshProblem

_SEPARATORS = ('\t', '->', ',')  # in this order, the first that occurs in a line
_SIDES = {'l': 'l', 'left': 'l', 'r': 'r', 'right': 'r'}
_WORDS = re.compile(r'(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[0-9])(?=[^\W0-9])|(?<=[^\W0-9])(?=[0-9])')
_NO_LETTERS = re.compile(r'[\W_]+')


def read(path):
    """{source's name: target's name} from a file of one pair a line. Empty lines and those that begin with # are
    skipped. Raises MeshProblem."""
    names = {}
    try:
        for number, line in enumerate(files.read_lines(path), 1):
            if line.strip() and not line.lstrip().startswith('#'):
                _add(names, path, number, line)
    except OSError as error:
        raise MeshProblem(f"'{path}' can't be read: {files.reason(error, path)}.") from error
    if not names:
        raise MeshProblem(f"'{path}' has no names: write one pair a line, source -> target.")
    return names


def _add(names, path, number, line):
    parting = next((mark for mark in _SEPARATORS if mark in line), None)
    of_source, of_target = (part.strip() for part in line.split(parting, 1)) if parting else ("", "")
    if not (of_source and of_target):
        raise MeshProblem(f"'{path}', line {number}: '{line.strip()[:40]}' is not a pair of names: part them by a tab, "
                          "a comma or ->.")
    if of_source in names or of_target in names.values():
        twice = of_source if of_source in names else of_target
        raise MeshProblem(f"'{path}', line {number}: '{twice}' is there twice: leave it once.")
    names[of_source] = of_target


def form(name):
    """Normal form (text, side), equal for names that differ only in case, separators, and the spelling or place of left
    and right; None without letters and digits. A side must be a word of its own, set off by a capital, digit or
    separator: Bright is not B_R."""
    words = [word for part in _NO_LETTERS.split(name) for word in _WORDS.sub(' ', part).casefold().split()]
    words = [_SIDES.get(word, word) if len(words) > 1 else word for word in words]
    sides = [word for word in words if word in {'l', 'r'}]
    if len(sides) == 1:  # at any place in the name
        return ''.join(word for word in words if word not in sides), sides[0]
    whole = ''.join(words)
    return (whole, "") if whole else None


def target_names(names, of_target, mapping, alike):
    """{source's name: target's name}, or None where another key goes to that name. names: the source's keys. of_target:
    the target's. mapping: of read(), comes first. alike: whether names of the same form() match."""
    of_target, of_source = dict.fromkeys(of_target), set(names)
    found = {name: mapping[name] for name in names if name in mapping}
    taken, same_form = set(found.values()), {}
    for name in of_target if alike else ():
        if name not in of_source and name not in taken and form(name):
            same_form.setdefault(form(name), []).append(name)
    for name in names:
        if name in found:
            continue
        candidates = [] if name in of_target else same_form.get(form(name), [])
        target_name = candidates.pop() if len(candidates) == 1 else name
        found[name] = None if target_name in taken else target_name
        taken.add(target_name)
    return found
