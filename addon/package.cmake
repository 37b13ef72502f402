# Target addon_zip: the add-on as users install it, with the library for this platform in it.
# One zip serves Blender 3.4 (legacy, by bl_info) and 4.2 on (extension, by the manifest).
# Target extension_zip: the same with the library in a wheel, as Blender's extensions site wants it.
file(READ ${PROJECT_SOURCE_DIR}/addon/detail_deform/blender_manifest.toml dd_manifest)
string(REGEX MATCH "\nversion = \"([0-9.]+)\"" dd_found "${dd_manifest}")
if(NOT CMAKE_MATCH_1 STREQUAL PROJECT_VERSION)
  message(FATAL_ERROR "blender_manifest.toml has version ${CMAKE_MATCH_1}, CMakeLists.txt ${PROJECT_VERSION}.")
endif()

# The platform by the name that Blender's manifests use.
set(dd_processor ${DD_PROCESSOR})
if(dd_processor MATCHES "^(aarch64|arm64)$")
  set(dd_processor arm64)
else()
  set(dd_processor x64)
endif()
if(WIN32)
  set(dd_platform windows-${dd_processor})
elseif(APPLE)
  set(dd_platform macos-${dd_processor})
else()
  set(dd_platform linux-${dd_processor})
endif()
set(DETAIL_DEFORM_WEBSITE "" CACHE STRING "Where the project is at home; its reports of problems go to /issues there")
set(dd_zip ${CMAKE_BINARY_DIR}/detail_deform-${PROJECT_VERSION}-${dd_platform}.zip)
set(dd_extension ${CMAKE_BINARY_DIR}/detail_deform_extension-${PROJECT_VERSION}-${dd_platform}.zip)

# The zip gets the file name without a version: on Windows the library's own, elsewhere a symbolic link's.
if(WIN32)
  set(dd_library $<TARGET_FILE:detail_deform>)
else()
  set(dd_library $<TARGET_LINKER_FILE:detail_deform>)
endif()

find_package(Python3 COMPONENTS Interpreter)
if(NOT Python3_FOUND)
  message(STATUS "No Python: the add-on can't be packed here")
  return()
endif()
add_custom_target(addon_zip
  COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/addon/make_zip.py
    ${dd_library} ${dd_platform} ${dd_zip} ${DETAIL_DEFORM_WEBSITE}
  DEPENDS detail_deform
  COMMENT "Packing ${dd_zip}"
  VERBATIM)
add_custom_target(extension_zip
  COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/addon/make_zip.py
    ${dd_library} ${dd_platform} ${dd_extension} ${DETAIL_DEFORM_WEBSITE} --wheel
  DEPENDS detail_deform
  COMMENT "Packing ${dd_extension}"
  VERBATIM)
