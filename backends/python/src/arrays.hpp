// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/trajectory.hpp"

// What goes between Python and C++: arrays, poses, paths. `where` names the argument in messages.
// All functions need the GIL and throw stillpoint::Error.
namespace stillpoint::python {

namespace py = pybind11;

/// "float64 array of shape (480, 640)", "NoneType".
std::string found_text(const py::handle& value);

/// An array as cv::Mat. The memory is shared where rows are contiguous, and the Mat keeps the array
/// alive; else it is copied.
cv::Mat color_of(const py::object& array, const char* where);  // (H, W, 3) or (H, W) uint8
cv::Mat depth_of(const py::object& array, const char* where);  // (H, W) uint16 or float32, or None
/// (H, W) uint8 or bool, where True becomes 255.
cv::Mat mask_of(const py::object& array, const char* where);
/// The same; None is an empty mask.
cv::Mat mask_or_none(const py::object& array, const char* where);

/// A cv::Mat of 8U, 16U, 32F with 1 or 3 channels as an array that shares and keeps its memory; one
/// of a read-only array is read-only.
py::array array_of(const cv::Mat& mat);
/// A vector as an array that owns it: (n,) or, with `columns`, (n / columns, columns).
template <class T>
py::array_t<T> array_of(std::vector<T> values, py::ssize_t columns = 0) {
  auto* kept = new std::vector<T>(std::move(values));
  py::capsule owner(kept, [](void* p) { delete static_cast<std::vector<T>*>(p); });
  const auto n = static_cast<py::ssize_t>(kept->size());
  const std::vector<py::ssize_t> shape =
      columns > 0 ? std::vector<py::ssize_t>{n / columns, columns} : std::vector<py::ssize_t>{n};
  return py::array_t<T>(shape, kept->data(), owner);
}

/// A 4 x 4 matrix whose last row is 0 0 0 1. Its numbers may be NaN: who takes it says what then.
Eigen::Isometry3d pose_of(const py::object& value, const char* where);
std::optional<Eigen::Isometry3d> pose_or_none(const py::object& value, const char* where);
/// 4 x 4 float64.
py::array_t<double> array_of(const Eigen::Isometry3d& pose);

/// Keypoints in pixels, float32, as the library reads them.
class Keypoints {
 public:
  /// (N, 2) of any real type, or a sequence of cv2.KeyPoint.
  Keypoints(const py::object& value, const char* where);
  std::size_t size() const { return size_; }
  cv::Point2f operator[](std::size_t i) const { return {data_[2 * i], data_[2 * i + 1]}; }
  std::vector<cv::Point2f> points() const;

 private:
  py::array_t<float, py::array::c_style | py::array::forcecast> array_;
  const float* data_ = nullptr;
  std::size_t size_ = 0;
};

/// (N, columns) of any real type as float64.
py::array_t<double> table_of(const py::object& value, py::ssize_t columns, const char* where);
/// (N,) as float64.
std::vector<double> numbers_of(const py::object& value, const char* where);
/// Text of a str, or a path of a str or os.PathLike.
std::string text_of(const py::handle& value, const char* where);
std::filesystem::path path_of(const py::object& value, const char* where);
/// (H, W) or a longer shape as color.shape gives it.
cv::Size size_of_shape(const py::object& shape, const char* where);
/// Numbers that are no numbers of Python's are an Error, too.
double number_of(const py::handle& value, const char* where);
/// Seconds, finite and at least 0.
double timestamp_of(const py::object& value, const char* where);
long long whole_of(const py::handle& value, const char* where);
int int_of(const py::handle& value, const char* where);
bool truth_of(const py::handle& value, const char* where);

}  // namespace stillpoint::python
