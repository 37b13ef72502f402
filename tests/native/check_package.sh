#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# check_package.sh BUILD SOURCES: installs the library from a build and uses it as others would: the examples by CMake and by
# pkg-config, shared and static, in Python as a wheel; and the sources as a part of another project.
set -euo pipefail
build=$1 sources=$2
unset DETAIL_DEFORM_LIBRARY
export CMAKE_GENERATOR=Ninja  # as the presets; a bare system has no make
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cmake --install "$build" --prefix "$work/installed" >/dev/null
find "$work/installed" -name '*.h' -o -name '*.hpp' -o -name '*.so*' -o -name '*.cmake' -o -name '*.pc' | sort | sed "s|$work/||"
cmake -S "$sources/native/examples" -B "$work/examples" -DCMAKE_PREFIX_PATH="$work/installed" -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_C_FLAGS="-Wall -Wextra -Wpedantic -Werror" -DCMAKE_CXX_FLAGS="-Wall -Wextra -Wpedantic -Werror" >/dev/null
cmake --build "$work/examples" >/dev/null
for example in "$work"/examples/{handles_c,transfer_c,handles_cpp}{,_static}; do
    [ -x "$example" ] || { [[ $example == *_static ]] && continue; }
    echo "$(basename "$example"):"
    "$example"
done

if command -v pkg-config >/dev/null; then
    pc=$(dirname "$(find "$work/installed" -name detail_deform.pc)")
    read -ra flags <<<"$(PKG_CONFIG_PATH=$pc pkg-config --cflags --libs detail_deform)"
    cc -std=c99 "$sources/native/examples/handles.c" "${flags[@]}" -lm -Wl,-rpath,"$(dirname "$pc")" -o "$work/by_pkg_config"
    "$work/by_pkg_config" >/dev/null && echo "pkg-config: links and runs"
fi

# The soname is that of the ABI: a program linked against another one doesn't start with this library.
abi=$(sed -n 's/^#define DD_ABI_VERSION \([0-9]*\)/\1/p' "$sources/native/include/detail_deform/detail_deform.h")
readelf -d "$(find "$work/installed" -name 'libdetail_deform.so')" | grep -q "SONAME.*libdetail_deform.so.$abi"
version=$(sed -n 's/^#define DD_VERSION_[A-Z]* \([0-9]*\)/\1/p' "$sources/native/include/detail_deform/detail_deform.h" | paste -sd.)
grep -q "project(detail_deform VERSION $version " "$sources/CMakeLists.txt"

# As a part of another project: no tests, no benchmarks, nothing written beside the build, no flag of the other's changed.
mkdir "$work/other"
cat >"$work/other/CMakeLists.txt" <<EOF
cmake_minimum_required(VERSION 3.25)
project(other LANGUAGES C CXX)
add_subdirectory($sources detail_deform)
if(CMAKE_CXX_STANDARD OR CMAKE_CXX_COMPILER_LAUNCHER OR CMAKE_EXPORT_COMPILE_COMMANDS)
  message(FATAL_ERROR "a global setting was changed")
endif()
foreach(target core_tests speed addon_zip)
  if(TARGET \${target})
    message(FATAL_ERROR "\${target} is built for others")
  endif()
endforeach()
add_executable(pulled $sources/native/examples/handles.c)
set_target_properties(pulled PROPERTIES C_STANDARD 99)
target_link_libraries(pulled PRIVATE detail_deform::detail_deform)
EOF
env -u CMAKE_CXX_COMPILER_LAUNCHER cmake -S "$work/other" -B "$work/other/build" >/dev/null
echo "as a part of another project: configured, the library alone"

for python in python3 /usr/bin/python3; do
    "$python" -c 'import numpy' 2>/dev/null || continue
    library=$(find "$work/installed" -name 'libdetail_deform.so')
    (cd "$sources/native/python" && DETAIL_DEFORM_LIBRARY=$library PYTHONDONTWRITEBYTECODE=1 \
        "$python" -c 'import build_wheel_here, sys; print(build_wheel_here.build_wheel(sys.argv[1]))' "$work")
    "$python" -m zipfile -e "$work"/detail_deform_native-*.whl "$work/python"
    PYTHONPATH=$work/python "$python" "$sources/native/examples/handles.py"
    break
done
