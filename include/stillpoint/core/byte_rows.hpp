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

/// Calls `work(first, kRowPart)` for the parts of a row of n pixels; the last one overlaps the one
/// before, so `work` must be the same done twice. A shorter row is one part: `work(0, n)`.
template <class Work>
inline void in_parts(std::size_t n, Work&& work) {
  if (n < kRowPart) return work(std::size_t{0}, n);
  for (std::size_t i = 0; i + kRowPart <= n; i += kRowPart) work(i, kRowPart);
  if (n % kRowPart != 0) work(n - kRowPart, kRowPart);
}

inline void or_part(const unsigned char* STILLPOINT_RESTRICT in, std::size_t n,
                    unsigned char* STILLPOINT_RESTRICT out) {
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<unsigned char>(out[i] | in[i]);
}

inline void and_part(const unsigned char* STILLPOINT_RESTRICT a,
                     const unsigned char* STILLPOINT_RESTRICT b, std::size_t n,
                     unsigned char* STILLPOINT_RESTRICT out) {
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<unsigned char>(a[i] & b[i]);
}

/// out[i] |= in[i]
inline void or_into(const unsigned char* in, std::size_t n, unsigned char* out) {
  in_parts(n, [=](std::size_t i, std::size_t part) { or_part(in + i, part, out + i); });
}

/// out[i] = a[i] & b[i]
inline void and_rows(const unsigned char* a, const unsigned char* b, std::size_t n,
                     unsigned char* out) {
  in_parts(n, [=](std::size_t i, std::size_t part) { and_part(a + i, b + i, part, out + i); });
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
