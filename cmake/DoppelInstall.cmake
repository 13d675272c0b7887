# What is installed. Component `program`: what a user of the program and of the C API needs. Component `development`:
# find_package(Doppel) for the outside world; tests/install builds a consumer against it.
include(CMakePackageConfigHelpers)
install(TARGETS doppel RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
install(DIRECTORY configs DESTINATION ${CMAKE_INSTALL_DATADIR}/doppel COMPONENT program)
install(FILES README.md SECURITY.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright COMPONENT program)

set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME development)
get_property(modules GLOBAL PROPERTY DOPPEL_MODULES)
install(TARGETS ${modules} doppel_flags doppel_torch EXPORT DoppelTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
get_property(headers GLOBAL PROPERTY DOPPEL_PUBLIC_HEADERS)
foreach(header IN LISTS headers)
  cmake_path(GET header PARENT_PATH folder)
  install(FILES src/${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/doppel/${folder})
endforeach()
# scripts/docs.sh makes API pages of these.
list(TRANSFORM headers PREPEND src/)
list(APPEND headers include/doppel/actor.h)
list(JOIN headers "\n" lines)
file(WRITE ${CMAKE_BINARY_DIR}/public_headers.txt "${lines}\n")
install(EXPORT DoppelTargets NAMESPACE Doppel:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Doppel)
configure_package_config_file(cmake/DoppelConfig.cmake.in DoppelConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Doppel)
write_basic_package_version_file(DoppelConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/DoppelConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/DoppelConfigVersion.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Doppel)
