# Debian packages by `cpack`: `doppel` with the program, the shared library and the configurations; `libdoppel-dev` with
# headers, static libraries and the CMake package. scripts/package.sh builds both.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "The authors of Doppel")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL program development)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_STRIP_FILES ON)

set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "${PROJECT_DESCRIPTION}")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME doppel)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)

# Who builds against the libraries needs the development packages with which they were built.
file(STRINGS ${PROJECT_SOURCE_DIR}/scripts/install_dependencies.sh lines REGEX "^  [a-z].*-dev")
string(REGEX MATCHALL "[a-z0-9+.-]+-dev" development_packages "${lines}")
list(FILTER development_packages EXCLUDE REGEX "gtest|gmock|embree|osmesa|ceres")
list(JOIN development_packages ", " development_packages)
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Headers and static libraries of Doppel")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libdoppel-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "doppel (= ${PROJECT_VERSION}), ${development_packages}")
include(CPack)
