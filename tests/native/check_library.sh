#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# The shared library needs nothing but the C library and exports nothing but dd_*.
set -euo pipefail
library=$1
fail() { echo "FAIL: $*"; exit 1; }

needed=$(objdump -p "$library" | awk '/NEEDED/ { print $2 }')
echo "needs: ${needed//$'\n'/ }"
for name in $needed; do
  case $name in
    libc.so.* | libm.so.* | ld-linux*) ;;
    *) fail "$library needs $name" ;;
  esac
done

exported=$(nm -D --defined-only "$library" | awk '{ print $NF }' | sed 's/@.*//')
[ "$(wc -w <<<"$exported")" -ge 10 ] || fail "$library exports too little: $exported"
others=$(grep -v '^dd_' <<<"$exported" || true)
[ -z "$others" ] || fail "$library exports more than dd_*: $others"
echo "exports: ${exported//$'\n'/ }"

# Blender itself asks for glibc 2.28: the library must not ask for more.
newest=$(objdump -T "$library" | grep -o 'GLIBC_[0-9.]*' | sed 's/GLIBC_//' | sort -V | tail -n 1)
echo "newest glibc symbol version: $newest"
[ "$(printf '%s\n2.28\n' "$newest" | sort -V | tail -n 1)" = 2.28 ] ||
  fail "$library asks for glibc $newest: $(objdump -T "$library" | grep "GLIBC_$newest")"
