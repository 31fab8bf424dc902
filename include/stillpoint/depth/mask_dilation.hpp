// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/image_scale.hpp"

namespace stillpoint {

/// The union of dilated masks, with one bit for each pixel: 64 pixels are dilated at once, in a
/// third of the time that cv::dilate takes for bytes, with the same result.
class MaskDilation {
 public:
  /// Begins with an empty union of a size.
  void begin(const cv::Size& size) {
    size_ = size;
    words_ = words_of(size.width);
    union_.assign(words_ * static_cast<std::size_t>(size.height), 0);
  }

  /// Adds a mask, CV_8UC1, non-zero = set, that fills `box` (inside the image), dilated by a square
  /// that reaches `px` pixels to each side. O(pixels of the box / 8).
  void add(const cv::Mat& mask, const cv::Rect& box, int px) {
    const cv::Rect grown = grow_rect(box, px, size_);
    if (grown.empty()) return;
    const std::size_t first = static_cast<std::size_t>(grown.x) / kBits;
    const std::size_t used = words_of(grown.br().x) - first;
    // What grows beyond a row ends in empty words between it and the next.
    const std::size_t gap = static_cast<std::size_t>(px) / kBits + 1, stride = used + gap;
    bits_.assign(gap + stride * static_cast<std::size_t>(grown.height), 0);
    for (int y = 0; y < box.height; ++y)
      pack(mask.ptr<uchar>(y), box.width,
           &bits_[gap + stride * static_cast<std::size_t>(box.y + y - grown.y)],
           static_cast<std::size_t>(box.x) - first * kBits);
    dilate(px, stride);
    for (int y = 0; y < grown.height; ++y) {
      Word* all = &union_[words_ * static_cast<std::size_t>(grown.y + y) + first];
      const Word* row = &bits_[gap + stride * static_cast<std::size_t>(y)];
      for (std::size_t i = 0; i < used; ++i) all[i] |= row[i];
    }
  }

  /// Writes the union into `mask`, CV_8UC1 of its size, 255 = set. Returns how many are set.
  /// O(pixels / 8).
  int write(cv::Mat& mask) const {
    const std::size_t whole = static_cast<std::size_t>(size_.width) / kBits;
    const std::size_t rest = static_cast<std::size_t>(size_.width) % kBits;
    std::size_t count = 0;
    for (int y = 0; y < size_.height; ++y) {
      const Word* row = &union_[words_ * static_cast<std::size_t>(y)];
      uchar* out = mask.ptr<uchar>(y);
      for (std::size_t i = 0; i < whole; ++i) count += unpack(row[i], kBits, out + kBits * i);
      if (rest > 0) count += unpack(row[whole], rest, out + kBits * whole);
    }
    return static_cast<int>(count);
  }

 private:
  using Word = std::uint64_t;  // of pixels side by side, the first in the lowest bit
  static constexpr std::size_t kBits = 64;

  static std::size_t words_of(int pixels) {
    return (static_cast<std::size_t>(pixels) + kBits - 1) / kBits;
  }

  // Eight bytes as a number, the first lowest: one instruction, where the machine does the same.
  static Word load(const uchar* bytes) {
    Word word = 0;
    for (std::size_t i = 0; i < 8; ++i) word |= Word{bytes[i]} << (8 * i);
    return word;
  }

  // Sets the bits of the bytes of a row that are not 0, from bit `at` on.
  static void pack(const uchar* bytes, int n, Word* row, std::size_t at) {
    for (; n >= 8; n -= 8, bytes += 8, at += 8) pack(load(bytes), row, at);
    uchar rest[8] = {};
    std::copy_n(bytes, n, rest);
    pack(load(rest), row, at);
  }

  static void pack(Word eight, Word* row, std::size_t at) {
    constexpr Word kLow7 = 0x7f7f7f7f7f7f7f7f, kTop = 0x8080808080808080;
    if (eight == 0) return;
    // The top bit of each byte says whether any of its bits is set; then they move together.
    const Word set = (((eight & kLow7) + kLow7) | eight) & kTop;
    const Word bits = ((set >> 7) * 0x0102040810204080) >> 56;
    row[at / kBits] |= bits << (at % kBits);
    if (at % kBits > kBits - 8) row[at / kBits + 1] |= bits >> (kBits - at % kBits);
  }

  // Writes the first n bits of a word as bytes; how many are set.
  STILLPOINT_ALWAYS_INLINE static std::size_t unpack(Word word, std::size_t n, uchar* out) {
    const Word all = ~Word{0} >> (kBits - n);
    word &= all;
    if (word == 0 || word == all) {
      std::memset(out, word == 0 ? 0 : 255, n);
      return word == 0 ? 0 : n;
    }
    static const std::array<std::array<uchar, 8>, 256> kBytes = bytes_of_bits();
    const std::size_t count = std::bitset<kBits>(word).count();
    for (; n >= 8; n -= 8, out += 8, word >>= 8) std::memcpy(out, kBytes[word & 255].data(), 8);
    std::copy_n(kBytes[word & 255].data(), n, out);
    return count;
  }

  static std::array<std::array<uchar, 8>, 256> bytes_of_bits() {
    std::array<std::array<uchar, 8>, 256> bytes;
    for (std::size_t b = 0; b < 256; ++b)
      for (std::size_t i = 0; i < 8; ++i) bytes[b][i] = (b >> i & 1) != 0 ? 255 : 0;
    return bytes;
  }

  // Dilates bits_, whose rows are so many words apart, to one side after the other.
  void dilate(int px, std::size_t stride) {
    const std::size_t n = bits_.size();
    Word* word = bits_.data();
    for_each_step(px, kBits - 1, [&](std::size_t by) {
      for (std::size_t i = n - 1; i > 0; --i)
        word[i] |= word[i] << by | word[i - 1] >> (kBits - by);
    });
    for_each_step(px, kBits - 1, [&](std::size_t by) {
      for (std::size_t i = 0; i + 1 < n; ++i)
        word[i] |= word[i] >> by | word[i + 1] << (kBits - by);
    });
    for_each_step(px, n / stride, [&](std::size_t by) {
      for (std::size_t i = n; i-- > by * stride;) word[i] |= word[i - by * stride];
    });
    for_each_step(px, n / stride, [&](std::size_t by) {
      for (std::size_t i = by * stride; i < n; ++i) word[i - by * stride] |= word[i];
    });
  }

  // The steps to a reach: each moves by no more than what is there is wide, so that it doubles.
  template <class Step>
  static void for_each_step(int px, std::size_t most, Step&& step) {
    const std::size_t all = static_cast<std::size_t>(px);
    for (std::size_t reach = 0, by; reach < all; reach += by) {
      by = std::min({all - reach, reach + 1, most});
      step(by);
    }
  }

  cv::Size size_;
  std::size_t words_ = 0;  // of a row of the union
  std::vector<Word> union_, bits_;
};

}  // namespace stillpoint
