#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Makes all files of a release in build/release-<version>/: the zips, an extension repository of them
# (index.json and index.html, for Blender 4.2 and later; to be put on a server as it is), their
# checksums, and the notes, which are the changelog's entry for this version. The zips for Blender's
# own extensions site, with the library in a wheel, are in the subfolder extensions-site/, because a
# repository's folder may have only one zip for each platform.
#
# addon/release.sh [ZIP...]
#
# ZIP: a zip that was made elsewhere, such as on macOS. Zips are built here for Linux x64, Windows x64
# and 64-bit ARM Linux, unless the platform's zip is given or its compiler is missing; missing zips are
# named. The environment variable DETAIL_DEFORM_WEBSITE is the project's address, if it has one.
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
site=$out/extensions-site
mkdir -p "$site"

# put ZIP: copies it to the folder for its kind
put() {
    case ${1##*/} in
        detail_deform_extension-*) cp "$1" "$site" ;;
        *) cp "$1" "$out" ;;
    esac
}
for zip in ${given[@]+"${given[@]}"}; do put "$zip"; done

# build_zips PRESET PLATFORM COMPILER
build_zips() {
    local zip=detail_deform-$version-$2.zip extension=detail_deform_extension-$version-$2.zip
    if [ -e "$out/$zip" ]; then
        [ -e "$site/$extension" ] || dd_say "No zip for the extensions site for $2: none was given"
        return
    fi
    command -v "$3" >/dev/null || {
        dd_say "No zips for $2: there is no $3"
        return
    }
    dd_say "Building for $2"
    cmake --preset "$1" -D "DETAIL_DEFORM_WEBSITE=${DETAIL_DEFORM_WEBSITE:-}" >/dev/null
    cmake --build --preset "$1" --target addon_zip extension_zip
    put "build/$1/$zip"
    put "build/$1/$extension"
}

prepare_build
build_zips check linux-x64 c++  # the preset that the tests are run on
build_zips windows windows-x64 x86_64-w64-mingw32-g++-posix
build_zips linux-arm64 linux-arm64 aarch64-linux-gnu-g++
[ -e "$out/detail_deform-$version-macos.zip" ] || dd_say "No zips for macOS: they are built there"

# Every installed version of Blender's own extension tool, which comes with the bpy wheels, checks each zip.
prepare_wheel 3.13 5.2.3
for venv in build/venv-bpy-*; do
    tool=$(find "$venv" -path '*bl_pkg/cli/blender_ext.py')
    for zip in "$out"/*.zip "$site"/*.zip; do
        "$venv/bin/python" "$tool" validate "$zip"
    done
done
venv=build/venv-bpy-5.2.3
tool=$(find "$venv" -path '*bl_pkg/cli/blender_ext.py')
"$venv/bin/python" "$tool" server-generate --repo-dir "$out" --html
(cd "$out" && sha256sum -- *.zip extensions-site/*.zip >SHA256SUMS)
{
    printf '# Detail Deform %s\n%s\n\n## Checksums (SHA-256)\n\n' "$version" "$notes"
    sed 's/^/    /' "$out/SHA256SUMS"
} >"$out/NOTES.md"
dd_say "Made in $out:"
ls -R "$out"
