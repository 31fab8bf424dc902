// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/bit_mask.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "stillpoint/core/random.hpp"

namespace {

using namespace stillpoint;

TEST(BitMask, TakesMasksAtAnyPlaceAndGivesThemBack) {
  RandomGenerator random(5);
  for (int k = 0; k < 300; ++k) {
    const int width = 1 + static_cast<int>(random.below(200));
    const int x = static_cast<int>(random.below(static_cast<std::size_t>(width)));
    const int n = 1 + static_cast<int>(random.below(static_cast<std::size_t>(width - x)));
    detail::BitMask bits;
    bits.reset({width, 3});
    // Whatever is not zero counts.
    cv::Mat mask = cv::Mat::zeros(1, n, CV_8UC1);
    const std::size_t share = random.below(4);
    for (int i = 0; i < n; ++i)
      if (random.below(3) < share) mask.at<uchar>(0, i) = static_cast<uchar>(1 + random.below(255));
    bits.add(mask, {x, 1, n, 1});
    std::vector<uchar> row(static_cast<std::size_t>(width) + 1, 7);
    detail::unpack(bits.row(1), 0, static_cast<std::size_t>(width), row.data());
    int set = 0;
    for (int i = 0; i < width; ++i) {
      const bool expected = i >= x && i < x + n && mask.at<uchar>(0, i - x) != 0;
      ASSERT_EQ(row[static_cast<std::size_t>(i)], expected ? 255 : 0)
          << "case " << k << " at " << i;
      set += expected;
    }
    EXPECT_EQ(row.back(), 7) << "wrote beyond the row";
    int counted = 0;
    std::vector<uchar> runs(static_cast<std::size_t>(width), 0);
    std::vector<std::uint64_t> words(bits.row(1), bits.row(1) + bits.words());
    for (const std::uint64_t word : words) counted += detail::count_bits(word);
    EXPECT_EQ(counted, set);
    detail::for_each_run(words, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) runs[static_cast<std::size_t>(i)] = 255;
      EXPECT_TRUE(begin == 0 || row[static_cast<std::size_t>(begin) - 1] == 0);
      EXPECT_TRUE(end == width || row[static_cast<std::size_t>(end)] == 0);
    });
    row.pop_back();
    EXPECT_EQ(runs, row);
    for (const int y : {0, 2})
      for (std::size_t i = 0; i < bits.words(); ++i) EXPECT_EQ(bits.row(y)[i], 0u);
    const int from = static_cast<int>(random.below(static_cast<std::size_t>(width)));
    std::vector<uchar> part(static_cast<std::size_t>(width - from));
    detail::unpack(bits.row(1), static_cast<std::size_t>(from), part.size(), part.data());
    EXPECT_EQ(part, std::vector<uchar>(row.begin() + from, row.end()));
  }
}

TEST(BitMask, ABoxAloneIsFull) {
  for (const int width : {1, 63, 64, 65, 200}) {
    detail::BitMask bits;
    bits.reset({width + 7, 2});
    bits.add(cv::Mat(), {5, 0, width, 1});
    std::vector<uchar> row(static_cast<std::size_t>(width) + 7);
    detail::unpack(bits.row(0), 0, row.size(), row.data());
    for (int i = 0; i < width + 7; ++i)
      EXPECT_EQ(row[static_cast<std::size_t>(i)], i >= 5 && i < width + 5 ? 255 : 0);
  }
}

TEST(BitMask, OfABoxHoldsItAtThePicturesWords) {
  RandomGenerator random(7);
  detail::BitMask bits;
  for (int k = 0; k < 100; ++k) {
    const cv::Rect box(static_cast<int>(random.below(150)), static_cast<int>(random.below(9)),
                       1 + static_cast<int>(random.below(150)), 3);
    cv::Mat mask(box.size(), CV_8UC1);
    for (int i = 0; i < box.area(); ++i)
      mask.data[i] = static_cast<uchar>(random.below(2) * random.below(256));
    bits.reset(box);
    bits.add(mask, box);
    EXPECT_EQ(bits.first_word(), box.x / 64);
    for (int y = 0; y < 3; ++y) {
      int set = 0;
      for (int x = 0; x < box.width; ++x)
        EXPECT_EQ(detail::bit_at(bits.row(box.y + y), bits.bit_of(box.x + x)),
                  mask.at<uchar>(y, x) != 0);
      for (std::size_t w = 0; w < bits.words(); ++w)
        set += detail::count_bits(bits.row(box.y + y)[w]);
      EXPECT_EQ(set, cv::countNonZero(mask.row(y))) << "bits beside the box";
    }
  }
}

TEST(BitMask, PacksBytesIntoOneWord) {
  RandomGenerator random(8);
  for (std::size_t n = 0; n <= 64; ++n) {
    std::vector<unsigned char> bytes(n);
    std::uint64_t expected = 0;
    for (std::size_t i = 0; i < n; ++i) {
      bytes[i] = static_cast<unsigned char>(random.below(2) * random.below(256));
      expected |= std::uint64_t{bytes[i] != 0} << i;
    }
    EXPECT_EQ(detail::pack_word(bytes.data(), n), expected) << n;
  }
}

TEST(BitMask, FindsDepthsInARange) {
  RandomGenerator random(6);
  // Zero, the ends of the range and those of 16 bits are the cases where arithmetic may go wrong.
  const auto any = [&](std::uint16_t near) {
    const std::uint16_t values[] = {0,
                                    1,
                                    32767,
                                    32768,
                                    65534,
                                    65535,
                                    static_cast<std::uint16_t>(near - 1),
                                    near,
                                    static_cast<std::uint16_t>(near + 1),
                                    static_cast<std::uint16_t>(random.below(65536))};
    return values[random.below(10)];
  };
  for (int k = 0; k < 2000; ++k) {
    std::uint16_t z[16], lo[16], span[16];
    std::uint64_t zeros = 0, in_range = 0;
    for (std::size_t i = 0; i < 16; ++i) {
      const std::uint16_t a = any(0), b = any(a);
      lo[i] = std::min(a, b), span[i] = static_cast<std::uint16_t>(std::max(a, b) - lo[i]);
      z[i] = any(random.below(2) ? a : b);
      zeros |= std::uint64_t{z[i] == 0} << i;
      in_range |= std::uint64_t{z[i] >= std::min(a, b) && z[i] <= std::max(a, b)} << i;
    }
    ASSERT_EQ(detail::zeros_16(z), zeros) << "case " << k;
    ASSERT_EQ(detail::in_range_16(z, lo, span), in_range) << "case " << k;
  }
}

}  // namespace
