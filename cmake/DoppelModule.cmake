# doppel_module(NAME [TORCH] [TORCH_SOURCES ...] [KERNELS ...] [GENERATED ...] PUBLIC_HEADERS ... SHARED_HEADERS ... DEPENDS ...)
#   One module: a library doppel_<name> of every .cpp below its folder. Headers are included as "doppel/<name>/...".
#   TORCH           the module works on tensors: it links LibTorch, and all its sources use the precompiled torch header
#   TORCH_SOURCES   a module without TORCH: the sources that work on tensors, as glob expressions
#   KERNELS         sources compiled once per instruction set and chosen when the program starts (core/cpu_dispatch.h)
#   GENERATED       sources written by the build
#   PUBLIC_HEADERS  the interface: installed, documented and stable. Of Doppel they include public headers only.
#   SHARED_HEADERS  what other modules include besides; not installed. All other headers are private to the module;
#                   tests/levels reads both lists.
#   DEPENDS         modules of lower levels (doppel_core, ...) and outside libraries, all public
#   A folder with a CMakeLists.txt of its own is a library of its own and no part of this one.
#
# doppel_builtin_files(SOURCE TABLE FOLDER NAME ...)
#   Writes SOURCE.cpp into the build: TABLE holds the files FOLDER/NAME.yaml. The module's header SOURCE.h declares TABLE.
#
# doppel_test(MODULE [TORCH] [REAL] DEPENDS ...)
#   The executable <module>_test of every *_test.cpp in its folder and its ctest entries: <module> for everything but
#   suites named Real*, and with REAL <module>_real (label `real`) for those; they look for DOPPEL_SHARED and skip
#   without it.
#
# Sources are compiled several at a time (unity builds): most of the time of a source goes into the headers it includes.
# DOPPEL_UNITY_BATCH and DOPPEL_TEST_BATCH say how many; 1 compiles each alone. The preset `dev` links the modules as shared
# libraries and compiles each test alone, and each source of the modules in DOPPEL_DEV_MODULES: there a change is one short
# compilation and one short link.

set(DOPPEL_UNITY_BATCH 14 CACHE STRING "How many sources are compiled as one; 1: each alone")
set(DOPPEL_DEV_MODULES "" CACHE STRING "Modules whose sources are compiled each alone, whatever DOPPEL_UNITY_BATCH says")
set(DOPPEL_TEST_BATCH 10 CACHE STRING "How many tests are compiled as one; 1: each alone")

# Includes read the same in the tree and in an installed copy: this link makes "doppel/core/error.h" of src/core/error.h.
set(DOPPEL_INCLUDE_DIR ${CMAKE_BINARY_DIR}/include)
file(MAKE_DIRECTORY ${DOPPEL_INCLUDE_DIR})
file(CREATE_LINK ${CMAKE_SOURCE_DIR}/src ${DOPPEL_INCLUDE_DIR}/doppel SYMBOLIC)

add_library(doppel_flags INTERFACE)
add_library(Doppel::doppel_flags ALIAS doppel_flags)
target_compile_options(doppel_flags INTERFACE
  $<BUILD_INTERFACE:-Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wno-unknown-pragmas
  # GCC 12 misreads the inlined operator+ of std::string in C++20 (its bug 105651).
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict;-Wno-stringop-overflow;-Wno-array-bounds>
  # GCC's garbage collection starts at a larger heap: a tenth less time for a tenth more memory.
  $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1000000>>)
if(DOPPEL_SANITIZE)
  # GCC 12 reports uninitialised members inside std::regex, std::function and its own intrinsics once sanitizers are on;
  # there are none.
  set(sanitizers -fsanitize=address,undefined -fno-sanitize-recover=undefined)
  if(DOPPEL_SANITIZE STREQUAL thread)
    set(sanitizers -fsanitize=thread)
  endif()
  target_compile_options(doppel_flags INTERFACE
    "$<BUILD_INTERFACE:${sanitizers};-fno-omit-frame-pointer;-Wno-maybe-uninitialized;-Wno-uninitialized>")
  target_link_options(doppel_flags INTERFACE "$<BUILD_INTERFACE:${sanitizers}>")
endif()

