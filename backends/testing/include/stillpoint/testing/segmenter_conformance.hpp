// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/random.hpp"
#include "stillpoint/segmentation/segmenter.hpp"

/// Runs the conformance suite of segmenters over what `Make` makes, in a GoogleTest program:
///
///     #include "stillpoint/testing/segmenter_conformance.hpp"
///     struct MakeMine {
///       std::unique_ptr<stillpoint::Segmenter> operator()() const {
///         return std::make_unique<MySegmenter>("weights.onnx");
///       }
///     };
///     STILLPOINT_TEST_SEGMENTER(Mine, MakeMine)
///
/// Use it in the namespace stillpoint::testing. One is made for each test; if that throws, the test
/// is skipped with the message (weights that are not there).
#define STILLPOINT_TEST_SEGMENTER(prefix, Make) \
  INSTANTIATE_TYPED_TEST_SUITE_P(prefix, SegmenterConformance, ::testing::Types<Make>)

namespace stillpoint {
namespace testing {

/// An image of noise with some large shapes; the same for the same seed.
inline RgbdFrame conformance_frame(const cv::Size& size, int type, std::uint64_t seed,
                                   double timestamp, bool with_depth = true) {
  RandomGenerator random(seed);
  RgbdFrame frame;
  frame.timestamp = timestamp;
  frame.color.create(size, type);
  const int channels = frame.color.channels();
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < channels * size.width; ++x)
      frame.color.ptr<uchar>(y)[x] = static_cast<uchar>(
          128 + 60 * (((x / channels * 5 / size.width) + (y * 4 / size.height)) % 2) +
          static_cast<int>(40 * random.uniform()));
  if (with_depth) frame.depth = cv::Mat(size, CV_16UC1, cv::Scalar(10000));
  return frame;
}

template <class Make>
class SegmenterConformance : public ::testing::Test {
 protected:
  void SetUp() override {
    try {
      segmenter_ = Make()();
    } catch (const std::exception& error) {
      GTEST_SKIP() << error.what();
    }
    ASSERT_TRUE(segmenter_) << "the maker returned null";
  }

  /// Segments and checks all that must hold for any result.
  static Segmentation segment(Segmenter& segmenter, const RgbdFrame& frame) {
    const cv::Mat color = frame.color.clone(), depth = frame.depth.clone();
    Segmentation found = segmenter.segment(frame);
    EXPECT_NO_THROW(check_segmentation(found, frame.color.size()));
    if (found.available && !std::isnan(found.timestamp)) {
      EXPECT_LE(found.timestamp, frame.timestamp);
    }
    if (!found.available) {
      EXPECT_TRUE(found.instances.empty()) << "no result, yet instances";
    }
    for (const Instance& s : found.instances) {
      EXPECT_GE(s.score, 0) << s.class_name;
      EXPECT_LE(s.score, 1) << s.class_name;
      int other = 0;
      for (int y = 0; y < s.mask.rows; ++y)
        for (int x = 0; x < s.mask.cols; ++x)
          other += s.mask.ptr<uchar>(y)[x] != 0 && s.mask.ptr<uchar>(y)[x] != 255;
      EXPECT_EQ(other, 0) << "masks are 0 and 255 only";
    }
    EXPECT_EQ(cv::norm(frame.color, color, cv::NORM_INF), 0) << "the frame was written to";
    if (!depth.empty()) {
      EXPECT_EQ(cv::norm(frame.depth, depth, cv::NORM_INF), 0) << "the frame was written to";
    }
    return found;
  }
  Segmentation segment(const RgbdFrame& frame) { return segment(*segmenter_, frame); }

  static void expect_same(const Segmentation& a, const Segmentation& b) {
    EXPECT_EQ(a.available, b.available);
    ASSERT_EQ(a.instances.size(), b.instances.size());
    for (std::size_t i = 0; i < a.instances.size(); ++i) {
      const Instance &s = a.instances[i], &t = b.instances[i];
      EXPECT_EQ(s.class_name, t.class_name);
      EXPECT_EQ(s.score, t.score);
      EXPECT_EQ(s.box, t.box);
      ASSERT_EQ(s.mask.size(), t.mask.size());
      if (!s.mask.empty()) {
        EXPECT_EQ(cv::norm(s.mask, t.mask, cv::NORM_INF), 0);
      }
    }
  }

  static Segmentation copy(const Segmentation& from) {
    Segmentation to = from;
    for (Instance& s : to.instances) s.mask = s.mask.clone();
    return to;
  }

