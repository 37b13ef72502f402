# shellcheck shell=bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# The add-on in the window of the Blender at hand. Sourced from the repository root, after tests/prepare.sh.

# prepare_window: what a screen and a hand are made of, after prepare_blender.
prepare_window() {
    dd_need_packages xvfb xauth xdotool imagemagick
}

# in_window WIDTHxHEIGHT FOLDER [ROW...]: walks through the window on a screen of its own, and keeps screenshots in
# that folder. The add-on is the source tree's, with the library that a build has staged there. Without a graphics card
# most of the time goes into drawing, by the pixel.
in_window() {
    timeout 1200 xvfb-run -a -s "-screen 0 ${1}x24" blender --factory-startup \
        --window-geometry 0 0 "${1%x*}" "${1#*x}" --python tests/blender/gui/window.py -- "${@:2}"
}
