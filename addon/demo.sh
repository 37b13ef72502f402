#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Installs missing packages, builds Detail Deform and deforms three scenes with it in background
# Blender. Prints times, and writes pictures to build/demo/.
#
# addon/demo.sh [bumpy_plane] [suzanne] [animated]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=tests/prepare.sh
source tests/prepare.sh

prepare_build
build_preset library detail_deform

if prepare_blender; then
    blender --background --factory-startup --python-exit-code 1 --python addon/demo.py -- "$@"
elif dd_say "No Blender: trying Blender as a Python module" && prepare_wheel 3.11 4.5.15; then
    build/venv-bpy-4.5.15/bin/python addon/demo.py -- "$@"
elif prepare_wheel 3.13 5.2.3; then
    build/venv-bpy-5.2.3/bin/python addon/demo.py -- "$@"
else
    dd_complain "The demo needs Blender 3.4 or newer on PATH, or Python 3.11 or 3.13."
    exit 1
fi
