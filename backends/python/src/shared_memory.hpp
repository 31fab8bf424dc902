// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pybind11/numpy.h>

#include <cstddef>
#include <opencv2/core.hpp>

namespace stillpoint::python {

/// A cv::Mat over the memory of an array. The array lives as long as any cv::Mat refers to it; the
/// last one may go in any thread.
cv::Mat share(const pybind11::array& array, int rows, int columns, int type, std::size_t step);

/// Whether a cv::Mat lies over an array that must not be written to. Needs the GIL.
bool is_read_only(const cv::Mat& mat);

}  // namespace stillpoint::python
