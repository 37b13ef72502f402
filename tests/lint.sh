# shellcheck shell=bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# What is looked at without running it, after prepare_linters. Sourced from the repository root; each function
# prints what it finds and returns non-zero where it found something.

dd_lint_sources() {
    find native tests/native tests/fuzz -name '*.c' -o -name '*.cpp' -o -name '*.h'
}

lint_format() {
    dd_lint_sources | xargs build/venv-linters/bin/clang-format --dry-run -Werror
}

# clang-format leaves long comments as they are; Python's lines are ruff's.
lint_margin() {
    ! dd_lint_sources | LC_ALL=C.UTF-8 xargs grep -nE '^.{101}'
}

# Several files at a time, as tests/run.sh builds them: reading Eigen once for each is most of it. What is
# deprecated is in the headers of GCC's library, which is older than this clang.
lint_tidy() {
    cmake --preset check >/dev/null || return
    build/venv-linters/bin/run-clang-tidy.py -clang-tidy-binary build/venv-linters/bin/clang-tidy \
        -quiet -p build/check -j "$(nproc)" -extra-arg=-Wno-unknown-warning-option \
        -extra-arg=-Wno-deprecated-declarations \
        '/build/check/native/|/native/src/' 2>/dev/null | grep -v '^\[' | sed '/^$/d'
    [ "${PIPESTATUS[0]}" = 0 ]
}

# What the tests are compiled from, by the build's own commands and with the headers that prepare_catch3 got. By
# clang, which takes a quarter of GCC's time for it; after prepare_clang.
compile_with_catch3() {
    cmake --preset check >/dev/null || return
    python3 - <<'PYTHON'
import json
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HEADERS = Path('build/catch3/usr/include').resolve()


def compiles(entry):
    words = shlex.split(entry['command'])
    words = [word for word in words if Path(word).name != 'ccache']
    words[:1] = ['clang++', '-isystem', str(HEADERS), '-DDD_CATCH2_3=1', '-fsyntax-only',
                 '-Wno-unknown-warning-option']
    return subprocess.run(words, cwd=entry['directory'], check=False).returncode == 0


with open('build/check/compile_commands.json') as commands:
    entries = [entry for entry in json.load(commands)
               if '/tests/native/' in entry['file'] and not entry['file'].endswith('.c')]
with ThreadPoolExecutor(2) as pool:
    results = list(pool.map(compiles, entries))
print(f"{sum(results)} of {len(results)} units of tests compile")
sys.exit(not results or not all(results))
PYTHON
}

lint_python() {
    build/venv-linters/bin/ruff check --no-cache .
}

lint_shell() {
    build/venv-linters/bin/shellcheck -x .ci/run .github/*.sh addon/*.sh tests/*.sh tests/native/*.sh tests/fuzz/*.sh
}
