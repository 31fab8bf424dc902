# What find_package says of components that cannot be had.

# Configures the project; the output must match each of EXPECTED, of ONCE
# one time, and none of UNEXPECTED.
function(configure name succeeds)
  cmake_parse_arguments(ARG "" "" "OPTIONS;EXPECTED;ONCE;UNEXPECTED" ${ARGN})
  file(REMOVE_RECURSE ${BINARY}/${name})
  execute_process(
    COMMAND ${CMAKE_COMMAND} -G ${GENERATOR} -S ${PROJECT} -B ${BINARY}/${name}
            -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_PREFIX_PATH=${PREFIX} ${ARG_OPTIONS}
    RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(succeeds AND NOT result EQUAL 0 OR NOT succeeds AND result EQUAL 0)
    message(FATAL_ERROR "${name}: cmake returned ${result}:\n${output}")
  endif()
  string(REGEX REPLACE "[ \n]+" " " output "${output}")  # CMake wraps lines.
  foreach(text IN LISTS ARG_EXPECTED)
    string(FIND "${output}" "${text}" at)
    if(at EQUAL -1)
      message(FATAL_ERROR "${name}: expected '${text}' in\n${output}")
    endif()
  endforeach()
  foreach(text IN LISTS ARG_ONCE)
    string(FIND "${output}" "${text}" first)
    string(FIND "${output}" "${text}" last REVERSE)
    if(first EQUAL -1 OR NOT first EQUAL last)
      message(FATAL_ERROR "${name}: expected '${text}' once in\n${output}")
    endif()
  endforeach()
  foreach(text IN LISTS ARG_UNEXPECTED)
    string(FIND "${output}" "${text}" at)
    if(NOT at EQUAL -1)
      message(FATAL_ERROR "${name}: did not expect '${text}' in\n${output}")
    endif()
  endforeach()
endfunction()

configure(unknown OFF OPTIONS -DCOMPONENT=nonsense
          EXPECTED "there is no component 'nonsense'; installed are: core compiled io")
configure(no_opencv OFF OPTIONS -DCOMPONENT=core -DCMAKE_DISABLE_FIND_PACKAGE_OpenCV=ON
          EXPECTED "component 'core' needs OpenCV core imgproc" "apt-get install libopencv-dev")
# What several components lack is said once.
configure(no_opencv_for_io OFF OPTIONS -DCOMPONENT=io -DCMAKE_DISABLE_FIND_PACKAGE_OpenCV=ON
          EXPECTED "component 'core' needs OpenCV" ONCE "needs OpenCV core imgproc,")
if(EXISTS ${PREFIX}/include/stillpoint/backends/flann_neighbor_search.hpp)
  configure(no_flann OFF OPTIONS -DCOMPONENT=flann -DCMAKE_DISABLE_FIND_PACKAGE_StillpointFlann=ON
            EXPECTED "component 'flann' needs Flann, which was not found" UNEXPECTED "StillpointFlann,")
endif()
if(EXISTS ${PREFIX}/include/stillpoint/backends/nanoflann_neighbor_search.hpp)
  set(without -DCMAKE_DISABLE_FIND_PACKAGE_nanoflann=ON)
  configure(missing OFF OPTIONS -DCOMPONENT=nanoflann ${without}
            EXPECTED "component 'nanoflann' needs nanoflann" "apt-get install libnanoflann-dev")
  configure(optional ON OPTIONS -DASK=optional -DCOMPONENT=nanoflann ${without}
            EXPECTED "component 'nanoflann' needs nanoflann" "has stillpoint::stillpoint"
            UNEXPECTED "has stillpoint::nanoflann")
  configure(nothing_asked ON OPTIONS -DASK=nothing -DCOMPONENT=nanoflann
            EXPECTED "has stillpoint::stillpoint"
            UNEXPECTED "nanoflann")
  configure(asked ON OPTIONS -DCOMPONENT=nanoflann
            EXPECTED "has stillpoint::stillpoint" "has stillpoint::nanoflann")
endif()
