#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# The DLL needs nothing but what Windows brings, exports nothing but dd_*, and takes no stack to be
# aligned to 32 bytes, which it is not on Windows.
set -euo pipefail
library=$1 objdump=$2
fail() { echo "FAIL: $*"; exit 1; }

needed=$("$objdump" -p "$library" | awk '/DLL Name:/ { print tolower($3) }')
echo "needs: ${needed//$'\n'/ }"
[ -n "$needed" ] || fail "$library needs nothing at all"
for name in $needed; do
  case $name in
    kernel32.dll | msvcrt.dll | ucrtbase.dll | api-ms-win-crt-*) ;;
    *) fail "$library needs $name" ;;
  esac
done

exported=$("$objdump" -p "$library" | awk '
  /Name Pointer\] Table/ { listed = 1; next }
  NF == 0 { listed = 0 }
  listed { print $NF }' | sort -u)
[ "$(wc -w <<<"$exported")" -ge 10 ] || fail "$library exports too little: $exported"
others=$(grep -v '^dd_' <<<"$exported" || true)
[ -z "$others" ] || fail "$library exports more than dd_*: $others"
echo "exports: ${exported//$'\n'/ }"

code=$("$objdump" -d "$library")
[ "$(grep -c ymm <<<"$code")" -ge 100 ] || fail "$library has no code for AVX2"
aligned=$(grep -E 'vmov(ap[sd]|dqa|ntdq|ntp[sd]).*ymm' <<<"$code" || true)
[ -z "$aligned" ] || fail "$library moves 32 bytes as if aligned: $aligned"
