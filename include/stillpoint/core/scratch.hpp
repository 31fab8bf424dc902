// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace stillpoint {
namespace detail {

/// Gives a buffer `n` elements of `value`. As vector::assign(), but memory grows by doubling, so
/// that sizes that grow from frame to frame seldom allocate.
template <class T>
inline void refill(std::vector<T>& buffer, std::size_t n, const T& value) {
  buffer.resize(n);
  std::fill(buffer.begin(), buffer.end(), value);
}

}  // namespace detail
}  // namespace stillpoint
