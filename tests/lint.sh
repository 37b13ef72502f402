# shellcheck shell=bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# What is looked at without running it. Sourced from the repository root; each function prints
# what it finds and returns non-zero where it found something.

dd_lint_sources() {
    find native tests/native tests/fuzz -name '*.c' -o -name '*.cpp' -o -name '*.h'
}

lint_format() {
    dd_lint_sources | xargs clang-format --dry-run -Werror
}

# clang-format leaves long comments as they are; Python's lines are ruff's.
lint_margin() {
    ! dd_lint_sources | LC_ALL=C.UTF-8 xargs grep -nE '^.{101}'
}

# Several files at a time, as tests/run.sh builds them: reading Eigen once for each is most of it.
lint_tidy() {
    cmake --preset check >/dev/null || return
    run-clang-tidy -quiet -p build/check -j "$(nproc)" -extra-arg=-Wno-unknown-warning-option \
        '/build/check/native/|/native/src/' 2>/dev/null | grep -v '^clang-tidy' | sed '/^$/d'
    [ "${PIPESTATUS[0]}" = 0 ]
}

lint_python() {
    build/venv-ruff/bin/ruff check --no-cache .
}

lint_shell() {
    shellcheck -x .ci/run .github/*.sh addon/*.sh tests/*.sh tests/native/*.sh tests/fuzz/*.sh
}
