# Nothing but include directories, language level and dependencies may come with our targets. STANDARD:
# the language level, if it is not 17.
function(check_stillpoint_targets)
  cmake_parse_arguments(ARG "" "STANDARD" "" ${ARGN})
  if(NOT ARG_STANDARD)
    set(ARG_STANDARD 17)
  endif()
  foreach(target IN LISTS ARG_UNPARSED_ARGUMENTS)
    foreach(property INTERFACE_COMPILE_OPTIONS INTERFACE_COMPILE_DEFINITIONS INTERFACE_LINK_OPTIONS
                     INTERFACE_SOURCES INTERFACE_PRECOMPILE_HEADERS INTERFACE_LINK_DIRECTORIES)
      get_target_property(value ${target} ${property})
      if(value)
        message(FATAL_ERROR "${target} exports ${property}: ${value}")
      endif()
    endforeach()
    get_target_property(features ${target} INTERFACE_COMPILE_FEATURES)
    if(NOT features STREQUAL "cxx_std_${ARG_STANDARD}")
      message(FATAL_ERROR "${target} exports the features ${features}")
    endif()
  endforeach()
endfunction()

# What a parent project can feel of its own settings, as one string.
function(parent_settings result)
  set(text "")
  foreach(variable CMAKE_CXX_FLAGS CMAKE_CXX_FLAGS_RELEASE CMAKE_CXX_FLAGS_DEBUG CMAKE_C_FLAGS
                   CMAKE_EXE_LINKER_FLAGS CMAKE_SHARED_LINKER_FLAGS CMAKE_BUILD_TYPE
                   CMAKE_CXX_STANDARD CMAKE_CXX_STANDARD_REQUIRED CMAKE_CXX_EXTENSIONS
                   CMAKE_POSITION_INDEPENDENT_CODE BUILD_SHARED_LIBS BUILD_TESTING
                   CMAKE_MODULE_PATH CMAKE_PREFIX_PATH CMAKE_RUNTIME_OUTPUT_DIRECTORY
                   OpenCV_LIBS OpenCV_LIBRARIES)
    string(APPEND text "${variable}=${${variable}}\n")
  endforeach()
  foreach(property COMPILE_OPTIONS COMPILE_DEFINITIONS INCLUDE_DIRECTORIES LINK_OPTIONS
                   LINK_DIRECTORIES TESTS)
    get_directory_property(value ${property})
    string(APPEND text "${property}=${value}\n")
  endforeach()
  set(${result} "${text}" PARENT_SCOPE)
endfunction()
