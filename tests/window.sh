# shellcheck shell=bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Tests the add-on in the window of this system's Blender. Sourced from the repository root, after tests/prepare.sh.

# prepare_window: installs a virtual screen, and tools that press keys and move the mouse; after prepare_blender.
prepare_window() {
    dd_need_packages xvfb xauth xdotool imagemagick
}

# in_window WIDTHxHEIGHT FOLDER [ROW...]: runs gui/window.py in Blender's window on a virtual screen of that size, and
# keeps screenshots in FOLDER. The add-on is the source tree's, with the library that a build has staged there. Without
# a graphics card the time is mostly proportional to the number of pixels.
in_window() {
    timeout 1200 xvfb-run -a -s "-screen 0 ${1}x24" blender --factory-startup \
        --window-geometry 0 0 "${1%x*}" "${1#*x}" --python tests/blender/gui/window.py -- "${@:2}"
}
