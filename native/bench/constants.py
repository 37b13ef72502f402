# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tuned constants of the core change: each is halved and doubled, and the scenes of constants.cpp run again.

    python3 native/bench/constants.py [--build build/constants] [--only REGEX] [--scenes NAME...] > constants.md

Builds a copy of the sources in which each constant whose comment doesn't call it derived or safety can be set by an
environment variable. Prints a table row for each: the largest displacement of any vertex in any scene, as a fraction of
the scene's box; the scene with the largest change of its measure, before and after; and the ratio of the processor
time of all scenes. Integers are halved to 1 at least.
"""
import argparse
import os
import re
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
COPIED = ('CMakeLists.txt', 'native', 'tests', 'addon')
# Rooms without tuned constants of the method: vector widths, limits of arguments.
LEFT_OUT = ('kernels', 'api')
# Numbers that stand for something and are no choice, and those that the compiler has to know.
NOT_VARIED = ('kPi', 'kDegree', 'kTermCount', 'kMethodCount', 'kFree', 'kFixed', 'kNone',
              'kMaxSharedRounds')
SETTER = '''#pragma once
#include <cstdlib>
#include <cstring>
namespace dd {
/// The value of a constant, or the one that DD_VARIED sets: "name=value".
template <class Number>
Number varied(const char* name, Number value) {
  const char* set = std::getenv("DD_VARIED");
  const std::size_t length = std::strlen(name);
  if (!set || std::strncmp(set, name, length) != 0 || set[length] != '=') return value;
  return static_cast<Number>(std::atof(set + length + 1));
}
}  // namespace dd
'''
DECLARATION = re.compile(
    r'^(?P<indent> *)(?P<static>static )?constexpr (?P<type>double|int|size_t|Index|float) (?P<rest>k\w+ =[^;{]*);',
    re.MULTILINE)
VALUE = re.compile(r'(k\w+) =\s*([-+0-9.e* /kPi]+?)(?=,\s*k\w+ =|$)')


class Constant:
    def __init__(self, file, name, kind, value):
        self.file, self.name, self.whole, self.value = file, name, kind not in ('double', 'float'), value

    @property
    def key(self):
        return f'{self.file}:{self.name}'

    def times(self, factor):
        return max(1, int(self.value * factor)) if self.whole else self.value * factor


def comment_of(text, at):
    """The comment that belongs to a declaration: of its line, or of the lines above."""
    lines = text[:at].split('\n')[:-1]
    own = text[at:].split('\n', 1)[0].partition('//')[2]
    above = []
    while lines and lines[-1].lstrip().startswith('//'):
        above.insert(0, lines.pop())
    return ' '.join(line.strip(' /') for line in (*above, own))


def made_variable(text, file, constants):
    """The source with its tuned constants read at start; adds them to `constants`."""
    def replace(match):
        reason = comment_of(text, match.start())
        if re.search(r'\b([Dd]erived|[Ss]afety)\b', reason):
            return match[0]
        kind, rest = match['type'], match['rest']
        for name, value in VALUE.findall(rest):
            if name in NOT_VARIED:
                return match[0]
            number = float(eval(value.replace('kPi', str(np.pi))))
            constants.append(Constant(file, name, kind, number))
            varied = f'{name} = varied("{file}:{name}", {kind}({value}))'
            rest = re.sub(rf'\b{name} =\s*{re.escape(value)}', varied, rest)
        inside = match['indent'] or match['static']
        linkage = 'inline static ' if match['static'] else 'static ' if inside else 'inline '
        return f"{match['indent']}{linkage}const {kind} {rest};"

    changed = DECLARATION.sub(replace, text)
    return changed if changed == text else changed.replace('#include', '#include "support/varied.h"\n#include', 1)


def copy_of_sources(tree):
    """Writes the sources, their constants made variable, and returns these."""
    constants = []
    listed = subprocess.run(['git', '-C', ROOT, 'ls-files', '-z', '-co', '--exclude-standard', *COPIED], check=True,
                            capture_output=True, text=True)
    for name in filter(None, listed.stdout.split('\0')):
        path = tree / name
        path.parent.mkdir(parents=True, exist_ok=True)
        text = (ROOT / name).read_bytes()
        parts = Path(name).parts
        if parts[:2] == ('native', 'src') and parts[2] not in LEFT_OUT and path.suffix in ('.cpp', '.h'):
            text = made_variable(text.decode(), '/'.join(parts[2:]), constants).encode()
        if not path.exists() or path.read_bytes() != text:
            path.write_bytes(text)
    setter = tree / 'native' / 'src' / 'support' / 'varied.h'
    if not setter.exists() or setter.read_text() != SETTER:
        setter.write_text(SETTER)
    return constants


def built(build, jobs):
    tree = build / 'tree'
    constants = copy_of_sources(tree)
    subprocess.run(['cmake', '-S', tree, '-B', build / 'made', '-G', 'Ninja', '-D', 'CMAKE_BUILD_TYPE=Release',
                    '-D', 'DETAIL_DEFORM_TESTS=OFF', '-D', 'DETAIL_DEFORM_WERROR=OFF'], check=True, stdout=2)
    subprocess.run(['cmake', '--build', build / 'made', '-j', str(jobs), '--target', 'constants'], check=True, stdout=2)
    return build / 'made' / 'native' / 'bench' / 'constants', constants


def scenes_of(constant):
    """The scenes whose names begin so can depend on a constant; the others take their time for nothing."""
    room = constant.file.partition('/')[0]
    return {'match': ('match', 'transfer'), 'transfer': ('transfer', 'garment'), 'wear': ('garment',),
            **dict.fromkeys(('base', 'deform', 'methods'), ('deform',)),
            **dict.fromkeys(('reconstruction', 'solver', 'systems'), ('deform', 'garment', 'transfer: by p'))
            }.get(room, ())


def on_one_processor():
    """Runs the process that is about to start on one processor, and so with one thread."""
    os.sched_setaffinity(0, {os.getpid() % os.cpu_count()})


def results(program, scenes=(), varied=''):
    """By scene: (positions, measure, ms)."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'positions'
        printed = subprocess.run([program, file, *scenes], check=False, capture_output=True, text=True,
                                 timeout=600, env={**os.environ, 'DD_VARIED': varied},
                                 preexec_fn=on_one_processor).stdout
        numbers, found, at = file.read_bytes(), {}, 0
        for line in printed.splitlines():
            name, measure, ms = line.split('\t')
            count = int.from_bytes(numbers[at:at + 8], 'little')
            found[name] = np.frombuffer(numbers, np.float64, count, at + 8).reshape(-1, 3), float(measure), float(ms)
            at += 8 + 8 * count
    return found


