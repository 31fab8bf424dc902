# Install rules: headers, one export set per component, the package config file, pkg-config.
# One export set per component means that a consumer's CMake loads the targets (and looks for the
# dependencies) of the components that were asked for, and of no others.

include(CMakePackageConfigHelpers)

get_property(targets GLOBAL PROPERTY STILLPOINT_INSTALL_TARGETS)
get_property(include_dirs GLOBAL PROPERTY STILLPOINT_INSTALL_INCLUDE_DIRS)
get_property(missing GLOBAL PROPERTY STILLPOINT_MISSING_COMPONENTS)
set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/stillpoint)

if(include_dirs)
  list(REMOVE_DUPLICATES include_dirs)
endif()
foreach(dir IN LISTS include_dirs)
  install(DIRECTORY ${dir}/stillpoint DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
          FILES_MATCHING PATTERN "*.hpp" PATTERN "*.h")
endforeach()

set(STILLPOINT_COMPONENTS)
set(STILLPOINT_COMPONENT_RULES)
foreach(target IN LISTS targets)
  get_target_property(component ${target} EXPORT_NAME)
  if(component STREQUAL "stillpoint")
    set(component core)
  endif()
  list(APPEND STILLPOINT_COMPONENTS ${component})
  # A compiled library may not be built: the headers need no build. The package then says so of its
  # component.
  install(TARGETS ${target} EXPORT stillpoint-${component}
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} OPTIONAL
          LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} OPTIONAL
          RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} OPTIONAL)
  get_target_property(type ${target} TYPE)
  if(type MATCHES "^(SHARED|STATIC)_LIBRARY$")
    set(library ${CMAKE_${CMAKE_MATCH_1}_LIBRARY_PREFIX}${target}${CMAKE_${CMAKE_MATCH_1}_LIBRARY_SUFFIX})
    string(APPEND STILLPOINT_COMPONENT_RULES "set(_stillpoint_library_${component} \
\"\${PACKAGE_PREFIX_DIR}/${CMAKE_INSTALL_LIBDIR}/${library}\")\n")
    install(CODE "if(NOT EXISTS \"$<TARGET_FILE:${target}>\")
  message(STATUS \"stillpoint: not installed, as it is not built: component '${component}'\")
endif()")
  endif()
  install(EXPORT stillpoint-${component} NAMESPACE stillpoint:: DESTINATION ${config_dir}
          FILE stillpoint-${component}-targets.cmake)

  # Which other components this one links.
  set(needs)
  get_target_property(linked ${target} INTERFACE_LINK_LIBRARIES)
  foreach(item IN LISTS linked)
    string(REGEX REPLACE "^stillpoint::" "stillpoint_" item "${item}")
    string(REGEX REPLACE "^stillpoint_stillpoint$" "stillpoint" item "${item}")
    if("${item}" IN_LIST targets)
      string(REGEX REPLACE "^stillpoint_" "" item "${item}")
      string(REGEX REPLACE "^stillpoint$" "core" item "${item}")
      list(APPEND needs ${item})
    endif()
  endforeach()
  string(REPLACE ";" " " needs "${needs}")
  string(APPEND STILLPOINT_COMPONENT_RULES "set(_stillpoint_needs_${component} ${needs})\n")
  get_property(needs_more GLOBAL PROPERTY STILLPOINT_NEEDS_MORE_${component})
  if(NOT needs_more)
    string(APPEND STILLPOINT_COMPONENT_RULES "list(APPEND _stillpoint_light ${component})\n")
  endif()
  get_property(dependencies GLOBAL PROPERTY STILLPOINT_DEPENDENCIES_${component})
  set(dependencies_file ${PROJECT_BINARY_DIR}/cmake/stillpoint-${component}-dependencies.cmake)
  file(WRITE ${dependencies_file} "${dependencies}")
  install(FILES ${dependencies_file} DESTINATION ${config_dir})
endforeach()
if(missing)
  list(REMOVE_DUPLICATES missing)
endif()
foreach(component IN LISTS missing)
  get_property(why GLOBAL PROPERTY STILLPOINT_MISSING_${component})
  string(APPEND STILLPOINT_COMPONENT_RULES "set(_stillpoint_not_built_${component} \"${why}\")\n")
endforeach()

configure_package_config_file(cmake/stillpoint-config.cmake.in
  ${PROJECT_BINARY_DIR}/cmake/stillpoint-config.cmake INSTALL_DESTINATION ${config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/cmake/stillpoint-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/cmake/stillpoint-config.cmake
              ${PROJECT_BINARY_DIR}/cmake/stillpoint-config-version.cmake
              ${PROJECT_SOURCE_DIR}/cmake/StillpointFind.cmake
        DESTINATION ${config_dir})
file(GLOB find_modules ${PROJECT_SOURCE_DIR}/cmake/Find*.cmake)
install(FILES ${find_modules} DESTINATION ${config_dir})

# pkg-config, for the core alone. The prefix is taken from the file's own place.
file(RELATIVE_PATH STILLPOINT_PC_PREFIX ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig
     ${CMAKE_INSTALL_PREFIX})
string(REGEX REPLACE "/$" "" STILLPOINT_PC_PREFIX "${STILLPOINT_PC_PREFIX}")
string(REGEX MATCH "^[0-9]+" STILLPOINT_PC_OPENCV "${found_opencv_VERSION}")
if(STILLPOINT_PC_OPENCV STREQUAL "3")
  set(STILLPOINT_PC_OPENCV "")  # Its file is opencv.pc; later ones carry the major version.
endif()
set(STILLPOINT_PC_OPENCV "opencv${STILLPOINT_PC_OPENCV}")
configure_file(cmake/stillpoint.pc.in ${PROJECT_BINARY_DIR}/cmake/stillpoint.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/cmake/stillpoint.pc
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
