# As old hosts bring one along: variables, and no target.
find_path(EIGEN3_INCLUDE_DIR Eigen/Core PATH_SUFFIXES eigen3)
set(EIGEN3_FOUND ON)