# LibTorch's headers as system headers, so that only our own code is held to our warnings.
add_library(doppel_torch INTERFACE)
target_include_directories(doppel_torch SYSTEM INTERFACE "$<BUILD_INTERFACE:${TORCH_INCLUDE_DIRS}>")
target_link_libraries(doppel_torch INTERFACE ${TORCH_LIBRARIES} OpenMP::OpenMP_CXX)
# The library's choice of the C++ ABI, for all sources: precompiled headers are shared.
separate_arguments(doppel_torch_flags UNIX_COMMAND "${TORCH_CXX_FLAGS}")
target_compile_options(doppel_torch INTERFACE ${doppel_torch_flags})
target_compile_options(doppel_flags INTERFACE "$<BUILD_INTERFACE:${doppel_torch_flags}>")

# Precompiled headers: what most sources of others' libraries include, once for sources without LibTorch and once with.
# GCC instantiates the templates of a precompiled header again in each unit. This takes 6 s with all of
# <torch/torch.h>, 3 s with these.
set(DOPPEL_PLAIN_HEADERS
  <algorithm> <filesystem> <functional> <map> <memory> <optional> <set> <span> <sstream> <string> <vector>
  <fmt/format.h> <Eigen/Core> <Eigen/Geometry> <opencv2/core.hpp> <nlohmann/json.hpp>)
set(DOPPEL_PLAIN_LIBRARIES Threads::Threads OpenMP::OpenMP_CXX fmt::fmt Eigen3::Eigen opencv_core nlohmann_json::nlohmann_json)
set(DOPPEL_TORCH_HEADERS
  ${DOPPEL_PLAIN_HEADERS} <torch/types.h> <torch/autograd.h> <torch/nn/module.h> <torch/nn/pimpl.h> <ATen/Parallel.h>)
set(DOPPEL_TORCH_LIBRARIES ${DOPPEL_PLAIN_LIBRARIES} doppel_torch)

# doppel_precompiled(NAME HEADERS ... LIBRARIES ...): an object library that holds a precompiled header.
function(doppel_precompiled name)
  cmake_parse_arguments(ARG "" "" "HEADERS;LIBRARIES" ${ARGN})
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/pch/${name}.cpp CONTENT "// Holds a precompiled header.\n")
  add_library(${name} OBJECT ${CMAKE_BINARY_DIR}/pch/${name}.cpp)
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES})
  target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
endfunction()

doppel_precompiled(doppel_plain_pch HEADERS ${DOPPEL_PLAIN_HEADERS} LIBRARIES ${DOPPEL_PLAIN_LIBRARIES} doppel_flags)
doppel_precompiled(doppel_torch_pch HEADERS ${DOPPEL_TORCH_HEADERS} LIBRARIES ${DOPPEL_TORCH_LIBRARIES} doppel_flags)

set(DOPPEL_ISA_FLAGS_avx2 -mavx2 -mfma -mf16c)
set(DOPPEL_ISA_FLAGS_avx512 -mavx512f -mavx512bw -mavx512dq -mavx512vl -mavx2 -mfma -mf16c -mprefer-vector-width=512)
set(DOPPEL_ISAS baseline)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  list(APPEND DOPPEL_ISAS avx2 avx512)
endif()

# Kernels include no library's inline code but <cmath> and friends: a function that the linker may share between
# instruction sets would end up compiled for the widest.
function(doppel_kernels target)
  foreach(isa IN LISTS DOPPEL_ISAS)
    set(object ${target}_kernels_${isa})
    add_library(${object} OBJECT ${ARGN})
    target_include_directories(${object} PRIVATE ${DOPPEL_INCLUDE_DIR})
    target_compile_definitions(${object} PRIVATE DOPPEL_ISA=${isa})
    # GCC 12 reports uninitialised variables inside its own intrinsics.
    target_compile_options(${object} PRIVATE -O3 -fno-math-errno -fno-trapping-math ${DOPPEL_ISA_FLAGS_${isa}}
      $<$<CXX_COMPILER_ID:GNU>:-Wno-uninitialized>)
    target_link_libraries(${object} PRIVATE doppel_flags)
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:${object}>)
  endforeach()
endfunction()

