#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Tests the committed tree on bare Debian systems, like somebody who has just cloned it. Each command starts in
# a new root file system, build/roots/SYSTEM, made by debootstrap; the log is beside it. As root, on Linux.
#
# tests/roots.sh [SYSTEM...]            the two commands of the README: addon/demo.sh, then in another new root
#                                       tests/run.sh, twice; how long each took. bookworm, trixie and sid
#                                       (Debian 12, 13 and unstable) where none is named
# tests/roots.sh window [SYSTEM...]     the walks through Blender's window; screenshots in
#                                       build/roots/SYSTEM/detail_deform/build/gui
# tests/roots.sh in SYSTEM COMMAND...   any command, in the root as it was left; a new one where there is none
#
# shellcheck disable=SC2329  # functions that are called as "$what"
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit
# shellcheck source=tests/prepare.sh
source tests/prepare.sh

roots=$PWD/build/roots
results=() failed=0

# Commands in a root run in their own mount and process namespaces, so that nothing is left mounted or running
# when this script is stopped.
can_make_roots() {
    if [ "$(id -u)" != 0 ]; then
        dd_complain "Only root can make a system and run something in it."
    elif ! command -v debootstrap >/dev/null && ! dd_install debootstrap; then
        dd_complain "There is no debootstrap."
    elif ! unshare --mount --pid --fork true 2>/dev/null; then
        dd_complain "This machine allows no namespaces for mounts and processes."
    else
        return 0
    fi
    return 1
}

# new_root SYSTEM: a bare system, with the committed tree in its folder /detail_deform.
new_root() {
    local root=$roots/$1
    mkdir -p "$roots/packages"
    if [ ! -e "$roots/$1.tar" ]; then
        dd_say "debootstrap $1"
        rm -rf "$root"
        debootstrap --variant=minbase --cache-dir="$roots/packages" "$1" "$root" \
            >"$roots/$1-debootstrap.log" 2>&1 || {
            tail -n 20 "$roots/$1-debootstrap.log"
            dd_complain "debootstrap could not make $1."
            rm -rf "$root"
            return 1
        }
        tar -cf "$roots/$1.part" -C "$root" . && mv "$roots/$1.part" "$roots/$1.tar" || return
    fi
    rm -rf "$root"
    mkdir -p "$root" || return
    tar -xf "$roots/$1.tar" -C "$root" || return
    mkdir "$root/detail_deform" || return
    git archive HEAD | tar -x -C "$root/detail_deform" || return
    # The root reaches the network like the machine: by its resolver, its proxies and its own certificates.
    cp -L /etc/resolv.conf "$root/etc/resolv.conf"
    [ ! -e "${SSL_CERT_FILE:-}" ] || cp -L "$SSL_CERT_FILE" "$root/etc/machine-certificates.pem"
    # A mirror of unstable may lag behind until its index has expired.
    echo 'Acquire::Check-Valid-Until "false";' >"$root/etc/apt/apt.conf.d/90any-age"
}

# in_root SYSTEM COMMAND...: runs a command in the tree's folder, in an environment with nothing but the variables
# below.
in_root() {
    local root=$roots/$1 name environment=(HOME=/root LANG=C.UTF-8 CI=true
        PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin)
    shift
    for name in http_proxy https_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY; do
        [ -z "${!name:-}" ] || environment+=("$name=${!name}")
    done
    [ ! -e "$root/etc/machine-certificates.pem" ] || environment+=(
        PIP_CERT=/etc/machine-certificates.pem SSL_CERT_FILE=/etc/machine-certificates.pem)
    # shellcheck disable=SC2016  # the inner shell's own arguments
    unshare --mount --propagation private --pid --fork --kill-child bash -c '
        root=$1 && shift &&
            mount -t proc proc "$root/proc" &&
            mount --rbind /sys "$root/sys" &&
            mount --rbind /dev "$root/dev" &&
            exec chroot "$root" /usr/bin/env -i "$@"' - "$root" "${environment[@]}" \
        bash -c 'cd /detail_deform && exec "$@"' - "$@" </dev/null
}

# timed SYSTEM NAME COMMAND...: runs a command, keeps its output in a log, and notes how it ended and how long it took.
timed() {
    local system=$1 name=$2 began=$SECONDS status=0 log
    shift 2
    log=$roots/$system-${name//[ \/]/-}.log
    dd_say "$system: $name (what it prints: $log)"
    in_root "$system" "$@" >"$log" 2>&1 || status=$?
    # The last line is the command's own summary.
    if [ "$status" = 0 ]; then
        results+=("$system: passed in $((SECONDS - began)) s: $name ($(tail -n 1 "$log"))")
    else
        tail -n 60 "$log"
        results+=("$system: FAILED after $((SECONDS - began)) s: $name ($(tail -n 1 "$log"))")
        failed=1
    fi
    dd_say "${results[-1]}"
    return "$status"
}

# begin SYSTEM: makes a new root, or notes among the results that it can't be made.
begin() {
    new_root "$1" && return 0
    results+=("$1: FAILED: no root could be made")
    failed=1
    return 1
}

readme() {
    begin "$1" && timed "$1" addon/demo.sh addon/demo.sh
    begin "$1" && timed "$1" tests/run.sh tests/run.sh && timed "$1" "tests/run.sh again" tests/run.sh
}

window() {
    begin "$1" && timed "$1" window bash -c 'source tests/prepare.sh && source tests/window.sh &&
        prepare_build && build_preset library detail_deform && prepare_blender && prepare_window && in_window 1280x800 build/gui'
}

what=readme
case ${1:-} in
    window | in)
        what=$1
        shift
        ;;
esac
if ! can_make_roots; then
    echo "skipped: no bare systems are made here"
    exit 0
fi
if [ "$what" = in ]; then
    [ -d "$roots/${1:?SYSTEM}/detail_deform" ] || new_root "$1" || exit
    in_root "$@"
    exit
fi
[ $# != 0 ] || set -- bookworm trixie sid
for system in "$@"; do "$what" "$system"; done
echo
printf '%s\n' "${results[@]}"
exit "$failed"