def compared(usual, changed):
    """(largest displacement, where, (scene, measure before, after), ratio of times). Both: results() of the same
    scenes; infinite where one has no result."""
    moved, measures = {}, {}
    for name, (positions, measure, _) in usual.items():
        if name not in changed or len(changed[name][0]) != len(positions):
            moved[name] = np.inf
            continue
        moved[name] = np.abs(changed[name][0] - positions).max()
        measures[name] = measure, changed[name][1]
    where = max(moved, key=moved.get)
    scene = max(measures, key=lambda name: abs(measures[name][1] - measures[name][0]), default=where)
    common = [name for name in usual if name in changed]
    time = sum(changed[name][2] for name in common) / sum(usual[name][2] for name in common)
    return moved[where], where, (scene, *measures.get(scene, (np.nan, np.nan))), time


def row(program, usual, constant, scenes):
    cells, unchanged = [constant.key, f'{constant.value:g}'], True
    scenes = tuple(scenes) or scenes_of(constant)
    expected = {name: found for name, found in usual.items() if not scenes or name.startswith(scenes)}
    for factor in (0.5, 2):
        value = constant.times(factor)
        if value == constant.value:
            cells += ['', '', '']
            continue
        try:
            changed = results(program, scenes, f'{constant.key}={value!r}')
            far, where, (scene, before, after), time = compared(expected, changed)
        except subprocess.TimeoutExpired:
            cells += ['takes over 10 minutes', '', '']
            continue
        unchanged = unchanged and far == 0
        cells += [f'{far:.1e} ({where})' if far else '0', f'{scene}: {before:.4g} → {after:.4g}' if before != after else
                  '', f'{time:.2f}']
    return unchanged, '| ' + ' | '.join(cells) + ' |'


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--build', type=Path, default=ROOT / 'build' / 'constants')
    parser.add_argument('--only', default='', help="constants whose file:name matches")
    parser.add_argument('--scenes', nargs='+', default=(), help="beginnings of names; those that a constant can change")
    parser.add_argument('--jobs', type=int, default=os.cpu_count())
    given = parser.parse_args()
    program, constants = built(given.build.resolve(), given.jobs)
    constants = [constant for constant in constants if re.search(given.only, constant.key)]
    usual = results(program, given.scenes)
    print('| constant | value | halved: moves by | measure | time | doubled: moves by | measure | time |')
    print('|---|---|---|---|---|---|---|---|')
    unchanged = []
    with ThreadPoolExecutor(given.jobs) as pool:
        rows = pool.map(lambda one: row(program, usual, one, given.scenes), constants)
        for constant, (same, line) in zip(constants, rows):
            print(line, flush=True)
            if same:
                unchanged.append(constant)
    print('\nNothing moves with: ' + ', '.join(constant.key for constant in unchanged))


if __name__ == '__main__':
    main()
