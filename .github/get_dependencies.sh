#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Eigen and Catch2 into deps/installed, of one version everywhere: package managers have Eigen 3.4
# and 5, and Catch2 2 and 3.
#
# .github/get_dependencies.sh [CMAKE OPTION...]
set -euo pipefail
for source in https://gitlab.com/libeigen/eigen.git@3.4.0 \
    https://github.com/catchorg/Catch2.git@v3.7.1; do
    git clone -q --depth 1 -b "${source#*@}" "${source%@*}" deps/source
    cmake -G Ninja -S deps/source -B deps/build -D CMAKE_BUILD_TYPE=Release -D BUILD_TESTING=OFF \
        -D CMAKE_INSTALL_PREFIX:PATH=deps/installed "$@"
    cmake --build deps/build --target install
    rm -rf deps/source deps/build
done
