# find_package(Doppel) for the outside world; tests/install builds a consumer against it.
include(CMakePackageConfigHelpers)
get_property(rooms GLOBAL PROPERTY DOPPEL_ROOMS)
install(TARGETS ${rooms} doppel_flags doppel_torch EXPORT DoppelTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS doppel RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY src/doppel DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(EXPORT DoppelTargets NAMESPACE Doppel:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Doppel)
configure_package_config_file(cmake/DoppelConfig.cmake.in DoppelConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Doppel)
write_basic_package_version_file(DoppelConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/DoppelConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/DoppelConfigVersion.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Doppel)
