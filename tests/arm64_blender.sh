# shellcheck shell=bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Tests the add-on in Debian's Blender for 64-bit ARM, in qemu-user. It takes an hour and so is part of a release
# only. Sourced from the repository root, after tests/prepare.sh, as root or with sudo (for chroot):
#
#     source tests/prepare.sh; source tests/arm64_blender.sh
#     prepare_arm64_blender && build_preset linux-arm64 addon_zip && arm64_blender_suite

dd_arm64=$PWD/build/arm64-blender

# prepare_arm64_blender: installs a cross compiler and the emulator, and unpacks Debian 12's Blender for ARM.
prepare_arm64_blender() {
    local library
    dd_need aarch64-linux-gnu-g++ g++-aarch64-linux-gnu || return
    dd_need qemu-aarch64-static qemu-user-static || return
    [ -x "$dd_arm64/usr/bin/blender" ] && return 0
    dd_need mmdebstrap mmdebstrap || return
    dd_need_packages debian-archive-keyring || return
    dd_say "Getting Debian's Blender for ARM into build/arm64-blender (a gigabyte)"
    mkdir -p build
    dd_as_root rm -rf "$dd_arm64" "$dd_arm64.unfinished"
    # The packages are only unpacked: their installation scripts are ARM programs. The part of them that Blender
    # needs is done below.
    dd_as_root mmdebstrap --quiet --variant=extract --architectures=arm64 \
        --include=blender,python3-numpy,python3-pytest,libegl1,libegl-mesa0,libgl1,libgl1-mesa-dri \
        --aptopt='APT::Install-Recommends "false"' bookworm "$dd_arm64.unfinished" || {
        dd_complain "Debian's Blender for ARM could not be had."
        return 1
    }
    for library in lapack/liblapack.so.3 blas/libblas.so.3; do
        dd_as_root ln -sf "$library" "$dd_arm64.unfinished/usr/lib/aarch64-linux-gnu/${library#*/}"
    done
    dd_as_root cp "$(command -v qemu-aarch64-static)" "$dd_arm64.unfinished/usr/bin/"
    # Compiling Python's modules in qemu takes longer than the tests, so the host's Python does it, if it is of the
    # same version.
    if dd_python_is 3.11 /usr/bin/python3; then
        dd_as_root /usr/bin/python3 -m compileall -q -s "$dd_arm64.unfinished" \
            "$dd_arm64.unfinished"/usr/share/blender/scripts "$dd_arm64.unfinished"/usr/lib/python3* >/dev/null
    fi
    dd_as_root mkdir -p "$dd_arm64.unfinished"/{proc,dev,root}
    dd_as_root mv "$dd_arm64.unfinished" "$dd_arm64"
}

# in_arm64_blender ARGUMENT...: runs Blender. /proc, where tests read how much memory is in use, is mounted in a
# namespace that ends with it.
in_arm64_blender() {
    # shellcheck disable=SC2016  # sh's
    dd_as_root unshare --mount sh -c 'mount -t proc proc "$0/proc" &&
        exec env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 \
            BLENDER_USER_RESOURCES=/tmp/resources chroot "$0" \
            /usr/bin/qemu-aarch64-static /usr/bin/blender --background --factory-startup -noaudio "$@"' \
        "$dd_arm64" "$@"
}

# arm64_blender_suite [pytest argument]...: tests the zip. Where the kernel isn't set up to run ARM programs
# (binfmt_misc), Blender can't start a second Blender: leave the tests that do so out by "-k".
arm64_blender_suite() {
    local repository=$dd_arm64/tmp/repository zip
    zip=$(basename build/linux-arm64/detail_deform-*-linux-arm64.zip)
    dd_as_root rm -rf "$dd_arm64/tmp/resources" "$repository"
    dd_as_root mkdir -p "$dd_arm64/tmp/resources" "$repository/build"
    dd_as_root cp -r addon blend_fixtures native tests LICENSE ./*.md "$repository"
    dd_as_root cp "build/linux-arm64/$zip" "$repository/build/"
    in_arm64_blender --python /tmp/repository/tests/blender/run.py -- "/tmp/repository/build/$zip" \
        -m "not large" "$@"
}
