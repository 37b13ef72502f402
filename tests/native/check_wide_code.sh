#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# What is compiled for wide vectors shares no inline function with other files: of two copies the linker
# keeps one, and that must not be the one that older machines can't run.
set -euo pipefail
archive=$1
shared=$(nm -C --defined-only "$archive" | awk '
  /:$/ { wide = /_avx2/; if (wide) ++members }
  wide && $2 ~ /^[WVu]$/ && !/DdEigenAvx2|__gxx_personality/
  END { if (members < 2) print "only " members + 0 " wide members" }')
[ -z "$shared" ] || { echo "FAIL: $archive shares"; echo "$shared"; exit 1; }