# Compiles up to `batch` sources of a target as one. BY_FOLDER: never sources of two folders, whose outside libraries may
# use the same names.
function(doppel_unity target batch)
  cmake_parse_arguments(ARG "BY_FOLDER" "" "" ${ARGN})
  get_target_property(sources ${target} SOURCES)
  list(FILTER sources INCLUDE REGEX "^[^/$].*\\.cpp$")  # without generated sources, which have full paths
  if(batch LESS_EQUAL 1 OR NOT sources)
    return()
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  set(folders)
  foreach(source IN LISTS sources)
    set(folder "")
    if(ARG_BY_FOLDER)
      cmake_path(GET source PARENT_PATH folder)
      string(MAKE_C_IDENTIFIER "${folder}" folder)
    endif()
    list(APPEND folders "${folder}_")
    list(APPEND sources_of_${folder}_ ${source})
  endforeach()
  list(REMOVE_DUPLICATES folders)
  foreach(folder IN LISTS folders)
    # The units have equally many sources, so that no unit takes much longer than the others.
    list(LENGTH sources_of_${folder} count)
    math(EXPR units "(${count} + ${batch} - 1) / ${batch}")
    set(part 0)
    foreach(source IN LISTS sources_of_${folder})
      math(EXPR unit "${part} * ${units} / ${count}")
      math(EXPR part "${part} + 1")
      set_source_files_properties(${source} PROPERTIES UNITY_GROUP "${folder}${unit}")
    endforeach()
  endforeach()
endfunction()

# Leaves out files of folders that are libraries of their own.
function(doppel_own_files list)
  file(GLOB libraries RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} */CMakeLists.txt)
  foreach(library IN LISTS libraries)
    cmake_path(GET library PARENT_PATH folder)
    list(FILTER ${list} EXCLUDE REGEX "^${folder}/")
  endforeach()
  set(${list} ${${list}} PARENT_SCOPE)
endfunction()

# The target `headers` compiles every public and shared header alone, which is how a user includes it. It is no part of the
# ordinary build; scripts/check.sh asks for it. (In modules with TORCH the torch headers are there already.)
function(doppel_module_headers name torch)
  set(headers ${ARGN})
  list(FILTER headers EXCLUDE REGEX "lanes\\.h$")  # parts of kernel files, which refuse to stand alone
  if(NOT headers)
    return()
  endif()
  set(sources)
  foreach(header IN LISTS headers)
    string(MAKE_C_IDENTIFIER ${header} unit)
    set(source ${CMAKE_BINARY_DIR}/headers/${name}/${unit}.cpp)
    # Twice: the second time it must change nothing.
    file(CONFIGURE OUTPUT ${source} CONTENT "#include \"doppel/${name}/${header}\"\n#include \"doppel/${name}/${header}\"\n")
    list(APPEND sources ${source})
  endforeach()
  add_library(doppel_${name}_headers OBJECT EXCLUDE_FROM_ALL ${sources})
  target_link_libraries(doppel_${name}_headers PRIVATE doppel_${name} ${DOPPEL_TORCH_LIBRARIES})
  if(torch)
    target_precompile_headers(doppel_${name}_headers REUSE_FROM doppel_torch_pch)
  endif()
  if(NOT TARGET headers)
    add_custom_target(headers)
  endif()
  add_dependencies(headers doppel_${name}_headers)
endfunction()

function(doppel_builtin_files source table folder)
  set(files)
  foreach(name IN LISTS ARGN)
    set(file ${PROJECT_SOURCE_DIR}/${folder}/${name}.yaml)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
    file(READ ${file} text)
    string(APPEND files "    {\"${name}\", R\"yaml(${text})yaml\"},\n")
  endforeach()
  cmake_path(GET CMAKE_CURRENT_SOURCE_DIR FILENAME module)
  file(CONFIGURE OUTPUT ${source}.cpp @ONLY CONTENT [[
#include "doppel/@module@/@source@.h"

namespace doppel {

static constexpr BuiltinFile kFiles[] = {
@files@};
const std::span<const BuiltinFile> @table@ = kFiles;

}  // namespace doppel
]])
endfunction()

