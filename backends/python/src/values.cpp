// SPDX-License-Identifier: BSD-2-Clause
#include <cmath>
#include <limits>

#include "arrays.hpp"
#include "stillpoint/core/error.hpp"

namespace stillpoint::python {
namespace {

[[noreturn]] void refuse(const char* where, const std::string& expected, const py::handle& found) {
  throw Error(std::string(where) + ": expected " + expected + ", found " + found_text(found));
}

py::array_t<double> doubles(const py::object& value, const char* where,
                            const std::string& expected) {
  py::array_t<double> a;
  if (!value.is_none()) a = py::array_t<double>::ensure(value);
  PyErr_Clear();
  if (!a) refuse(where, expected, value);
  return a;
}

}  // namespace

py::array_t<double> table_of(const py::object& value, py::ssize_t columns, const char* where) {
  const std::string expected = "an array of shape (n, " + std::to_string(columns) + ")";
  py::array_t<double> a = doubles(value, where, expected);
  if (a.size() == 0) return py::array_t<double>(std::vector<py::ssize_t>{0, columns});
  if (a.ndim() != 2 || a.shape(1) != columns) refuse(where, expected, value);
  return a;
}

std::vector<double> numbers_of(const py::object& value, const char* where) {
  const char* expected = "a list or an array of numbers of shape (n,)";
  const py::array_t<double> a = doubles(value, where, expected);
  if (a.ndim() != 1) refuse(where, expected, value);
  const auto numbers = a.unchecked<1>();
  std::vector<double> out(static_cast<std::size_t>(a.size()));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = numbers(static_cast<py::ssize_t>(i));
  return out;
}

std::string text_of(const py::handle& value, const char* where) {
  if (!py::isinstance<py::str>(value)) refuse(where, "a str", value);
  return value.cast<std::string>();
}

std::filesystem::path path_of(const py::object& value, const char* where) {
  PyObject* path = PyOS_FSPath(value.ptr());
  if (!path) {
    PyErr_Clear();
    refuse(where, "a path: a str or an os.PathLike", value);
  }
  const auto text = py::reinterpret_steal<py::object>(path);
  return py::module_::import("os").attr("fsdecode")(text).cast<std::string>();
}

cv::Size size_of_shape(const py::object& shape, const char* where) {
  const char* expected = "(height, width), e.g. color.shape";
  if (!PySequence_Check(shape.ptr()) || py::isinstance<py::str>(shape) || py::len(shape) < 2)
    refuse(where, expected, shape);
  const long long height = whole_of(shape[py::int_(0)], where);
  const long long width = whole_of(shape[py::int_(1)], where);
  if (height < 1 || width < 1 || height > 65535 || width > 65535) refuse(where, expected, shape);
  return {static_cast<int>(width), static_cast<int>(height)};
}

double number_of(const py::handle& value, const char* where) {
  const double number =
      value.is_none() || PyBool_Check(value.ptr()) ? -1 : PyFloat_AsDouble(value.ptr());
  if (value.is_none() || PyBool_Check(value.ptr()) || (number == -1 && PyErr_Occurred())) {
    PyErr_Clear();
    refuse(where, "a number", value);
  }
  return number;
}

double timestamp_of(const py::object& value, const char* where) {
  if (value.is_none())
    throw Error(std::string(where) +
                ": expected seconds that grow from frame to frame, found None; give the camera's "
                "time, or the frame's number divided by the frame rate");
  const double seconds = number_of(value, where);
  if (!(std::isfinite(seconds) && seconds >= 0))
    throw Error(std::string(where) + ": expected seconds of at least 0, found " +
                std::to_string(seconds));
  return seconds;
}

long long whole_of(const py::handle& value, const char* where) {
  if (value.is_none() || PyBool_Check(value.ptr())) refuse(where, "a whole number", value);
  const auto index = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
  const long long number = index ? PyLong_AsLongLong(index.ptr()) : -1;
  if (!index || (number == -1 && PyErr_Occurred())) {
    PyErr_Clear();
    refuse(where, "a whole number", value);
  }
  return number;
}

int int_of(const py::handle& value, const char* where) {
  const long long number = whole_of(value, where);
  if (number < std::numeric_limits<int>::min() || number > std::numeric_limits<int>::max())
    throw Error(std::string(where) + ": expected a whole number of 32 bits, found " +
                std::to_string(number));
  return static_cast<int>(number);
}

bool truth_of(const py::handle& value, const char* where) {
  const bool numpy_bool =
      std::string(py::str(py::type::handle_of(value).attr("__name__"))) == "bool_";
  if (!PyBool_Check(value.ptr()) && !numpy_bool) refuse(where, "True or False", value);
  return PyObject_IsTrue(value.ptr()) == 1;
}

}  // namespace stillpoint::python