  std::unique_ptr<Segmenter> segmenter_;
};

TYPED_TEST_SUITE_P(SegmenterConformance);

TYPED_TEST_P(SegmenterConformance, FitsThePicture) {
  this->segment(conformance_frame({640, 480}, CV_8UC3, 1, 1));
}

TYPED_TEST_P(SegmenterConformance, TakesAnEmptyScene) {
  RgbdFrame black;
  black.timestamp = 1;
  black.color = cv::Mat::zeros(480, 640, CV_8UC3);
  black.depth = cv::Mat::zeros(480, 640, CV_16UC1);
  this->segment(black);
  black.color.setTo(255), black.timestamp = 2;
  this->segment(black);
}

TYPED_TEST_P(SegmenterConformance, TakesGreyPictures) {
  this->segment(conformance_frame({640, 480}, CV_8UC1, 2, 1));
}

TYPED_TEST_P(SegmenterConformance, TakesPicturesWithoutDepth) {
  this->segment(conformance_frame({640, 480}, CV_8UC3, 3, 1, false));
}

TYPED_TEST_P(SegmenterConformance, TakesOtherSizesOrRefusesThem) {
  // Odd lengths, upright, tiny, larger than most networks' inputs; and back.
  double time = 0;
  for (const cv::Size& size : {cv::Size(641, 479), cv::Size(480, 640), cv::Size(17, 9),
                               cv::Size(1280, 720), cv::Size(640, 480)}) {
    try {
      this->segment(conformance_frame(size, CV_8UC3, 4, ++time));
    } catch (const Error& error) {
      EXPECT_NE(size, cv::Size(640, 480)) << error.what();
    }
  }
}

TYPED_TEST_P(SegmenterConformance, TakesPartsOfLargerPictures) {
  RgbdFrame frame = conformance_frame({800, 600}, CV_8UC3, 5, 1, false);
  const RgbdFrame whole = frame;
  frame.color = whole.color(cv::Rect(50, 40, 640, 480));  // rows are not one after the other
  const Segmentation part = this->copy(this->segment(frame));
  frame.color = frame.color.clone();
  this->expect_same(part, this->segment(frame));
}

TYPED_TEST_P(SegmenterConformance, GivesTheSameAgain) {
  const RgbdFrame frame = conformance_frame({640, 480}, CV_8UC3, 6, 1);
  const RgbdFrame other = conformance_frame({640, 480}, CV_8UC3, 7, 2);
  const Segmentation first = this->copy(this->segment(frame));
  this->segment(other);
  this->expect_same(first, this->segment(frame));
  this->expect_same(first, this->segment(*TypeParam()(), frame));
}

TYPED_TEST_P(SegmenterConformance, RefusesWhatIsNoPicture) {
  RgbdFrame empty;
  empty.timestamp = 1;
  RgbdFrame floats = empty;
  floats.color = cv::Mat::zeros(480, 640, CV_32FC3);
  for (const RgbdFrame& frame : {empty, floats}) {
    Segmentation found;
    try {
      found = this->segmenter_->segment(frame);
    } catch (const std::exception&) {
      continue;
    }
    EXPECT_NO_THROW(check_segmentation(found, frame.color.size()))
        << "neither an exception nor a result that fits";
  }
  this->segment(conformance_frame({640, 480}, CV_8UC3, 8, 2));
}

TYPED_TEST_P(SegmenterConformance, WorksInAnotherThreadThanItWasMadeIn) {
  const RgbdFrame frame = conformance_frame({640, 480}, CV_8UC3, 9, 1);
  const Segmentation here = this->copy(this->segment(frame));
  Segmentation there;
  std::thread([&, this] { there = this->copy(this->segment(frame)); }).join();
  this->expect_same(here, there);
}

TYPED_TEST_P(SegmenterConformance, ReportsOnlyClassesThatItKnows) {
  const std::vector<std::string> known = this->segmenter_->classes();
  if (known.empty()) GTEST_SKIP() << "it does not say which classes it knows";
  for (std::uint64_t seed = 10; seed < 13; ++seed)
    for (const Instance& s :
         this->segment(conformance_frame({640, 480}, CV_8UC3, seed, static_cast<double>(seed)))
             .instances)
      EXPECT_NE(std::find(known.begin(), known.end(), s.class_name), known.end()) << s.class_name;
}

REGISTER_TYPED_TEST_SUITE_P(SegmenterConformance, FitsThePicture, TakesAnEmptyScene,
                            TakesGreyPictures, TakesPicturesWithoutDepth,
                            TakesOtherSizesOrRefusesThem, TakesPartsOfLargerPictures,
                            GivesTheSameAgain, RefusesWhatIsNoPicture,
                            WorksInAnotherThreadThanItWasMadeIn, ReportsOnlyClassesThatItKnows);

}  // namespace testing
}  // namespace stillpoint
