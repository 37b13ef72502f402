#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Builds and runs the fuzz targets.
#
# tests/fuzz/run.sh                            short: each target's corpus, and a few inputs made of it,
#                                              on the library that the sanitizers' tests are run on
# tests/fuzz/run.sh long SECONDS [TARGET...]   as much of the processor's time for each target; what
#                                              is new is kept in build/fuzz/corpus, what fails in
#                                              build/fuzz/found
# tests/fuzz/run.sh keep [TARGET...]           takes from it what reaches most into the corpus
# tests/fuzz/run.sh planted [TARGET...]        whether each finds the defect of planted/TARGET.patch
#                                              within a minute of the processor's time
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
# shellcheck source=tests/prepare.sh
source tests/prepare.sh

here=tests/fuzz
found=build/fuzz/found
declare -A inputs=([bind]=250 [update]=150 [transfer]=250 [match]=120 [tools]=600)

# Inputs longer than this are read to no end; a call of minutes or a gigabyte is a defect.
limits=(-max_len=400 -len_control=0 -timeout=100 -rss_limit_mb=1024 -malloc_limit_mb=256)
# What was freed is not to be counted for long.
export ASAN_OPTIONS=quarantine_size_mb=32${ASAN_OPTIONS:+:$ASAN_OPTIONS}

# fuzz TARGET OPTION...: with its artifacts in $found.
fuzz() {
    local target=$1
    shift
    mkdir -p "$found"
    "${binaries:-build/$preset}/tests/fuzz/fuzz_$target" "${limits[@]}" \
        -artifact_prefix="$found/$target-" "$@"
}

# unpacked TARGET: the folder with its corpus, from corpus/TARGET.tar.gz.
unpacked() {
    local folder=build/fuzz/unpacked/$1
    rm -rf "$folder"
    mkdir -p "$folder"
    tar -xzf "$here/corpus/$1.tar.gz" -C "$folder"
    echo "$folder"
}

short() {
    local target new log status=0
    new=$(mktemp -d) log=$(mktemp)
    for target in "$@"; do
        # What is new goes to the first folder, the corpus stays as it is.
        if fuzz "$target" -seed=1 -runs="${inputs[$target]}" "$new" "$(unpacked "$target")" \
            >"$log" 2>&1; then
            echo "$target: $(grep -a DONE "$log")"
        else
            tail -n 60 "$log"
            status=1
        fi
        rm -f "${new:?}"/*
    done
    rm -rf "$new" "$log"
    return "$status"
}

long() {
    local seconds=$1 target end status=0
    shift
    for target in "$@"; do
        mkdir -p "build/fuzz/corpus/$target"
        end=0
        # The limit ends it by a signal, and a finding by a status of its own.
        (
            ulimit -S -t "$seconds"
            fuzz "$target" "build/fuzz/corpus/$target" "$(unpacked "$target")"
        ) || end=$?
        if [ "$end" = $((128 + $(kill -l XCPU))) ]; then
            echo "$target: nothing found in $seconds s of the processor's time"
        else
            status=1
        fi
    done
    return "$status"
}

keep() {
    local target new kept
    for target in "$@"; do
        new=$(mktemp -d) kept=$(unpacked "$target")
        fuzz "$target" -merge=1 -set_cover_merge=1 -use_counters=0 "$new" "$kept" \
            "build/fuzz/corpus/$target" || return
        # Inputs with a name are there for a reason of their own.
        find "$kept" -type f -regex '.*/[0-9a-f]*' -delete
        # What reaches most comes first.
        find "$new" -type f -printf '%T@ %p\n' | sort -n | head -n 55 | cut -d ' ' -f 2- |
            xargs cp -t "$kept"
        # The same bytes from the same inputs.
        tar --sort=name --mtime=@0 --owner=0 --group=0 --numeric-owner -C "$kept" -cf - . |
            gzip -9n >"$here/corpus/$target.tar.gz"
        rm -rf "$new"
    done
}

# A copy of the tree with the defect in it, built as this one is: the compiler's cache has the rest.
planted() {
    local target new log status=0 copy=$PWD/build/planted
    dd_need patch patch || return
    rm -rf "$copy"
    mkdir -p "$copy/build"
    cp -r CMakeLists.txt CMakePresets.json LICENSE addon native tests "$copy" || return
    for target in "$@"; do
        patch --quiet -p1 -d "$copy" <"$here/planted/$target.patch" || return
        (
            cd "$copy"
            export CCACHE_BASEDIR=$copy CCACHE_NOHASHDIR=1
            cmake --preset fuzz && cmake --build --preset fuzz --target "fuzz_$target"
        ) >"$copy/build/$target.log" 2>&1 || { cat "$copy/build/$target.log"; return 1; }
        new=$(mktemp -d) log=$copy/build/$target.log
        (
            ulimit -t 60
            binaries=$copy/build/fuzz found=$copy/build/found
            fuzz "$target" -seed=1 "$new" "$(unpacked "$target")"
        ) >"$log" 2>&1 || true
        if grep -q 'Test unit written' "$log"; then
            # None where one of the corpus was enough.
            echo "$target: found the planted defect," \
                "$(grep -aoE '^#[0-9]+' "$log" | tail -n 1 || true) inputs:" \
                "$(grep -aE 'BROKEN|SUMMARY' "$log" | head -n 1)"
        else
            echo "$target: MISSED the planted defect"
            status=1
        fi
        rm -rf "$new"
        patch --quiet -R -p1 -d "$copy" <"$here/planted/$target.patch" || return
    done
    return "$status"
}

what=${1:-short}
[ $# = 0 ] || shift
seconds=
if [ "$what" = long ]; then
    seconds=${1:?long SECONDS [TARGET...]}
    shift
fi
targets=("$@")
[ $# != 0 ] || targets=(bind update transfer match tools)

preset=fuzz
[ "$what" != short ] || preset=sanitize
prepare_clang
prepare_build
build_preset "$preset" fuzz_targets
case $what in
    short) short "${targets[@]}" ;;
    long) long "$seconds" "${targets[@]}" ;;
    keep) keep "${targets[@]}" ;;
    planted) planted "${targets[@]}" ;;
    *) dd_complain "tests/fuzz/run.sh [long SECONDS | keep | planted] [TARGET...]"; exit 2 ;;
esac
