# find_package(Doppel) for the outside world; tests/install builds a consumer against it.
include(CMakePackageConfigHelpers)
get_property(modules GLOBAL PROPERTY DOPPEL_MODULES)
install(TARGETS ${modules} doppel_flags doppel_torch EXPORT DoppelTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS doppel RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY src/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/doppel FILES_MATCHING PATTERN "*.h")
install(EXPORT DoppelTargets NAMESPACE Doppel:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Doppel)
configure_package_config_file(cmake/DoppelConfig.cmake.in DoppelConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Doppel)
write_basic_package_version_file(DoppelConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/DoppelConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/DoppelConfigVersion.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Doppel)
