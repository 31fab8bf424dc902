// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>

#include "stillpoint/core/config.hpp"

namespace stillpoint {
namespace detail {

/// Rows of mask pixels are worked on in parts of this length: loops of a known length are turned
/// into vector instructions at every level of optimization.
constexpr std::size_t kRowPart = 32;

/// `n` or the next multiple of kRowPart. Scratch rows have such lengths: the rest of a row, byte by
/// byte, would take as long as the row.
constexpr std::size_t whole_parts(std::size_t n) {
  return (n + kRowPart - 1) / kRowPart * kRowPart;
}

/// out[i] = in[i] | in[i + shift]; `n` is a multiple of kRowPart, `in` has n + shift bytes.
inline void or_shifted(const unsigned char* STILLPOINT_RESTRICT in,
                       unsigned char* STILLPOINT_RESTRICT out, std::size_t n, std::size_t shift) {
  for (std::size_t i = 0; i < n; i += kRowPart)
    for (std::size_t k = i; k < i + kRowPart; ++k)
      out[k] = static_cast<unsigned char>(in[k] | in[k + shift]);
}

}  // namespace detail
}  // namespace stillpoint
