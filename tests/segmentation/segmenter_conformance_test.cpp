// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/testing/segmenter_conformance.hpp"

#include <gtest/gtest.h>

#include <exception>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "stillpoint/segmentation/detection_thread.hpp"

// The example as users copy it; its main() ends without a return, as only main() may.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wreturn-type"
#define main example_main
#include "../../examples/05_custom_segmenter.cpp"
#undef main
#pragma GCC diagnostic pop

namespace stillpoint {
namespace testing {
namespace {

/// Takes bright parts of the image for people: always finds some in the suite's images.
class BrightnessSegmenter : public Segmenter {
 public:
  Segmentation segment(const RgbdFrame& frame) override {
    cv::Mat grey = frame.color, labels, stats, centers;
    if (grey.channels() == 3) cv::cvtColor(frame.color, grey, cv::COLOR_BGR2GRAY);
    cv::blur(grey, grey, {9, 9});  // without the noise
    const int n = cv::connectedComponentsWithStats(grey > 190, labels, stats, centers, 4);
    Segmentation result;
    result.available = true;
    for (int label = 1; label < n; ++label)
      if (stats.at<int>(label, cv::CC_STAT_AREA) > 1000)
        result.instances.push_back(instance_from_mask(labels == label, "person", 0.5f));
    return result;
  }
  std::vector<std::string> classes() const override { return {"person"}; }
};

/// A DetectionThread that is waited for: the result is that of the frame.
class WaitedThread : public Segmenter {
 public:
  Segmentation segment(const RgbdFrame& frame) override {
    check_frame(frame);  // what the thread refuses at once
    try {
      thread_.segment(frame);  // hands out what an earlier call left
    } catch (const std::exception&) {
    }
    thread_.wait_for_result(100);
    Segmentation result;
    try {
      result = thread_.segment(frame);
    } catch (...) {
      thread_.wait_for_result(100);
      throw;
    }
    EXPECT_TRUE(result.available);
    EXPECT_EQ(result.timestamp, frame.timestamp);
    thread_.wait_for_result(100);
    return result;
  }
  std::vector<std::string> classes() const override { return thread_.classes(); }

 private:
  BrightnessSegmenter segmenter_;
  DetectionThread thread_{segmenter_};
};

template <class Made>
struct Make {
  std::unique_ptr<Segmenter> operator()() const {
    cv::setNumThreads(1);  // The thread sanitizer does not see how OpenCV's threads meet.
    return std::make_unique<Made>();
  }
};

TEST(ConformanceFrame, HasInstances) {
  const auto thread = Make<WaitedThread>()();
  const RgbdFrame frame = conformance_frame({640, 480}, CV_8UC3, 1, 1);
  EXPECT_GE(thread->segment(frame).instances.size(), 2u);
}

STILLPOINT_TEST_SEGMENTER(InADetectionThread, Make<WaitedThread>);
STILLPOINT_TEST_SEGMENTER(CustomSegmenterExample, Make<NearnessSegmenter>);

}  // namespace
}  // namespace testing
}  // namespace stillpoint
