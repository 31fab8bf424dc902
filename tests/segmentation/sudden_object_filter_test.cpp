// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/segmentation/sudden_object_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

namespace {

using namespace stillpoint;

const cv::Size kSize(640, 480);
const cv::Rect kHuge(20, 10, 600, 460), kSmall(300, 200, 80, 200);

Instance person(const cv::Rect& box, const char* name = "person") {
  Instance s;
  s.class_name = name;
  s.box = box;
  return s;
}

struct Detector {
  SuddenObjectFilter filter;
  std::vector<RememberedObject> known;
  std::vector<Instance> movers;
  CellLabels labels;
  double time_s = 1;
  bool says_when = true;

  explicit Detector(const SegmentationCompensatorSettings& settings = {}) : filter(settings) {
    result({});  // there was nothing
  }

  // How many are left.
  std::size_t result(const std::vector<Instance>& instances, double later_s = 0.033) {
    time_s += later_s;
    Segmentation segmentation{true, says_when ? time_s : std::nan(""), instances};
    filter.filter(time_s, kSize, known, movers, labels, segmentation);
    EXPECT_EQ(filter.status() == kObjectDoubted, segmentation.instances.size() < instances.size());
    return segmentation.instances.size();
  }
};

TEST(SuddenObjectFilter, DoubtsWhatFillsTheImageUntilTheThirdResult) {
  Detector d;
  EXPECT_EQ(d.result({person(kHuge), person(kSmall)}), 1u);
  EXPECT_EQ(d.result({person(kHuge)}), 0u);
  EXPECT_EQ(d.result({person(kHuge)}), 1u);
}

TEST(SuddenObjectFilter, TakesAResultThatDoesNotSayWhenForOneOfThisFrame) {
  Detector d;
  d.says_when = false;
  EXPECT_EQ(d.result({person(kHuge)}), 0u);
}

TEST(SuddenObjectFilter, SaysNothingOfAFrameWithoutAResult) {
  Detector d;
  EXPECT_EQ(d.result({person(kHuge)}), 0u);
  Segmentation none{false, d.time_s, {person(kHuge)}};
  d.filter.filter(d.time_s + 0.033, kSize, {}, {}, {}, none);
  EXPECT_EQ(d.filter.status(), kOk);
  EXPECT_EQ(none.instances.size(), 1u);
}

TEST(SuddenObjectFilter, ResultsMustBeInARowAndInOnePlace) {
  Detector d;
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(d.result({person(kHuge)}), 0u) << i;
    EXPECT_EQ(d.result({person(kHuge)}), 0u) << i;
    EXPECT_EQ(d.result({}), 0u) << i;
  }
  const cv::Rect left(0, 0, 300, 480), right(320, 0, 320, 480);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(d.result({person(i % 2 ? left : right)}), 0u) << i;
}

TEST(SuddenObjectFilter, BelievesWhoMovesAndWhoIsKnown) {
  Detector d;
  d.movers = {person({100, 100, 200, 300}, "")};
  EXPECT_EQ(d.result({person(kHuge)}), 1u);
  d.movers.clear();
  d.result({});

  RgbdFrame frame;
  frame.color = cv::Mat(kSize, CV_8UC1, cv::Scalar(90));
  FrameContext context;
  context.begin(frame, Camera());
  d.known.resize(1);
  const Instance before = person({100, 50, 250, 300});
  d.known[0].observe(context, DepthView(), before, nullptr);
  EXPECT_EQ(d.result({person(kHuge)}), 1u);
  d.known[0].class_name.clear();  // a mover that the segmenter never named
  d.result({});
  EXPECT_EQ(d.result({person(kHuge)}), 0u);
}

TEST(SuddenObjectFilter, BelievesWhatStoodThereOnlyIfTheSegmenterInsists) {
  // Of the columns, how many were looked at, are static, have moved; whether it is believed.
  const struct {
    int seen, of_static, moved;
    bool believed;
  } cases[] = {{80, 60, 0, false}, {80, 50, 0, true},  {80, 70, 3, true},
               {20, 20, 0, true},  {40, 30, 0, false}, {0, 0, 0, true}};
  for (const bool bare : {true, false})
    for (const auto& c : cases) {
      SCOPED_TRACE(::testing::Message() << bare << ' ' << c.seen << ' ' << c.of_static);
      Detector d;
      Instance huge = person(cv::Rect(cv::Point(), kSize));
      if (!bare) huge.mask = cv::Mat(kSize, CV_8UC1, cv::Scalar(1));
      d.labels.reset(8, 80, 60);
      for (std::size_t i = 0; i < 80 * 60; ++i) {
        const int x = static_cast<int>(i % 80);
        if (x < c.seen) d.labels.set_seen(i);
        if (x < c.of_static) d.labels[i] = CellLabel::kStatic;
        if (x >= 80 - c.moved) d.labels[i] = CellLabel::kMoved;
      }
      EXPECT_EQ(d.result({huge}, 0.25), c.believed ? 1u : 0u);  // after a pause
      for (int i = 2; i <= 50; ++i) {
        const double later_s = c.believed || i % 2 == 0 ? 0.033 : 0.25;
        EXPECT_EQ(d.result({huge}, later_s), i >= (c.believed ? 4 : 45) ? 1u : 0u) << i;
      }
      EXPECT_EQ(d.result({person({20, 10, 200, 200})}), 1u);  // not a large one
    }
}

TEST(SuddenObjectFilter, BelievesTheFirstResultAndTheFirstAfterAPause) {
  SuddenObjectFilter filter;
  Segmentation found{true, 5, {person(kHuge)}};
  filter.filter(5, kSize, {}, {}, {}, found);
  EXPECT_EQ(filter.status(), kOk);
  Detector d;
  EXPECT_EQ(d.result({person(kHuge)}, 0.25), 1u);  // 4 Hz: people come close between two results
  EXPECT_EQ(d.result({person(kHuge)}, -3), 1u);    // another sequence
}

TEST(SuddenObjectFilter, LeavesObjectsWithoutAClassAndSettingsDecide) {
  Detector d;
  EXPECT_EQ(d.result({person(kHuge, "")}), 1u);
  SegmentationCompensatorSettings settings;
  settings.sudden_results = 2;
  Detector two(settings);
  EXPECT_EQ(two.result({person(kHuge)}), 0u);
  EXPECT_EQ(two.result({person(kHuge)}), 1u);
  Detector paper(SegmentationCompensatorSettings::paper());
  EXPECT_EQ(paper.result({person({0, 0, 640, 480})}), 1u);
}

}  // namespace
