// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/scratch.hpp"

namespace stillpoint {
namespace detail {

/// Binary rows of 64 pixels a word: pixel x is bit x % 64 of word x / 64. A row of a mask is a few
/// words, so that unions, outlines and dilations cost next to nothing beside those of bytes.
constexpr std::size_t words_for(std::size_t pixels) { return (pixels + 63) / 64; }

/// The 8 bytes from `bytes` on as bits: 1 where a byte is not zero.
inline std::uint64_t pack_8(const unsigned char* bytes) {
  std::uint64_t v = 0;  // compilers make one load of it
  for (int i = 0; i < 8; ++i) v |= static_cast<std::uint64_t>(bytes[i]) << (8 * i);
  constexpr std::uint64_t kLow = 0x7f7f7f7f7f7f7f7full;
  v = (((v & kLow) + kLow) | v) & ~kLow;  // the highest bit of each byte that is not zero
  return ((v >> 7) * 0x0102040810204080ull) >> 56;
}

inline std::uint64_t pack_16(const unsigned char* bytes) {
#if defined(__SSE2__)
  const __m128i v = _mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes));
  return 0xffffu &
         ~static_cast<unsigned>(_mm_movemask_epi8(_mm_cmpeq_epi8(v, _mm_setzero_si128())));
#else
  return pack_8(bytes) | pack_8(bytes + 8) << 8;
#endif
}

/// Of 16 values from `z` on those that are zero, as bits.
inline std::uint64_t zeros_16(const std::uint16_t* z) {
#if defined(__SSE2__)
  const __m128i* v = reinterpret_cast<const __m128i*>(z);
  const __m128i zero = _mm_setzero_si128();
  return static_cast<unsigned>(_mm_movemask_epi8(_mm_packs_epi16(
      _mm_cmpeq_epi16(_mm_loadu_si128(v), zero), _mm_cmpeq_epi16(_mm_loadu_si128(v + 1), zero))));
#else
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < 16; ++i) bits |= std::uint64_t{z[i] == 0} << i;
  return bits;
#endif
}

/// Of 16 values from `z` on those from lo[i] to lo[i] + span[i], as bits.
inline std::uint64_t in_range_16(const std::uint16_t* z, const std::uint16_t* lo,
                                 const std::uint16_t* span) {
#if defined(__SSE2__)
  const auto eight = [&](std::size_t i) {
    const auto load = [i](const std::uint16_t* from) {
      return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + i));
    };
    const __m128i beyond = _mm_subs_epu16(_mm_sub_epi16(load(z), load(lo)), load(span));
    return _mm_cmpeq_epi16(beyond, _mm_setzero_si128());
  };
  return static_cast<unsigned>(_mm_movemask_epi8(_mm_packs_epi16(eight(0), eight(8))));
#else
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < 16; ++i)
    bits |= std::uint64_t{static_cast<std::uint16_t>(z[i] - lo[i]) <= span[i]} << i;
  return bits;
#endif
}

/// ORs the bits of a word into a row from pixel x on.
inline void or_bits(std::uint64_t bits, std::size_t x, std::uint64_t* row) {
  const std::size_t k = x / 64, shift = x % 64;
  row[k] |= bits << shift;
  if (shift != 0 && bits >> (64 - shift) != 0) row[k + 1] |= bits >> (64 - shift);
}

/// ORs n mask bytes (not 0: set) into a row from pixel x on.
inline void or_bytes(const unsigned char* bytes, std::size_t n, std::size_t x, std::uint64_t* row) {
  std::size_t i = 0;
  for (; i + 64 <= n; i += 64) {
    std::uint64_t bits = 0;
    for (std::size_t k = 0; k < 64; k += 16) bits |= pack_16(bytes + i + k) << k;
    or_bits(bits, x + i, row);
  }
  for (; i + 16 <= n; i += 16) or_bits(pack_16(bytes + i), x + i, row);
  if (i < n && n >= 16) return or_bits(pack_16(bytes + n - 16), x + n - 16, row);  // some twice
  for (; i < n; ++i) or_bits(bytes[i] != 0, x + i, row);
}

