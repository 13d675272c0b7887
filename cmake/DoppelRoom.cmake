# doppel_room(NAME SOURCES ... [KERNELS ...] [TORCH] [DEPENDS ...])
#   One room of the house: a static library doppel_<name> whose headers are included as "doppel/<name>/...".
#   SOURCES  ordinary translation units
#   KERNELS  translation units compiled once per instruction set and chosen at run time (core/cpu_dispatch.h)
#   TORCH    the room works on tensors: it links LibTorch and shares the precompiled torch header
#   DEPENDS  rooms below (doppel_core, ...) and outside libraries, all public
#
# doppel_test(ROOM SOURCES ... DEPENDS ...)
#   The executable <room>_test and its ctest entries: <room> for everything but suites named Real*, and
#   <room>_real (label `real`) for those; they look for DOPPEL_SHARED and skip without it.

add_library(doppel_flags INTERFACE)
add_library(Doppel::doppel_flags ALIAS doppel_flags)
target_compile_options(doppel_flags INTERFACE
  $<BUILD_INTERFACE:-Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wno-unknown-pragmas>)
if(DOPPEL_SANITIZE)
  # GCC 12 sees uninitialised members inside std::regex, std::function and its own intrinsics once sanitizers are on;
  # there are none.
  target_compile_options(doppel_flags INTERFACE
    $<BUILD_INTERFACE:-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer
    -Wno-maybe-uninitialized -Wno-uninitialized>)
  target_link_options(doppel_flags INTERFACE $<BUILD_INTERFACE:-fsanitize=address,undefined>)
endif()

# LibTorch's headers as system headers, so that our warnings are ours alone.
add_library(doppel_torch INTERFACE)
target_include_directories(doppel_torch SYSTEM INTERFACE "$<BUILD_INTERFACE:${TORCH_INCLUDE_DIRS}>")
target_link_libraries(doppel_torch INTERFACE ${TORCH_LIBRARIES} OpenMP::OpenMP_CXX)
separate_arguments(doppel_torch_flags UNIX_COMMAND "${TORCH_CXX_FLAGS}")
target_compile_options(doppel_torch INTERFACE ${doppel_torch_flags})

# The torch headers, compiled once for the whole project.
file(WRITE ${CMAKE_BINARY_DIR}/pch/torch_pch.cpp "// Holds the precompiled torch header that every room reuses.\n")
add_library(doppel_torch_pch OBJECT ${CMAKE_BINARY_DIR}/pch/torch_pch.cpp)
target_link_libraries(doppel_torch_pch PRIVATE doppel_flags doppel_torch Threads::Threads)
target_precompile_headers(doppel_torch_pch PRIVATE <torch/torch.h> <torch/script.h> <ATen/Parallel.h>)

set(DOPPEL_ISA_FLAGS_avx2 -mavx2 -mfma -mf16c)
set(DOPPEL_ISA_FLAGS_avx512 -mavx512f -mavx512bw -mavx512dq -mavx512vl -mavx2 -mfma -mf16c -mprefer-vector-width=512)
set(DOPPEL_ISAS baseline)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  list(APPEND DOPPEL_ISAS avx2 avx512)
endif()

# Kernels see no library's inline code but <cmath> and friends: a function the linker may share between
# instruction sets would end up compiled for the widest.
function(doppel_kernels target)
  foreach(isa IN LISTS DOPPEL_ISAS)
    set(object ${target}_kernels_${isa})
    add_library(${object} OBJECT ${ARGN})
    target_include_directories(${object} PRIVATE ${CMAKE_SOURCE_DIR}/src)
    target_compile_definitions(${object} PRIVATE DOPPEL_ISA=${isa})
    target_compile_options(${object} PRIVATE -O3 -fno-math-errno -fno-trapping-math ${DOPPEL_ISA_FLAGS_${isa}})
    target_link_libraries(${object} PRIVATE doppel_flags)
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:${object}>)
  endforeach()
endfunction()

# The target `headers` compiles every header of every room alone, which is how a user includes it. It is no part of the
# ordinary build; scripts/check.sh asks for it. (In rooms with TORCH the torch headers are there already.)
function(doppel_room_headers name torch)
  file(GLOB_RECURSE headers RELATIVE ${CMAKE_SOURCE_DIR}/src ${CMAKE_CURRENT_SOURCE_DIR}/*.h)
  list(FILTER headers EXCLUDE REGEX "lanes\\.h$")  # parts of kernel files, which refuse to stand alone
  set(sources)
  foreach(header IN LISTS headers)
    string(MAKE_C_IDENTIFIER ${header} unit)
    set(source ${CMAKE_BINARY_DIR}/headers/${unit}.cpp)
    # Twice: the second time it must change nothing.
    file(CONFIGURE OUTPUT ${source} CONTENT "#include \"${header}\"\n#include \"${header}\"\n")
    list(APPEND sources ${source})
  endforeach()
  add_library(doppel_${name}_headers OBJECT EXCLUDE_FROM_ALL ${sources})
  target_link_libraries(doppel_${name}_headers PRIVATE doppel_${name})
  if(torch)
    target_precompile_headers(doppel_${name}_headers REUSE_FROM doppel_torch_pch)
  endif()
  if(NOT TARGET headers)
    add_custom_target(headers)
  endif()
  add_dependencies(headers doppel_${name}_headers)
endfunction()

function(doppel_room name)
  cmake_parse_arguments(ARG "TORCH" "" "SOURCES;KERNELS;DEPENDS" ${ARGN})
  set(target doppel_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(Doppel::${target} ALIAS ${target})
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}/src> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_17)
  target_link_libraries(${target} PUBLIC doppel_flags Threads::Threads ${ARG_DEPENDS})
  if(ARG_TORCH)
    target_link_libraries(${target} PUBLIC doppel_torch)
    target_precompile_headers(${target} REUSE_FROM doppel_torch_pch)
  endif()
  if(ARG_KERNELS)
    doppel_kernels(${target} ${ARG_KERNELS})
  endif()
  set_property(GLOBAL APPEND PROPERTY DOPPEL_ROOMS ${target})
  if(DOPPEL_BUILD_TESTS)
    doppel_room_headers(${name} "${ARG_TORCH}")
  endif()
endfunction()

# A program that reuses the torch header: GCC takes a precompiled header only where the code is position-independent in
# the same way, so -fPIC here too, not an executable's own -fPIE.
function(doppel_reuse_torch_header program)
  set_target_properties(${program} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
  target_compile_options(${program} PRIVATE -fPIC)
  target_precompile_headers(${program} REUSE_FROM doppel_torch_pch)
endfunction()

function(doppel_test room)
  cmake_parse_arguments(ARG "TORCH" "" "SOURCES;DEPENDS" ${ARGN})
  set(target ${room}_test)
  add_executable(${target} ${ARG_SOURCES})
  target_include_directories(${target} PRIVATE ${CMAKE_SOURCE_DIR}/tests)
  target_link_libraries(${target} PRIVATE ${ARG_DEPENDS} GTest::gmock GTest::gtest_main)
  if(ARG_TORCH)
    doppel_reuse_torch_header(${target})
  endif()
  add_test(NAME ${room} COMMAND ${target} --gtest_filter=-Real* --gtest_brief=1)
  file(STRINGS ${CMAKE_CURRENT_SOURCE_DIR}/CMakeLists.txt has_real REGEX "HAS_REAL_TESTS")
  if(has_real)
    add_test(NAME ${room}_real COMMAND ${target} --gtest_filter=Real* --gtest_brief=1)
    set_tests_properties(${room}_real PROPERTIES LABELS real)
  endif()
endfunction()
