// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <stdexcept>
#include <string>

namespace stillpoint {

/// The one exception type of the library.
///
/// Thrown for a programmer's slip (sizes differ, wrong image type) and, by loaders and constructors
/// only, for bad input from outside. The message names what, where, what was expected and what was
/// found. Trouble that is expected while running (no mask yet, no depth, mask too large) is never
/// an exception: see FrameStatus.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& message) : std::runtime_error("stillpoint: " + message) {}
};

namespace detail {

/// Throws Error(make_message()) unless `condition`; the message is only built on failure.
template <class MakeMessage>
inline void check(bool condition, MakeMessage&& make_message) {
  if (!condition) throw Error(make_message());
}

}  // namespace detail
}  // namespace stillpoint
