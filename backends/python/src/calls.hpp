// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pybind11/pybind11.h>

#include <atomic>
#include <optional>
#include <string>
#include <utility>

#include "stillpoint/core/error.hpp"

namespace stillpoint::python {

/// What a Python function, called back in this thread, raised that no `except Exception` may catch
/// (KeyboardInterrupt): raised anew as soon as C++ is done.
std::optional<pybind11::error_already_set>& pending_exception();
/// Raises it, or what a signal handler raises (Ctrl-C).
void raise_pending();

/// Runs `work` without the GIL, so that other Python threads go on.
template <class Work>
auto without_gil(Work&& work) {
  pending_exception().reset();
  if constexpr (std::is_void_v<decltype(work())>) {
    {
      const pybind11::gil_scoped_release release;
      work();
    }
    raise_pending();
  } else {
    auto result = [&] {
      const pybind11::gil_scoped_release release;
      return work();
    }();
    raise_pending();
    return result;
  }
}

/// Lets one call at a time into an object: others would read what the first one writes.
class OneAtATime {
 public:
  explicit OneAtATime(const char* name) : name_(name) {}

  class Use {
   public:
    explicit Use(OneAtATime& gate) : gate_(gate) {
      if (gate.busy_.exchange(true))
        throw Error(std::string(gate.name_) +
                    ": expected one call at a time, found a second one, from another thread or "
                    "from a segmenter; use one object per camera");
    }
    ~Use() { gate_.busy_ = false; }
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

   private:
    OneAtATime& gate_;
  };

 private:
  const char* name_;
  std::atomic<bool> busy_{false};
};

}  // namespace stillpoint::python