/// n mask bytes (not 0: set; at most 64) as the bits of a word.
inline std::uint64_t pack_word(const unsigned char* bytes, std::size_t n) {
  std::uint64_t word = 0;
  std::size_t i = 0;
  for (; i + 16 <= n; i += 16) word |= pack_16(bytes + i) << i;
  for (; i < n; ++i) word |= std::uint64_t{bytes[i] != 0} << i;
  return word;
}

/// Sets n pixels of a row from x on.
inline void fill_bits(std::size_t x, std::size_t n, std::uint64_t* row) {
  for (const std::size_t end = x + n; x < end;) {
    const std::size_t in_word = std::min(64 - x % 64, end - x);
    row[x / 64] |= (~std::uint64_t{0} >> (64 - in_word)) << (x % 64);
    x += in_word;
  }
}

/// For each 8 bits their bytes, 0 or 255.
struct BitsToBytes {
  std::array<std::array<unsigned char, 8>, 256> bytes{};
  constexpr BitsToBytes() {
    for (std::size_t v = 0; v < 256; ++v)
      for (std::size_t i = 0; i < 8; ++i)
        bytes[v][i] = (v >> i & 1) != 0 ? static_cast<unsigned char>(255) : 0;
  }
};
inline constexpr BitsToBytes kBitsToBytes;

/// Writes 16 bits as bytes, 0 or 255.
inline void unpack_16(std::uint64_t bits, unsigned char* to) {
#if defined(__SSE2__)
  // The lower bits' byte eight times, then the upper ones'; of each copy one bit is kept.
  __m128i v = _mm_cvtsi32_si128(static_cast<int>(bits & 0xffff));
  v = _mm_unpacklo_epi8(v, v);
  v = _mm_shufflelo_epi16(v, 0x50);
  v = _mm_unpacklo_epi32(v, v);
  const __m128i one = _mm_set1_epi64x(static_cast<long long>(0x8040201008040201ull));
  v = _mm_cmpeq_epi8(_mm_and_si128(v, one), one);
  _mm_storeu_si128(reinterpret_cast<__m128i*>(to), v);
#else
  for (std::size_t i = 0; i < 16; i += 8)
    std::memcpy(to + i, kBitsToBytes.bytes[bits >> i & 255].data(), 8);
#endif
}

/// Writes the bits of a word as n bytes (at most 64), 0 or 255.
inline void unpack_word(std::uint64_t word, std::size_t n, unsigned char* to) {
  if (n == 64) {
    if (word == 0) {
      std::memset(to, 0, 64);
    } else if (~word == 0) {
      std::memset(to, 255, 64);
    } else {
      for (std::size_t i = 0; i < 64; i += 16) unpack_16(word >> i, to + i);
    }
    return;
  }
  std::size_t i = 0;
  for (; i + 16 <= n; i += 16) unpack_16(word >> i, to + i);
  for (; i + 8 <= n; i += 8) std::memcpy(to + i, kBitsToBytes.bytes[word >> i & 255].data(), 8);
  if (i + 4 <= n) std::memcpy(to + i, kBitsToBytes.bytes[word >> i & 255].data(), 4), i += 4;
  for (; i < n; ++i) to[i] = (word >> i & 1) != 0 ? 255 : 0;
}

/// Writes n pixels of a row from x on as bytes, 0 or 255.
inline void unpack(const std::uint64_t* row, std::size_t x, std::size_t n, unsigned char* to) {
  for (std::size_t i = 0; i < n; i += 64) {
    const std::size_t k = (x + i) / 64, shift = (x + i) % 64,
                      count = std::min<std::size_t>(64, n - i);
    std::uint64_t word = row[k] >> shift;
    if (shift + count > 64) word |= row[k + 1] << (64 - shift);
    unpack_word(word, count, to + i);
  }
}

/// Whether pixel x of a row is set.
inline bool bit_at(const std::uint64_t* row, std::size_t x) {
  return (row[x / 64] >> (x % 64) & 1) != 0;
}

