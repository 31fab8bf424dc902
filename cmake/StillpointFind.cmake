# Finds one dependency of one component. Used by this project's own build and, installed beside it,
# by stillpoint-config.cmake, so that both look for the same things and say the same words.
#
# stillpoint_find(<found> <component> PACKAGE <name> DEBIAN <packages...>
#                 [VERSION <v>] [COMPONENTS <c...>] [TARGETS <t...>])
#
# Sets <found> and, if not found, <found>_MESSAGE. Targets that the caller's project already has are
# taken as they are: nothing is found (or linked) twice. A function, so that no variable of the
# found package (OpenCV_LIBS, ...) reaches the caller.
function(stillpoint_find found component)
  cmake_parse_arguments(ARG "" "PACKAGE;VERSION" "DEBIAN;COMPONENTS;TARGETS" ${ARGN})
  stillpoint_lacks_target(missing ${ARG_TARGETS})
  if(missing OR NOT ARG_TARGETS)
    set(CMAKE_MESSAGE_LOG_LEVEL WARNING)  # Ceres' package talks even when told to be quiet.
    list(INSERT CMAKE_MODULE_PATH 0 ${STILLPOINT_FIND_DIR})  # our Find<name>.cmake files
    # A project's own Find<name>.cmake may define no target (ORB_SLAM2's for Eigen3 does not): then
    # the package's own configuration is asked.
    foreach(mode "" CONFIG)
      if(ARG_COMPONENTS)
        find_package(${ARG_PACKAGE} ${ARG_VERSION} ${mode} QUIET
                     OPTIONAL_COMPONENTS ${ARG_COMPONENTS})
      else()
        find_package(${ARG_PACKAGE} ${ARG_VERSION} ${mode} QUIET)
      endif()
      stillpoint_lacks_target(missing ${ARG_TARGETS})
      if(NOT ${ARG_PACKAGE}_FOUND)
        set(missing ON)
      endif()
      if(NOT missing)
        break()
      endif()
    endforeach()
  endif()
  if(missing)
    string(REGEX REPLACE "^Stillpoint" "" package "${ARG_PACKAGE}")  # our own Find module's name
    string(REPLACE ";" " " what "${package};${ARG_VERSION};${ARG_COMPONENTS}")
    string(REGEX REPLACE " +" " " what "${what}")
    string(STRIP "${what}" what)
    string(REPLACE ";" " " debian "${ARG_DEBIAN}")
    set(${found} OFF PARENT_SCOPE)
    set(${found}_MESSAGE
        "component '${component}' needs ${what}, which was not found (Debian, Ubuntu: apt-get install ${debian})"
        PARENT_SCOPE)
  else()
    set(${found} ON PARENT_SCOPE)
    set(${found}_MESSAGE "" PARENT_SCOPE)
    set(${found}_VERSION "${${ARG_PACKAGE}_VERSION}" PARENT_SCOPE)
  endif()
endfunction()

# Sets <lacks> to whether one of the targets is not there.
function(stillpoint_lacks_target lacks)
  set(${lacks} OFF PARENT_SCOPE)
  foreach(target IN LISTS ARGN)
    if(NOT TARGET ${target})
      set(${lacks} ON PARENT_SCOPE)
    endif()
  endforeach()
endfunction()
