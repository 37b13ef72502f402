#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Installs missing packages, builds, and tests the core, the C ABI, and the add-on's zip in this system's Blender,
# in background and in its window. The last line is a summary.
#
# tests/run.sh           for somebody who has just cloned the repository; leaves out the cases marked "large" and
#                        "thorough"
# tests/run.sh --all     all cases, and besides the linters, the address, undefined-behaviour and thread sanitizers,
#                        fuzzing, the benchmarks, the paper's figures, each C++ file compiled by itself (tests against
#                        Catch2 3), two other versions of Blender as the Python module bpy, and Windows and its
#                        Blender through Wine: has to pass before a commit is shared
#
# First come the steps that keep all cores busy, one by one, then those that leave a core free, two at a time. The
# output of the latter is shown when they have ended.
#
# shellcheck disable=SC2329  # functions that are called through step and beside
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit
# shellcheck source=tests/prepare.sh
source tests/prepare.sh
# shellcheck source=tests/lint.sh
source tests/lint.sh
# shellcheck source=tests/windows.sh
source tests/windows.sh
# shellcheck source=tests/windows_blender.sh
source tests/windows_blender.sh
# shellcheck source=tests/window.sh
source tests/window.sh

all=false
case ${1:-} in
    --all) all=true ;;
    "") ;;
    *) dd_complain "tests/run.sh [--all]"; exit 2 ;;
esac
passed=0 failed=0 skipped=0 steps_beside=0
failures=() notes=()

logs=$(mktemp -d) || exit
trap 'rm -rf "$logs"' EXIT
trap 'stop; exit 130' INT
declare -A running=()  # process id -> "NAME|LOG" of a step started by beside

# ended NAME STATUS: counts a step that has ended; returns its status.
ended() {
    if [ "$2" = 0 ]; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        failures+=("$1")
    fi
    return "$2"
}

# step NAME COMMAND...: runs a command, shows its output and counts it; returns its status.
step() {
    local name=$1 began=$SECONDS status=0
    shift
    dd_say "$name"
    "$@" || status=$?
    dd_say "$((SECONDS - began)) s: $name"
    ended "$name" "$status"
}

