# The library as other projects use it: find_package(detail_deform), pkg-config detail_deform, or their own loader.
include(CMakePackageConfigHelpers)

set(dd_targets detail_deform)
if(DETAIL_DEFORM_STATIC)
  list(APPEND dd_targets detail_deform_static)
endif()
set(dd_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/detail_deform)
install(TARGETS ${dd_targets} EXPORT detail_deform-targets
  RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR}
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/detail_deform DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT detail_deform-targets NAMESPACE detail_deform:: DESTINATION ${dd_package_dir})

configure_package_config_file(cmake/detail_deform-config.cmake.in detail_deform-config.cmake
  INSTALL_DESTINATION ${dd_package_dir})
write_basic_package_version_file(detail_deform-config-version.cmake COMPATIBILITY SameMajorVersion)
# The prefix is written relative to the .pc file, so that an installed tree can be moved.
file(RELATIVE_PATH DD_PREFIX_FROM_PC /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(cmake/detail_deform.pc.in detail_deform.pc @ONLY)
install(FILES
  ${CMAKE_CURRENT_BINARY_DIR}/detail_deform-config.cmake ${CMAKE_CURRENT_BINARY_DIR}/detail_deform-config-version.cmake
  DESTINATION ${dd_package_dir})
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/detail_deform.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
