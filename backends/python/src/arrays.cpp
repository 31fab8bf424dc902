// SPDX-License-Identifier: BSD-2-Clause
#include "arrays.hpp"

#include <cmath>
#include <utility>

#include "shared_memory.hpp"
#include "stillpoint/core/error.hpp"

namespace stillpoint::python {
namespace {

[[noreturn]] void refuse(const std::string& where, const std::string& expected,
                         const py::handle& found, const std::string& mend = "") {
  throw Error(where + ": expected " + expected + ", found " + found_text(found) +
              (mend.empty() ? "" : "; " + mend));
}

/// An array, or what turns itself into one without copying (a tensor on the CPU).
py::array array_like(const py::object& value, const char* where, const char* expected) {
  if (py::isinstance<py::array>(value)) return py::reinterpret_borrow<py::array>(value);
  if (!value.is_none() && py::hasattr(value, "__array__")) {
    try {
      return py::module_::import("numpy").attr("asarray")(value);
    } catch (const py::error_already_set& e) {
      throw Error(std::string(where) + ": expected " + expected + ", found " + found_text(value) +
                  ", which gives no array: " + e.what());
    }
  }
  refuse(where, expected, value);
}

template <class T>
bool holds(const py::array& array) {
  return py::isinstance<py::array_t<T>>(array);
}

/// Rows of contiguous pixels, from top to bottom: what a cv::Mat can refer to.
bool is_mat(const py::array& a, py::ssize_t channels) {
  const py::ssize_t item = a.itemsize();
  const bool pixels = a.ndim() == 3 ? a.strides(2) == item && a.strides(1) == channels * item
                                    : a.strides(1) == item;
  return pixels && a.strides(0) >= a.shape(1) * channels * item;
}

cv::Mat mat_of(py::array a, int depth, const char* where, const char* expected) {
  const py::ssize_t channels = a.ndim() == 3 ? a.shape(2) : 1;
  constexpr py::ssize_t kLongest = 1 << 16;
  if (a.shape(0) < 1 || a.shape(1) < 1 || a.shape(0) > kLongest || a.shape(1) > kLongest)
    refuse(where, expected, a);
  if (!is_mat(a, channels)) a = py::module_::import("numpy").attr("ascontiguousarray")(a);
  // numpy calls an array of one row contiguous whatever its stride says.
  const bool rows = is_mat(a, channels);
  const py::ssize_t step = rows ? a.strides(0) : a.shape(1) * channels * a.itemsize();
  return share(a, static_cast<int>(a.shape(0)), static_cast<int>(a.shape(1)),
               CV_MAKETYPE(depth, static_cast<int>(channels)), static_cast<std::size_t>(step));
}

}  // namespace

std::string found_text(const py::handle& value) {
  if (!py::isinstance<py::array>(value)) {
    const std::string type = py::str(py::type::handle_of(value).attr("__name__"));
    if (py::isinstance<py::int_>(value) || py::isinstance<py::float_>(value) ||
        py::isinstance<py::str>(value))
      return std::string(py::repr(value));
    return value.is_none() ? "None" : type;
  }
  return std::string(py::str(value.attr("dtype"))) + " array of shape " +
         std::string(py::str(value.attr("shape")));
}

cv::Mat color_of(const py::object& value, const char* where) {
  const char* expected =
      "a uint8 array of shape (height, width, 3), BGR as OpenCV loads it, or (height, width), gray";
  const py::array a = array_like(value, where, expected);
  if (!holds<std::uint8_t>(a) || (a.ndim() != 2 && !(a.ndim() == 3 && a.shape(2) == 3)))
    refuse(where, expected, a);
  return mat_of(a, CV_8U, where, expected);
}

cv::Mat depth_of(const py::object& value, const char* where) {
  if (value.is_none()) return {};
  const char* expected =
      "None, a float32 array in metres or a uint16 array with depth_units_per_m, of shape (height, "
      "width)";
  const py::array a = array_like(value, where, expected);
  const bool units = holds<std::uint16_t>(a);
  if (!units && !holds<float>(a))
    refuse(where, expected, a, holds<double>(a) ? "write depth.astype(numpy.float32)" : "");
  if (a.ndim() != 2) refuse(where, expected, a);
  return mat_of(a, units ? CV_16U : CV_32F, where, expected);
}

cv::Mat mask_of(const py::object& value, const char* where) {
  const char* expected = "a uint8 or bool array of shape (height, width)";
  const py::array a = array_like(value, where, expected);
  const bool truth = holds<bool>(a);
  if ((!truth && !holds<std::uint8_t>(a)) || a.ndim() != 2)
    refuse(where, expected, a,
           a.ndim() == 2 ? "write .astype(numpy.uint8), 0 = static" : std::string());
  const cv::Mat mat = mat_of(a, CV_8U, where, expected);
  return truth ? cv::Mat(mat > 0) : mat;
}

cv::Mat mask_or_none(const py::object& array, const char* where) {
  return array.is_none() ? cv::Mat() : mask_of(array, where);
}

py::array array_of(const cv::Mat& mat) {
  auto* kept = new cv::Mat(mat);
  const py::capsule owner(kept, [](void* p) { delete static_cast<cv::Mat*>(p); });
  const py::dtype type = mat.depth() == CV_16U   ? py::dtype::of<std::uint16_t>()
                         : mat.depth() == CV_32F ? py::dtype::of<float>()
                                                 : py::dtype::of<std::uint8_t>();
  const auto item = static_cast<py::ssize_t>(mat.elemSize1());
  const auto pixel = static_cast<py::ssize_t>(mat.elemSize());
  std::vector<py::ssize_t> shape{mat.rows, mat.cols};
  std::vector<py::ssize_t> strides{static_cast<py::ssize_t>(mat.step[0]), pixel};
  if (mat.channels() > 1) shape.push_back(mat.channels()), strides.push_back(item);
  py::array array(type, shape, strides, kept->data, owner);
  if (is_read_only(mat))
    py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

Eigen::Isometry3d pose_of(const py::object& value, const char* where) {
  const char* expected = "a 4 x 4 matrix of floats";
  py::array_t<double> a;
  if (!value.is_none()) a = py::array_t<double>::ensure(value);
  PyErr_Clear();
  if (!a || a.ndim() != 2 || a.shape(0) != 4 || a.shape(1) != 4) refuse(where, expected, value);
  const auto m = a.unchecked<2>();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) pose.matrix()(i, j) = m(i, j);
  for (int j = 0; j < 4; ++j)
    if (std::abs(m(3, j) - (j == 3)) > 1e-6)
      throw Error(std::string(where) + ": expected 0 0 0 1 in the last row, found " +
                  std::to_string(m(3, j)) + " in column " + std::to_string(j) +
                  "; is it transposed?");
  return pose;
}

std::optional<Eigen::Isometry3d> pose_or_none(const py::object& value, const char* where) {
  if (value.is_none()) return std::nullopt;
  return pose_of(value, where);
}

py::array_t<double> array_of(const Eigen::Isometry3d& pose) {
  py::array_t<double> a({4, 4});
  auto m = a.mutable_unchecked<2>();
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) m(i, j) = pose.matrix()(i, j);
  return a;
}

Keypoints::Keypoints(const py::object& value, const char* where) {
  const char* expected = "an array of shape (n, 2), x and y in pixels, or a list of cv2.KeyPoint";
  py::object given = value;
  if (PySequence_Check(given.ptr()) && !py::isinstance<py::array>(given) && py::len(given) > 0 &&
      py::hasattr(given[py::int_(0)], "pt"))
    given = py::module_::import("cv2").attr("KeyPoint_convert")(given);
  if (given.is_none() || py::isinstance<py::str>(given)) refuse(where, expected, given);
  array_ = py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(given);
  if (!array_) {
    PyErr_Clear();
    refuse(where, expected, given);
  }
  const bool none = array_.size() == 0;
  if (!none && (array_.ndim() != 2 || array_.shape(1) != 2)) refuse(where, expected, given);
  data_ = array_.data();
  size_ = none ? 0 : static_cast<std::size_t>(array_.shape(0));
}

std::vector<cv::Point2f> Keypoints::points() const {
  std::vector<cv::Point2f> points;
  points.reserve(size_);
  for (std::size_t i = 0; i < size_; ++i) points.push_back((*this)[i]);
  return points;
}

}  // namespace stillpoint::python