# beside NAME COMMAND...: starts a step that leaves a core free, as soon as at most one other is running.
# Its output is shown when it has ended.
beside() {
    local log
    while [ ${#running[@]} -ge 2 ]; do wait_for_one; done
    log=$logs/$((++steps_beside))
    dd_say "begins: $1"
    (
        SECONDS=0 status=0
        "${@:2}" </dev/null || status=$?
        dd_say "$SECONDS s: $1"
        exit "$status"
    ) >"$log" 2>&1 &
    running[$!]="$1|$log"
}

# Waits until one of the steps started by beside has ended, shows its output and counts it.
wait_for_one() {
    local process status=0 each these=("${!running[@]}")
    wait -n -p process || status=$?
    [ -z "${process:-}" ] || these=("$process")  # empty where all have ended already: then all are shown
    for each in "${these[@]}"; do
        [ -n "${running[$each]:-}" ] || continue
        dd_say "${running[$each]%|*}"
        cat "${running[$each]##*|}"
        ended "${running[$each]%|*}" "$status"
        unset "running[$each]"
    done
}

# Ends the steps started by beside, which Ctrl-C doesn't reach, and shows what they have printed.
stop() {
    local each
    for each in "${!running[@]}"; do
        dd_say "not ended: ${running[$each]%|*}"
        cat "${running[$each]##*|}"
        end_with_children "$each"
    done
}

# end_with_children PROCESS: ends it and its descendants one by one, as some are in process groups of their own.
end_with_children() {
    local child
    for child in $(pgrep -P "$1"); do end_with_children "$child"; done
    kill "$1" 2>/dev/null
}

skip() {
    skipped=$((skipped + 1))
    notes+=("skipped: $1")
}

# The summary counts suites. The number of tests is in each suite's own output above.
finish() {
    while [ ${#running[@]} != 0 ]; do wait_for_one; done
    echo
    [ ${#notes[@]} = 0 ] || printf '%s\n' "${notes[@]}"
    [ ${#failures[@]} = 0 ] || printf 'FAILED: %s\n' "${failures[@]}"
    echo "suites: $passed passed, $failed failed, $skipped skipped"
    [ "$failed" = 0 ]
    exit
}

abi_tests() {
    "$python" -m pytest -q -p no:cacheprovider tests/abi
}

# sanitized_abi_tests PRESET RUNTIMES [PYTEST OPTION...]
sanitized_abi_tests() {
    local preset=$1 runtimes=$2
    shift 2
    # Python isn't built with the sanitizers, so their runtime has to be preloaded; and it leaks memory at exit, so
    # that leaks aren't reported. --capture=sys leaves stderr open: pytest must not swallow the report of a race.
    LD_PRELOAD=$runtimes ASAN_OPTIONS=detect_leaks=0 TSAN_OPTIONS="halt_on_error=1 suppressions=tests/tsan.supp" \
        DETAIL_DEFORM_LIBRARY=$PWD/build/$preset/native/libdetail_deform.so \
        "$python" -m pytest -q -p no:cacheprovider --capture=sys tests/abi "$@"
}

# The files to preload for clang's address sanitizer. At its start it looks for the exception functions of
# libstdc++, which Python doesn't load by itself.
address_sanitizer() {
    echo "$(clang++ -print-file-name="libclang_rt.asan-$(uname -m).so")" \
        "$(clang++ -print-file-name=libstdc++.so.6)"
}

# blender_suite MARKS COMMAND...: tests the zip in the Blender that COMMAND starts, with new user folders.
blender_suite() {
    local resources status
    resources=$(mktemp -d)
    BLENDER_USER_RESOURCES=$resources "${@:2}" "$zip" -m "$1"
    status=$?
    rm -rf "$resources"
    return "$status"
}

# native_tests [CTEST OPTION...]: "-j 2" where no other step runs at the same time.
native_tests() {
    ctest --preset check --output-on-failure "$@"
}

# All Debian packages are installed before the steps that run side by side: only one apt can run at a time, and it
# must not replace files that a test is using.
prepare_build || { failures+=("getting what the build needs"); failed=1; finish; }
dd_need_packages ccache python3-numpy python3-pytest || true
python=python3
for candidate in /usr/bin/python3 python3; do
    if "$candidate" -c 'import numpy, pytest' 2>/dev/null; then
        python=$candidate
        break
    fi
done
# Debian's Blender runs the system's Python, and imports the system's pytest.
blender=false window=false
if prepare_blender && dd_need_packages python3-pytest; then
    blender=true
    if prepare_window; then
        window=true
    else
        skip "the window: Xvfb, xdotool or ImageMagick could not be had"
    fi
else
    skip "Debian's Blender: it could not be had"
fi

sanitized=false threads=false windows=false windows_python=false windows_blender=false wheels=()
quick_marks="not large and not thorough"
marks=$quick_marks
if $all; then
    marks=  # the first Blender runs all tests
    step "margin" lint_margin
    if prepare_linters; then
        step "format (clang-format)" lint_format
        step "shell (shellcheck)" lint_shell
        step "Python (ruff)" lint_python
        step "C++ (clang-tidy)" lint_tidy
    else
        skip "the linters: their versions could not be had from PyPI"
    fi
    step "build (check)" build_preset check all addon_zip extension_zip || finish
    step "core and library (ctest)" native_tests -j 2
    if [ -e /usr/include/catch2/catch_all.hpp ]; then
        notes+=("the tests were compiled against Catch2 3, which is this system's own")
    elif ! prepare_catch3; then
        notes+=("Catch2 3 could not be had")
    fi
    if ! prepare_clang; then
        skip "each file by itself: clang could not be had"
    else
        step "each file compiles alone" compile_alone
    fi
    # By clang, to see the warnings of a second compiler, and because it compiles with these sanitizers in half of
    # GCC's time.
    if ! prepare_clang; then
        skip "fuzzing and sanitizers: clang could not be had"
    elif step "build (sanitize)" build_preset sanitize; then
        sanitized=true
        step "core under sanitizers (ctest)" ctest --preset sanitize -j 2 --output-on-failure
        step "build (fuzz targets)" build_preset sanitize fuzz_targets
    else
        skip "fuzzing and sanitizers: they are not built"
    fi
    if step "build (tsan)" build_preset tsan; then
        threads=true
    else
        skip "threads under their sanitizer: they are not built"
    fi
    if ! prepare_windows; then
        skip "Windows: mingw-w64 or Wine could not be had"
    elif step "build (windows)" build_preset windows all addon_zip; then
        windows=true
        if prepare_windows_python; then
            windows_python=true
        else
            skip "C ABI under Wine: a Python for Windows could not be had"
        fi
        if prepare_windows_wheel 3.11 4.5.15; then
            windows_blender=true
        else
            skip "bpy 4.5.15 for Windows: it could not be had, or does not run under Wine"
        fi
    else
        skip "Windows: it is not built"
    fi
    for wheel in "3.13 5.2.3" "3.11 4.5.15"; do
        # shellcheck disable=SC2086  # two words on purpose
        if prepare_wheel $wheel; then
            wheels+=("${wheel#* }")
        else
            skip "bpy ${wheel#* }: it, or Python ${wheel% *}, could not be had"
        fi
    done
else
    notes+=("left to tests/run.sh --all: large and thorough cases, linters, sanitizers, fuzzing, other Blenders, Windows")
    step "build (check)" build_preset check checks addon_zip || finish
fi
zip=$(ls build/check/detail_deform-*.zip)

# The longest come first.
if $windows_blender; then
    beside "add-on in bpy 4.5.15 for Windows (Wine)" windows_blender_suite 4.5.15 "$quick_marks"
fi
if $windows; then
    beside "core and library under Wine (ctest)" windows_core_tests
fi
if $threads; then
    beside "threads of the core under their sanitizer" \
        build/tsan/tests/native/core_tests "[threads]~[large]"
fi
if $sanitized; then
    beside "C ABI under sanitizers (ctypes)" sanitized_abi_tests sanitize "$(address_sanitizer)"
    beside "fuzzing (clang and its sanitizers)" tests/fuzz/run.sh
fi
if $window; then
    # Without a graphics card a small screen is quicker to draw. It also shows whether the panel fits on one.
    if $all; then
        beside "add-on in its window" in_window 1280x800 build/gui
    else
        beside "add-on in its window" in_window 1024x640 build/gui ~large
    fi
fi
if $blender; then
    beside "add-on in $(blender --version | head -n 1)" \
        blender_suite "$marks" blender --background --factory-startup --python tests/blender/run.py --
    marks="not large"  # these don't depend on which Blender runs them
    if $all; then
        beside "the paper's figures" blender --background --factory-startup --python-exit-code 1 \
            --python tests/figures/make_figures.py -- --check
    fi
fi
for wheel in "${wheels[@]}"; do
    beside "add-on in bpy $wheel" \
        blender_suite "$marks" "build/venv-bpy-$wheel/bin/python" tests/blender/run.py --
    marks=$quick_marks  # by then the oldest and the newest Blender have run the thorough tests
done
$all || beside "core and library (ctest)" native_tests -LE "large|thorough|bench"
beside "C ABI (ctypes)" abi_tests
if $threads; then
    beside "threads of the C ABI under their sanitizer" \
        sanitized_abi_tests tsan "$(c++ -print-file-name=libtsan.so)" \
        -k "(thread or once) and not refusals and not cancelled"
fi
if $windows_python; then
    beside "C ABI under Wine (ctypes)" windows_abi_tests
fi
finish