/// How many bits are set.
inline int count_bits(std::uint64_t v) {
  v -= v >> 1 & 0x5555555555555555ull;
  v = (v & 0x3333333333333333ull) + (v >> 2 & 0x3333333333333333ull);
  v = (v + (v >> 4)) & 0x0f0f0f0f0f0f0f0full;
  return static_cast<int>((v * 0x0101010101010101ull) >> 56);
}

/// Place of the lowest bit of a word that is not zero.
inline int lowest_bit(std::uint64_t v) {
#if defined(__GNUC__) || defined(__clang__)
  return __builtin_ctzll(v);
#else
  return count_bits(~v & (v - 1));
#endif
}

/// Calls `visit(i)` for each bit i that is set, the lowest first.
template <class Visit>
inline void for_each_bit(std::uint64_t bits, Visit&& visit) {
  for (; bits != 0; bits &= bits - 1) visit(lowest_bit(bits));
}

/// Calls `visit(begin, end)` for each run of bits that are set, from the first on.
template <class Visit>
inline void for_each_run(const std::vector<std::uint64_t>& words, Visit&& visit) {
  int begin = -1;  // of a run that reaches the end of the last word
  for (std::size_t k = 0; k < words.size(); ++k) {
    const int first = 64 * static_cast<int>(k);
    std::uint64_t word = words[k];
    if (begin >= 0) {
      if (~word == 0) continue;
      const int length = lowest_bit(~word);
      visit(begin, first + length);
      begin = -1;
      word &= ~std::uint64_t{0} << length;
    }
    while (word != 0) {
      const int at = lowest_bit(word);
      const std::uint64_t zeros = ~(word >> at);  // 0: the run fills the word from its first bit
      const int length = zeros == 0 ? 64 : lowest_bit(zeros);
      if (at + length >= 64) {
        begin = first + at;
        break;
      }
      visit(first + at, first + at + length);
      word &= ~std::uint64_t{0} << (at + length);
    }
  }
  if (begin >= 0) visit(begin, 64 * static_cast<int>(words.size()));
}

/// A binary picture, or a box of one: rows of the words that the box touches.
class BitMask {
 public:
  /// All pixels of `box` zero. O(words).
  void reset(const cv::Rect& box) {
    box_ = box;
    words_ = words_for(static_cast<std::size_t>(box.x + box.width)) -
             static_cast<std::size_t>(first_word());
    refill(bits_, words_ * static_cast<std::size_t>(box.height), std::uint64_t{0});
  }
  /// The same for a whole picture.
  void reset(const cv::Size& size) { reset(cv::Rect(cv::Point(), size)); }
  cv::Size size() const { return box_.size(); }
  /// Words per row; the first is the picture's word first_word().
  std::size_t words() const { return words_; }
  int first_word() const { return box_.x / 64; }
  /// Which bit of a row a column of the picture is.
  std::size_t bit_of(int x) const { return static_cast<std::size_t>(x - 64 * first_word()); }
  /// A row of the picture.
  std::uint64_t* row(int y) { return bits_.data() + static_cast<std::size_t>(y - box_.y) * words_; }
  const std::uint64_t* row(int y) const {
    return bits_.data() + static_cast<std::size_t>(y - box_.y) * words_;
  }
  /// ORs a mask (CV_8UC1, not 0: set; empty: all set) that covers `box` of the picture.
  void add(const cv::Mat& mask, const cv::Rect& box) {
    const std::size_t x = bit_of(box.x), n = static_cast<std::size_t>(box.width);
    for (int y = 0; y < box.height; ++y)
      if (mask.empty())
        fill_bits(x, n, row(box.y + y));
      else
        or_bytes(mask.ptr<unsigned char>(y), n, x, row(box.y + y));
  }

 private:
  cv::Rect box_;
  std::size_t words_ = 0;
  std::vector<std::uint64_t> bits_;
};

}  // namespace detail
}  // namespace stillpoint
