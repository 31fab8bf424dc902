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
  set(missing ON)
  if(ARG_TARGETS)
    set(missing OFF)
    foreach(target IN LISTS ARG_TARGETS)
      if(NOT TARGET ${target})
        set(missing ON)
      endif()
    endforeach()
  endif()
  if(missing)
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
      set(missing OFF)
      if(NOT ${ARG_PACKAGE}_FOUND)
        set(missing ON)
      endif()
      foreach(target IN LISTS ARG_TARGETS)
        if(NOT TARGET ${target})
          set(missing ON)
        endif()
      endforeach()
      if(NOT missing)
        break()
      endif()
    endforeach()
  endif()
  if(missing)
    string(REPLACE ";" " " what "${ARG_PACKAGE};${ARG_VERSION};${ARG_COMPONENTS}")
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
