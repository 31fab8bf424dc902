# LibTorch's headers and libraries. Its own package file drags in protobuf, glog and gflags and speaks
# while it looks, so they are looked for here. Defines the imported target stillpoint_torch_library.
find_path(STILLPOINT_TORCH_INCLUDE_DIR torch/script.h)
find_library(STILLPOINT_TORCH_CPU_LIBRARY torch_cpu)
find_library(STILLPOINT_TORCH_C10_LIBRARY c10)
find_library(STILLPOINT_TORCH_CUDA_LIBRARY torch_cuda)  # Only in builds for CUDA.
mark_as_advanced(STILLPOINT_TORCH_INCLUDE_DIR STILLPOINT_TORCH_CPU_LIBRARY
                 STILLPOINT_TORCH_C10_LIBRARY STILLPOINT_TORCH_CUDA_LIBRARY)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(StillpointTorch REQUIRED_VARS STILLPOINT_TORCH_CPU_LIBRARY
                                  STILLPOINT_TORCH_C10_LIBRARY STILLPOINT_TORCH_INCLUDE_DIR)
if(StillpointTorch_FOUND AND NOT TARGET stillpoint_torch_library)
  add_library(stillpoint_torch_library UNKNOWN IMPORTED)
  set_target_properties(stillpoint_torch_library PROPERTIES
    IMPORTED_LOCATION "${STILLPOINT_TORCH_CPU_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${STILLPOINT_TORCH_INCLUDE_DIR}"
    INTERFACE_LINK_LIBRARIES "${STILLPOINT_TORCH_C10_LIBRARY}")
  if(STILLPOINT_TORCH_CUDA_LIBRARY)
    # Nothing calls it by name: it enlists itself when it is loaded.
    set_property(TARGET stillpoint_torch_library APPEND PROPERTY INTERFACE_LINK_LIBRARIES
      "-Wl,--no-as-needed ${STILLPOINT_TORCH_CUDA_LIBRARY} -Wl,--as-needed")
  endif()
endif()
