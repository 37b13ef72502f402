#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# What a release consists of, in build/release-<version>/: the zips, an extension repository of them
# (index.json and index.html, for Blender 4.2 and later; to be put on a server as it is), their
# checksums, and the notes, which are the changelog's of this version.
#
# addon/release.sh [ZIP...]
#
# ZIP: made elsewhere, as by a workflow on macOS. A zip is built here for each platform that none is
# given for and that there is a compiler for: the machine's own, Windows x64, 64-bit ARM Linux.
# Names of others are printed. DETAIL_DEFORM_WEBSITE in the environment: where the project is at home.
set -euo pipefail
given=()
for zip in "$@"; do given+=("$(realpath "$zip")"); done
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=tests/prepare.sh
source tests/prepare.sh

version=$(sed -n 's/^project(.* VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
out=build/release-$version
notes=$(awk -v wanted="## [$version]" '
    /^## / { listed = index($0, wanted) == 1; next }
    listed' CHANGELOG.md)
[ -n "$notes" ] || {
    dd_complain "CHANGELOG.md has no entry for version $version."
    exit 1
}
if [ -n "$(git status --porcelain 2>/dev/null)" ]; then
    dd_say "There are changes that aren't committed: this can't be made again from a commit"
fi

rm -rf "$out"
mkdir -p "$out"
[ ${#given[@]} = 0 ] || cp "${given[@]}" "$out"

# build_zip PRESET PLATFORM COMPILER
build_zip() {
    local zip=detail_deform-$version-$2.zip
    [ -e "$out/$zip" ] && return
    command -v "$3" >/dev/null || {
        dd_say "No zip for $2: there is no $3"
        return
    }
    dd_say "Building for $2"
    cmake --preset "$1" -D "DETAIL_DEFORM_WEBSITE=${DETAIL_DEFORM_WEBSITE:-}" >/dev/null
    cmake --build --preset "$1" --target addon_zip
    cp "build/$1/$zip" "$out"
}

prepare_build
build_zip check linux-x64 c++  # what the tests are run on
build_zip windows windows-x64 x86_64-w64-mingw32-g++-posix
build_zip linux-arm64 linux-arm64 aarch64-linux-gnu-g++
[ -e "$out/detail_deform-$version-macos.zip" ] || dd_say "No zip for macOS: it is built there"

# Blender's own tool, which any Python of its age runs; it comes with Blender as a module, too.
prepare_wheel 3.13 5.2.3
tool=$(find build/venv-bpy-5.2.3 -path '*bl_pkg/cli/blender_ext.py')
for zip in "$out"/*.zip; do
    build/venv-bpy-5.2.3/bin/python "$tool" validate "$zip"
done
build/venv-bpy-5.2.3/bin/python "$tool" server-generate --repo-dir "$out" --html
(cd "$out" && sha256sum -- *.zip >SHA256SUMS)
{
    printf '# Detail Deform %s\n%s\n\n## Checksums (SHA-256)\n\n' "$version" "$notes"
    sed 's/^/    /' "$out/SHA256SUMS"
} >"$out/NOTES.md"
dd_say "Made in $out:"
ls "$out"
