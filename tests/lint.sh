# shellcheck shell=bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# The linters, after prepare_linters. Sourced from the repository root. Each function prints its findings, and
# returns non-zero where there are any.

dd_lint_sources() {
    find native tests/native tests/fuzz -name '*.c' -o -name '*.cpp' -o -name '*.h'
}

lint_format() {
    dd_lint_sources | xargs build/venv-linters/bin/clang-format --dry-run -Werror
}

# The length of C and C++ lines, as clang-format leaves long comments as they are. ruff checks Python's.
lint_margin() {
    ! dd_lint_sources | LC_ALL=C.UTF-8 xargs grep -nE '^.{101}'
}

# By the preset "check", a unity build: most of the time goes into reading Eigen, once for each unit. Uses of
# deprecated declarations are all in the headers of libstdc++, which is older than this clang.
lint_tidy() {
    cmake --preset check >/dev/null || return
    build/venv-linters/bin/run-clang-tidy.py -clang-tidy-binary build/venv-linters/bin/clang-tidy \
        -quiet -p build/check -j "$(nproc)" -extra-arg=-Wno-unknown-warning-option \
        -extra-arg=-Wno-deprecated-declarations \
        '/build/check/native/|/native/src/' 2>/dev/null | grep -v '^\[' | sed '/^$/d'
    [ "${PIPESTATUS[0]}" = 0 ]
}

compile_alone() {
    cmake --preset check >/dev/null && python3 tests/compile_alone.py
}

lint_python() {
    build/venv-linters/bin/ruff check --no-cache .
}

lint_shell() {
    build/venv-linters/bin/shellcheck -x .ci/run .github/*.sh addon/*.sh tests/*.sh tests/native/*.sh tests/fuzz/*.sh
}
