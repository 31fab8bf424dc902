// SPDX-License-Identifier: BSD-2-Clause
#include "shared_memory.hpp"

namespace stillpoint::python {
namespace {

namespace py = pybind11;

/// Memory that belongs to a Python object, in OpenCV's own reference counting.
class ArrayAllocator : public cv::MatAllocator {
 public:
  cv::UMatData* keep(const py::array& array) const {
    auto* data = new cv::UMatData(this);
    data->data = data->origdata = static_cast<uchar*>(const_cast<void*>(array.data()));
    data->size = static_cast<std::size_t>(array.nbytes());
    data->userdata = py::object(array).release().ptr();
    return data;
  }

  // A cv::Mat that grows takes its new memory from OpenCV.
  cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, std::size_t* step,
                         cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
    return cv::Mat::getStdAllocator()->allocate(dims, sizes, type, data, step, flags, usage);
  }
  bool allocate(cv::UMatData* data, cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
    return cv::Mat::getStdAllocator()->allocate(data, flags, usage);
  }

  void deallocate(cv::UMatData* data) const override {
    if (!data) return;
    if (Py_IsInitialized()) {  // else its memory goes with the process
      const py::gil_scoped_acquire gil;
      py::handle(static_cast<PyObject*>(data->userdata)).dec_ref();
    }
    delete data;
  }
};

const ArrayAllocator* allocator() {
  static const ArrayAllocator* const one = new ArrayAllocator;  // outlives every cv::Mat
  return one;
}

}  // namespace

cv::Mat share(const py::array& array, int rows, int columns, int type, std::size_t step) {
  cv::Mat mat(rows, columns, type, const_cast<void*>(array.data()), step);
  mat.u = allocator()->keep(array);
  mat.addref();
  return mat;
}

bool is_read_only(const cv::Mat& mat) {
  if (!mat.u || mat.u->currAllocator != allocator()) return false;
  const py::handle array(static_cast<PyObject*>(mat.u->userdata));
  return !py::reinterpret_borrow<py::array>(array).writeable();
}

}  // namespace stillpoint::python
