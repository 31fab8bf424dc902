# Private helpers of this project's own build. Nothing here reaches a consumer.

set(STILLPOINT_FIND_DIR ${CMAKE_CURRENT_LIST_DIR})
include(${CMAKE_CURRENT_LIST_DIR}/StillpointFind.cmake)

# An INTERFACE target `name` with alias stillpoint::<name without stillpoint_> over include/ or, for
# a back end, over its own include folder `include_dir`. It becomes a find_package component of that
# name (the target `stillpoint` itself: component `core`). All headers are checked without RTTI; a back
# end whose dependency needs it says set_property(GLOBAL PROPERTY STILLPOINT_NEEDS_RTTI_<name> ON).
# Headers for hosts of C++14 say so by a third argument, 14.
function(stillpoint_interface_target name include_dir)
  add_library(${name} INTERFACE)
  stillpoint_component(${name} "${include_dir}" ${ARGN})
endfunction()

# The same for a target that exists already: a compiled library.
function(stillpoint_component name include_dir)
  set(standard 17)
  if(ARGC GREATER 2)
    set(standard ${ARGV2})
  endif()
  string(REGEX REPLACE "^stillpoint_" "" export_name ${name})
  add_library(stillpoint::${export_name} ALIAS ${name})
  set_target_properties(${name} PROPERTIES EXPORT_NAME ${export_name})
  target_compile_features(${name} INTERFACE cxx_std_${standard})
  if(include_dir STREQUAL "")
    set(include_dir ${PROJECT_SOURCE_DIR}/include)
  endif()
  target_include_directories(${name} INTERFACE $<BUILD_INTERFACE:${include_dir}>
                                               $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  set_property(GLOBAL PROPERTY STILLPOINT_INCLUDE_DIR_${name} ${include_dir})
  set_property(GLOBAL PROPERTY STILLPOINT_STANDARD_${name} ${standard})
  set_property(GLOBAL APPEND PROPERTY STILLPOINT_INSTALL_TARGETS ${name})
  set_property(GLOBAL APPEND PROPERTY STILLPOINT_INSTALL_INCLUDE_DIRS ${include_dir})
endfunction()

# Finds a dependency of `component` (arguments: see stillpoint_find) and remembers it for the
# installed package. If it is missing, sets <found> to OFF and says which Debian package brings it;
# the caller returns. A component that is named in STILLPOINT_BACKENDS must have it. With `auto`
# nothing is looked for that the core does not use itself: a parent project that wants no optimizer
# does not get one.
#
#     stillpoint_dependency(found flann PACKAGE flann TARGETS flann::flann DEBIAN libflann-dev)
#     if(NOT found)
#       return()
#     endif()
macro(stillpoint_dependency found component)
  stillpoint_package_of(_stillpoint_package ${ARGN})
  if("${STILLPOINT_BACKENDS}" STREQUAL "auto" AND
     NOT "${_stillpoint_package}" IN_LIST STILLPOINT_CORE_PACKAGES)
    set(${found} OFF)
    set(${found}_MESSAGE "component '${component}' needs ${_stillpoint_package}, which is looked for \
only when STILLPOINT_BACKENDS names it")
  else()
    stillpoint_find(${found} ${component} ${ARGN})
  endif()
  if(NOT "${_stillpoint_package}" IN_LIST STILLPOINT_CORE_PACKAGES)
    set_property(GLOBAL PROPERTY STILLPOINT_NEEDS_MORE_${component} ON)
  endif()
  string(REPLACE ";" " " _stillpoint_arguments "${ARGN}")
  set_property(GLOBAL APPEND_STRING PROPERTY STILLPOINT_DEPENDENCIES_${component}
    "if(_stillpoint_problem STREQUAL \"\")
  stillpoint_find(_stillpoint_found ${component} ${_stillpoint_arguments})
  set(_stillpoint_problem \"\${_stillpoint_found_MESSAGE}\")
endif()
")
  if(NOT ${found})
    set_property(GLOBAL APPEND PROPERTY STILLPOINT_MISSING_COMPONENTS ${component})
    set_property(GLOBAL PROPERTY STILLPOINT_MISSING_${component} "${${found}_MESSAGE}")
    if("${component}" IN_LIST STILLPOINT_BACKENDS)
      message(FATAL_ERROR "stillpoint: ${${found}_MESSAGE}")
    elseif(NOT "${STILLPOINT_BACKENDS}" STREQUAL "auto")
      message(STATUS "stillpoint: left out: ${${found}_MESSAGE}")
    endif()
  endif()
endmacro()

set(STILLPOINT_CORE_PACKAGES Eigen3 OpenCV Threads)

function(stillpoint_package_of result)
  cmake_parse_arguments(ARG "" "PACKAGE" "" ${ARGN})
  set(${result} "${ARG_PACKAGE}" PARENT_SCOPE)
endfunction()

# Warnings for the project's own programs only; never reaches a consumer.
function(stillpoint_private_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow)
  if(STILLPOINT_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()

# A program of the project's own GoogleTest tests over `sources`, linked with the targets in ARGN;
# each test becomes one of ctest's. Does nothing when tests are off.
function(stillpoint_test_program name sources)
  if(NOT STILLPOINT_BUILD_TESTS)
    return()
  endif()
  add_executable(${name} ${sources})
  target_link_libraries(${name} PRIVATE ${ARGN} GTest::gtest_main)
  target_compile_definitions(${name} PRIVATE
    STILLPOINT_SHARED_DATA="${PROJECT_SOURCE_DIR}/../shared/data")
  stillpoint_private_warnings(${name})
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60)
endfunction()

# Compiles the files of a program `files_at_once` at a time: each alone would compile the headers of
# OpenCV, Eigen and the front end again, which is most of the work.
function(stillpoint_compile_together target files_at_once)
  set_target_properties(${target} PROPERTIES
    UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${files_at_once})
endfunction()

# The test of the back end whose CMakeLists.txt calls it: test.cpp of that folder.
function(stillpoint_backend_test name)
  stillpoint_test_program(stillpoint_${name}_test ${CMAKE_CURRENT_SOURCE_DIR}/test.cpp
                          stillpoint::${name} ${ARGN})
endfunction()
