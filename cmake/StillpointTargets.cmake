# Private helpers of this project's own build.

# An INTERFACE target `name` with alias stillpoint::<alias or name> over include/ (and, for a back
# end, its own include folder `include_dir`).
function(stillpoint_interface_target name include_dir)
  add_library(${name} INTERFACE)
  string(REGEX REPLACE "^stillpoint_" "" export_name ${name})
  add_library(stillpoint::${export_name} ALIAS ${name})
  set_target_properties(${name} PROPERTIES EXPORT_NAME ${export_name})
  target_compile_features(${name} INTERFACE cxx_std_17)
  if(include_dir STREQUAL "")
    set(include_dir ${PROJECT_SOURCE_DIR}/include)
  endif()
  target_include_directories(${name} INTERFACE $<BUILD_INTERFACE:${include_dir}>
                                               $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  set_property(GLOBAL APPEND PROPERTY STILLPOINT_INSTALL_TARGETS ${name})
endfunction()

# Warnings for the project's own programs only; never reaches a consumer.
function(stillpoint_private_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow)
  if(STILLPOINT_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()