function(doppel_module name)
  cmake_parse_arguments(ARG "TORCH" "" "TORCH_SOURCES;KERNELS;GENERATED;PUBLIC_HEADERS;SHARED_HEADERS;DEPENDS" ${ARGN})
  set(target doppel_${name})
  set(batch ${DOPPEL_UNITY_BATCH})
  if(name IN_LIST DOPPEL_DEV_MODULES)
    set(batch 1)
  endif()
  file(GLOB_RECURSE sources RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS *.cpp)
  doppel_own_files(sources)
  set(torch_sources)
  if(ARG_TORCH_SOURCES)
    file(GLOB torch_sources RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS ${ARG_TORCH_SOURCES})
  endif()
  if(ARG_KERNELS OR torch_sources)
    list(REMOVE_ITEM sources ${ARG_KERNELS} ${torch_sources})
  endif()
  add_library(${target} ${sources} ${ARG_GENERATED})
  add_library(Doppel::${target} ALIAS ${target})
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${DOPPEL_INCLUDE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC doppel_flags Threads::Threads ${ARG_DEPENDS})
  if(ARG_TORCH)
    # Each unit costs 3 s for LibTorch's templates, so the units span folders.
    doppel_unity(${target} ${batch})
    target_link_libraries(${target} PUBLIC doppel_torch)
    target_precompile_headers(${target} REUSE_FROM doppel_torch_pch)
  else()
    doppel_unity(${target} ${batch} BY_FOLDER)
    # GCC takes a precompiled header only where -fopenmp and the definitions that it read are the same.
    target_link_libraries(${target} PRIVATE $<BUILD_INTERFACE:${DOPPEL_PLAIN_LIBRARIES}>)
    target_precompile_headers(${target} REUSE_FROM doppel_plain_pch)
  endif()
  if(torch_sources)
    add_library(${target}_torch OBJECT ${torch_sources})
    target_link_libraries(${target}_torch PRIVATE doppel_flags ${DOPPEL_TORCH_LIBRARIES} ${ARG_DEPENDS})
    target_include_directories(${target}_torch PRIVATE ${DOPPEL_INCLUDE_DIR})
    target_precompile_headers(${target}_torch REUSE_FROM doppel_torch_pch)
    doppel_unity(${target}_torch ${batch})
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:${target}_torch>)
    target_link_libraries(${target} PUBLIC doppel_torch)
  endif()
  if(ARG_KERNELS)
    doppel_kernels(${target} ${ARG_KERNELS})
  endif()
  set(public ${ARG_PUBLIC_HEADERS})
  list(TRANSFORM public PREPEND ${name}/)
  set_property(GLOBAL APPEND PROPERTY DOPPEL_PUBLIC_HEADERS ${public})
  set_property(GLOBAL APPEND PROPERTY DOPPEL_MODULES ${target})
  if(DOPPEL_BUILD_TESTS)
    doppel_module_headers(${name} "${ARG_TORCH}" ${ARG_PUBLIC_HEADERS} ${ARG_SHARED_HEADERS})
  endif()
endfunction()

# A program that reuses a precompiled header: GCC takes the header only where the code is position-independent in the
# same way, so -fPIC here too, not an executable's own -fPIE.
function(doppel_reuse_header program header)
  set_target_properties(${program} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
  target_compile_options(${program} PRIVATE -fPIC)
  target_precompile_headers(${program} REUSE_FROM ${header})
endfunction()

function(doppel_test module)
  cmake_parse_arguments(ARG "TORCH;REAL" "" "DEPENDS" ${ARGN})
  set(target ${module}_test)
  file(GLOB_RECURSE sources RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS *_test.cpp)
  add_executable(${target} ${sources})
  target_include_directories(${target} PRIVATE ${CMAKE_SOURCE_DIR}/tests)
  target_compile_definitions(${target} PRIVATE DOPPEL_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
  target_link_libraries(${target} PRIVATE doppel_test_base ${ARG_DEPENDS} GTest::gtest_main)
  doppel_unity(${target} ${DOPPEL_TEST_BATCH})
  if(DOPPEL_SANITIZE STREQUAL thread)
    target_sources(${target} PRIVATE ${CMAKE_SOURCE_DIR}/tests/sanitizers/one_opencv_thread.cpp)
  endif()
  if(ARG_TORCH)
    doppel_reuse_header(${target} doppel_torch_test_pch)
  else()
    doppel_reuse_header(${target} doppel_plain_test_pch)
  endif()
  add_test(NAME ${module} COMMAND ${target} --gtest_filter=-Real* --gtest_brief=1)
  if(ARG_REAL)
    add_test(NAME ${module}_real COMMAND ${target} --gtest_filter=Real* --gtest_brief=1)
    set_tests_properties(${module}_real PROPERTIES LABELS real)
  endif()
endfunction()
