# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiles each C++ file of build/check's unity build by itself: a unity build hides that a file lacks a header which
another includes. Tests with the headers of Catch2 3 in build/catch3, where there are any.

By the build's own commands, but by clang, which takes a quarter of GCC's time, with the headers of Eigen and Catch2
compiled once for each set of options.
"""
import json
import re
import shlex
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

EIGEN = '#include <Eigen/Core>\n#include <Eigen/SparseCore>\n'
HEADERS = {'/native/src/': EIGEN, '/tests/native/': EIGEN + '#include "native/catch.h"\n'}


def clang(entry):
    """The command of an entry of compile_commands.json, by clang and without its file."""
    words = [word for word in shlex.split(entry['command']) if Path(word).name != 'ccache']
    command = ['clang++', '-I', str(Path('tests').resolve())]
    catch2 = Path('build/catch3/usr/include').resolve()
    if catch2.exists():
        command += ['-isystem', str(catch2), '-DDD_CATCH2_3=1']
    # Of system headers, clang would not say what is declared alone.
    options = ['-I' if word == '-isystem' else word for word in words[1:words.index('-o')]]
    return [*command, *options, '-Wno-unknown-warning-option', '-Wno-error', '-Wundefined-func-template']


def complaints(text):
    """The warnings about the project's files. Of what is declared and defined elsewhere, what is Eigen's: the file
    lacks one of its headers, and the linker alone would say so."""
    for line in text.splitlines():
        here = re.search(r'^(\S*/)?(native|tests)/\S+: warning: ', line)
        if here and ('undefined-func-template' not in line or "function 'Eigen::" in line):
            yield line


def compile_by(command):
    result = subprocess.run(command, check=False, stderr=subprocess.PIPE, text=True)
    said = [result.stderr] if result.returncode else list(complaints(result.stderr))
    print(*said, sep='\n', end='\n' if said else '', file=sys.stderr)
    return not said


def commands(scratch):
    """Compiles the headers; yields the command that compiles each file."""
    with open('build/check/compile_commands.json', encoding='utf-8') as file:
        units = [entry for entry in json.load(file) if entry['file'].endswith('_cxx.cxx')]
    compiled = {}  # options and headers -> precompiled headers
    for unit in units:
        options = clang(unit)
        for source in re.findall(r'#include "(.*)"', Path(unit['file']).read_text(encoding='utf-8')):
            headers = next(text for folder, text in HEADERS.items() if folder in source)
            key = (*options, headers)
            if key not in compiled:
                header = Path(scratch) / f"headers_{len(compiled)}.h"
                header.write_text(headers, encoding='utf-8')
                compiled[key] = f"{header}.pch"
                compile_by([*options, '-x', 'c++-header', str(header), '-o', compiled[key]])
            yield [*options, '-include-pch', compiled[key], '-fsyntax-only', source]


def main():
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(2) as pool:
        results = list(pool.map(compile_by, commands(scratch)))
    print(f"{sum(results)} of {len(results)} files compile")
    return not results or not all(results)


sys.exit(main())
