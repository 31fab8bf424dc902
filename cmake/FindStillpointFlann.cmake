# FLANN with its headers' own need, LZ4. FLANN's package file exists from 1.9.2 on only and leaves
# LZ4 out, so headers and libraries are looked for. Defines the imported target
# stillpoint_flann_library.
find_path(STILLPOINT_FLANN_INCLUDE_DIR flann/algorithms/kdtree_single_index.h)
find_library(STILLPOINT_FLANN_LIBRARY flann_cpp)
find_library(STILLPOINT_LZ4_LIBRARY lz4)  # Older FLANN carries its own copy.
mark_as_advanced(STILLPOINT_FLANN_INCLUDE_DIR STILLPOINT_FLANN_LIBRARY STILLPOINT_LZ4_LIBRARY)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(StillpointFlann REQUIRED_VARS STILLPOINT_FLANN_LIBRARY
                                                                STILLPOINT_FLANN_INCLUDE_DIR)
if(StillpointFlann_FOUND AND NOT TARGET stillpoint_flann_library)
  add_library(stillpoint_flann_library UNKNOWN IMPORTED)
  set_target_properties(stillpoint_flann_library PROPERTIES
    IMPORTED_LOCATION "${STILLPOINT_FLANN_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${STILLPOINT_FLANN_INCLUDE_DIR}")
  if(STILLPOINT_LZ4_LIBRARY)
    set_target_properties(stillpoint_flann_library PROPERTIES
      INTERFACE_LINK_LIBRARIES "${STILLPOINT_LZ4_LIBRARY}")
  endif()
endif()
