# shellcheck shell=bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Tests the add-on in Blender for Windows, as the Python module bpy, under Wine. Sourced from the
# repository root, after tests/prepare.sh and tests/windows.sh; needs prepare_windows and the zip for
# Windows.

# prepare_windows_wheel PYTHON BPY, as in "prepare_windows_wheel 3.11 4.5.15": installs that version of
# bpy into build/windows-bpy-BPY. From 5.1 on bpy needs Python 3.13.
prepare_windows_wheel() {
    local folder=$PWD/build/windows-bpy-$2 numpy
    dd_need_packages xvfb xauth libgl1 libgl1-mesa-dri || return
    dd_new_windows "$PWD/build/wine-bpy-$2" || return
    dd_windows_wheel_runs "$2" >/dev/null 2>&1 && return 0
    # Newer versions of numpy call functions that Debian 12's Wine lacks.
    case $1 in 3.11) numpy=1.26.4 ;; *) numpy=2.4.6 ;; esac
    dd_get_windows_python "$folder" "$1" "bpy==$2" "numpy==$numpy" pytest==8.3.5 colorama || {
        dd_complain "pip could not get bpy $2 for Windows."
        return 1
    }
    if [ "$1" != 3.11 ] && ! { dd_mend_python "$folder" && dd_mend_numpy "$folder"; }; then
        dd_complain "numpy $numpy for Windows could not be made to run under Wine."
        return 1
    fi
    dd_windows_wheel_runs "$2" || {
        dd_complain "bpy $2 for Windows does not run under Wine."
        return 1
    }
}

dd_windows_wheel_runs() {
    in_windows_blender "$1" -c "import bpy, pytest; assert bpy.app.version_string.startswith('$1')"
}

# in_windows_blender BPY ARGUMENT...: runs the Python that has bpy, on a virtual screen, which rendering
# by OpenGL needs.
in_windows_blender() {
    [ -e "build/windows-bpy-$1/python.exe" ] || return
    (
        # Each version of bpy has its own Wine prefix, whose server ends with it. A Wine server that was
        # started without a screen, or whose screen is gone, gives no screen to later programs either,
        # and keeps the output open.
        export WINEPREFIX=$PWD/build/wine-bpy-$1
        # Without Wine's debugger a crash ends the program. With it, a window waits to be closed.
        WINEDLLOVERRIDES="winedbg.exe=d" \
            xvfb-run -a timeout 3000 wine "$PWD/build/windows-bpy-$1/python.exe" "${@:2}" </dev/null 2>&1
        status=$?
        wineserver -k
        exit "$status"
    ) | sed -u '/^wine: Read access denied for device/d'  # drive Z:, whose label Wine tries to read
    return "${PIPESTATUS[0]}"
}

# dd_mend_python FOLDER: removes two interfaces (_wmi and CopyFile2) that Debian 12's Wine declares but
# doesn't implement. Python's modules platform and shutil do without them.
dd_mend_python() {
    rm -f "$1/DLLs/_wmi.pyd"
    echo "import _winapi; vars(_winapi).pop('CopyFile2', None)" >"$1/Lib/site-packages/sitecustomize.py"
}

# dd_mend_numpy FOLDER: makes numpy 2 import its mathematical functions from a library that is built
# here. It implements the complex functions that Wine lacks and forwards all others to Windows' C
# library. Its name is not longer than the original, so that it fits into numpy's import table.
dd_mend_numpy() {
    local core=$1/Lib/site-packages/numpy/_core
    # shellcheck disable=SC2016  # the variables are awk's
    x86_64-w64-mingw32-objdump -p "$core"/_multiarray_umath.*.pyd | awk '
        BEGIN { print "LIBRARY dd-crt-math.dll\nEXPORTS" }
        /DLL Name/ { dll = $3 }
        /^\t[0-9a-f]/ && dll ~ /crt-math/ {
            name = "ucrtbase." $NF
            if (match($NF, /^c(exp|sin|cos|tan|sinh|cosh|tanh|abs|arg|real|imag|pow)/)) {
                type = substr($NF, RLENGTH + 1)  # a long double is a double there
                if (type ~ /^[fl]?$/) name = "dd_" substr($NF, 1, RLENGTH) (type == "f" ? "f" : "")
            }
            print $NF " = " name
        }' >"$core/dd-crt-math.def" &&
        x86_64-w64-mingw32-gcc-posix -O1 -shared -static-libgcc -o "$core/dd-crt-math.dll" \
            tests/crt_math.c "$core/dd-crt-math.def" &&
        python3 - "$core"/_multiarray_umath.*.pyd <<'PYTHON'
import sys
from pathlib import Path
path, theirs = Path(sys.argv[1]), b'api-ms-win-crt-math-l1-1-0.dll'
content = path.read_bytes()
assert content.count(theirs) == 1
path.write_bytes(content.replace(theirs, b'dd-crt-math.dll'.ljust(len(theirs), b'\0')))
PYTHON
}

# windows_blender_suite BPY MARKS [pytest argument]...: tests the zip, installed into new user folders.
# A subshell, so that its trap removes these folders however it ends.
windows_blender_suite() (
    windows_zip=$(ls build/windows/detail_deform-*-windows-x64.zip) || exit
    # Wine before 9 searches all free blocks at each allocation, so that 10,000 objects take minutes.
    quick=()
    dd_at_least "$(wine --version | sed 's/^wine-//')" 9 || quick=(-k "not does_not_go_through")
    folder=$(mktemp -d) || exit
    trap 'dd_forget "$folder"' EXIT
    mkdir "$folder/resources" "$folder/drive" "$folder/read-only"
    ln -sfn "$folder/drive" "build/wine-bpy-$1/dosdevices/t:"
    export DD_TEST_DRIVE=T:
    if dd_as_root mount -t tmpfs -o ro tmpfs "$folder/read-only" 2>/dev/null; then
        ln -sfn "$folder/read-only" "build/wine-bpy-$1/dosdevices/r:"
        export DD_TEST_READ_ONLY_DRIVE=R:
    fi
    resources=$folder/resources
    BLENDER_USER_RESOURCES="Z:${resources//\//\\}" \
        in_windows_blender "$1" tests/blender/run.py -- "$windows_zip" -m "$2" "${quick[@]}" "${@:3}"
)

dd_forget() {
    if mountpoint -q "$1/read-only"; then dd_as_root umount -l "$1/read-only"; fi
    rm -rf "$1"
}
