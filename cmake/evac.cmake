# How a module and a test are declared. A module is a folder of .cpp files that becomes the library evac_NAME.

find_program(EVAC_CCACHE ccache)
if(EVAC_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${EVAC_CCACHE})
endif()

set(EVAC_SANITIZE "" CACHE STRING "Sanitizers to build with, e.g. address,undefined")
add_library(evac_options INTERFACE)
target_compile_options(evac_options INTERFACE -Wall -Wextra -Werror
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)  # g++ 12 sees overlapping copies in "text" + string (its bug 105651)
target_include_directories(evac_options INTERFACE ${CMAKE_SOURCE_DIR} ${CMAKE_BINARY_DIR})
if(EVAC_SANITIZE)
  add_compile_options(-fsanitize=${EVAC_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_compile_options(evac_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)  # g++ 12 on std::regex, instrumented
  # Boost.Asio's fences stand beside its mutexes, which ThreadSanitizer does see.
  target_compile_options(evac_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-tsan>)
  add_link_options(-fsanitize=${EVAC_SANITIZE})
endif()

# A release is for whoever waits for it to compile, too: what only passes data on (apps, tests) with -O1, which is 25 to
# 40 % less to compile, the rest with -O2, and the worlds and the network with -O3.
function(evac_optimise target level)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:${level}>)
endfunction()

# cmake/prelude.h, and what else is given, is compiled once for the target. (One for many targets: they would have to
# agree in every option.)
function(evac_precompile target)
  target_precompile_headers(${target} PRIVATE ${CMAKE_SOURCE_DIR}/cmake/prelude.h ${ARGN})
endfunction()

# evac_module(NAME [LIBRARIES ...]): all .cpp files below this folder, except those in EXCLUDE.
function(evac_module name)
  cmake_parse_arguments(ARG "" "" "LIBRARIES;EXCLUDE" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cpp)
  foreach(pattern ${ARG_EXCLUDE})
    list(FILTER sources EXCLUDE REGEX ${pattern})
  endforeach()
  if(NOT sources)
    add_library(evac_${name} INTERFACE)
    target_link_libraries(evac_${name} INTERFACE evac_options ${ARG_LIBRARIES})
    return()
  endif()
  add_library(evac_${name} STATIC ${sources})
  target_link_libraries(evac_${name} PUBLIC evac_options ${ARG_LIBRARIES})
  evac_precompile(evac_${name})
endfunction()

# Published tables, recordings and golden files that are not in this repository: tests that want them are skipped without.
set(EVAC_SHARED_DIR "${CMAKE_SOURCE_DIR}/../shared" CACHE PATH "Where tests look for data/ that is not in this repository")

# evac_test(NAME [LIBRARIES ...]): all *_test.cpp below this folder become the binary bin/NAME_test, run by ctest.
function(evac_test name)
  cmake_parse_arguments(ARG "" "" "LIBRARIES" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*_test.cpp)
  if(NOT sources)
    return()
  endif()
  add_executable(${name}_test ${sources})
  target_link_libraries(${name}_test PRIVATE evac_options evac_test_support ${ARG_LIBRARIES} GTest::gmock GTest::gtest_main)
  evac_optimise(${name}_test -O1)
  evac_precompile(${name}_test <gmock/gmock.h>)
  target_compile_definitions(${name}_test PRIVATE EVAC_SOURCE_DIR="${CMAKE_SOURCE_DIR}"
    EVAC_SHARED_DIR="${EVAC_SHARED_DIR}" EVAC_BIN_DIR="${CMAKE_BINARY_DIR}/bin")
  add_test(NAME ${name} COMMAND ${name}_test)
endfunction()
