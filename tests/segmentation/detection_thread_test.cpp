// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/segmentation/detection_thread.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

#include "../flat_scene.hpp"
#include "../io/temporary_folder.hpp"
#include "stillpoint/front_end.hpp"

namespace {

using namespace stillpoint;

/// Answers each frame only when the test lets it.
class GatedSegmenter : public Segmenter {
 public:
  std::function<Segmentation(const RgbdFrame&)> answer = [](const RgbdFrame&) {
    return result({box_instance({10, 10, 40, 60}, {320, 240})});
  };

  Segmentation segment(const RgbdFrame& frame) override {
    std::unique_lock<std::mutex> guard(mutex_);
    seen_.push_back(frame.timestamp);
    changed_.notify_all();
    changed_.wait(guard, [this] { return allowed_ > 0; });
    --allowed_;
    return answer(frame);
  }
  std::vector<std::string> classes() const override { return {"person"}; }

  void allow(int frames) {
    const std::lock_guard<std::mutex> guard(mutex_);
    allowed_ += frames;
    changed_.notify_all();
  }
  /// Waits until the segmenter has begun its n-th frame.
  void wait_for_start(std::size_t n) {
    std::unique_lock<std::mutex> guard(mutex_);
    changed_.wait(guard, [&] { return seen_.size() >= n; });
  }
  std::vector<double> seen() {
    const std::lock_guard<std::mutex> guard(mutex_);
    return seen_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int allowed_ = 0;
  std::vector<double> seen_;
};

RgbdFrame frame_at(double timestamp) {
  static const FlatScene scene;
  RgbdFrame frame = scene.frame(timestamp, {});
  return frame;
}

/// Hands over the same frame until a result comes.
Segmentation next_result(DetectionThread& thread, const RgbdFrame& frame) {
  while (true) {
    Segmentation found = thread.segment(frame);
    if (found.available) return found;
    std::this_thread::yield();
  }
}

TEST(DetectionThread, NeverWaitsAndTakesTheNewestFrame) {
  GatedSegmenter segmenter;
  DetectionThread thread(segmenter);
  EXPECT_EQ(thread.classes(), std::vector<std::string>{"person"});
  EXPECT_FALSE(thread.segment(frame_at(1)).available);
  segmenter.wait_for_start(1);
  for (int i = 2; i <= 6; ++i) EXPECT_FALSE(thread.segment(frame_at(i)).available);
  EXPECT_EQ(thread.dropped(), 4u) << "of 2 to 6 the last waits";
  segmenter.allow(1);
  segmenter.wait_for_start(2);
  EXPECT_EQ(segmenter.seen(), (std::vector<double>{1, 6}));
  const Segmentation first = thread.segment(frame_at(7));
  ASSERT_TRUE(first.available);
  EXPECT_EQ(first.timestamp, 1) << "the frame that it belongs to";
  EXPECT_EQ(first.instances.size(), 1u);
  EXPECT_FALSE(thread.segment(frame_at(8)).available) << "handed out once";
  segmenter.allow(1);
  segmenter.wait_for_start(3);
  EXPECT_EQ(thread.segment(frame_at(9)).timestamp, 6);
  segmenter.allow(100);
}

TEST(DetectionThread, CanBeWaitedForAtTheStart) {
  GatedSegmenter segmenter;
  DetectionThread thread(segmenter);
  EXPECT_FALSE(thread.wait_for_result(0)) << "nothing was handed over";
  thread.segment(frame_at(1));
  EXPECT_FALSE(thread.wait_for_result(0.01)) << "it hangs";
  segmenter.allow(1);
  EXPECT_TRUE(thread.wait_for_result(100));
  EXPECT_EQ(thread.segment(frame_at(1)).timestamp, 1);
  segmenter.allow(100);
}

TEST(DetectionThread, ResultsComeInOrder) {
  GatedSegmenter segmenter;
  segmenter.allow(1000000);
  DetectionThread thread(segmenter);
  double last = 0;
  for (int i = 1; i <= 300; ++i) {
    const Segmentation found = thread.segment(frame_at(i));
    if (!found.available) continue;
    EXPECT_GT(found.timestamp, last);
    EXPECT_LT(found.timestamp, i);
    last = found.timestamp;
  }
  EXPECT_LE(thread.dropped() + segmenter.seen().size(), 300u);
}

TEST(DetectionThread, PassesExceptionsOnAndGoesOn) {
  GatedSegmenter segmenter;
  std::atomic<int> calls{0};
  segmenter.answer = [&](const RgbdFrame&) -> Segmentation {
    switch (calls++) {
      case 0:
        throw std::runtime_error("no GPU");
      case 1:
        throw 42;
      case 2:
        return result({box_instance({600, 400, 30, 30}, {640, 480})});
      default:
        return result({});
    }
  };
  segmenter.allow(1000000);
  DetectionThread thread(segmenter);
  FrontEnd front_end(FrontEndSettings::network_only(), {}, &thread);
  std::vector<std::string> errors;
  double time = 0;
  while (errors.size() < 3) {
    front_end.compute_mask(frame_at(time += 1e-3));
    if (!front_end.stats().segmenter_error.empty()) {
      EXPECT_TRUE(front_end.stats().status & kSegmenterFailed);
      errors.push_back(front_end.stats().segmenter_error);
    }
  }
  EXPECT_EQ(errors[0], "no GPU");
  EXPECT_FALSE(errors[1].empty());
  EXPECT_NE(errors[2].find("inside 320x240"), std::string::npos) << errors[2];
  EXPECT_TRUE(next_result(thread, frame_at(100)).instances.empty()) << "and it comes back";
}

TEST(DetectionThread, AHangingSegmenterDoesNotStopTheFrontEnd) {
  GatedSegmenter segmenter;
  DetectionThread thread(segmenter);
  FrontEnd front_end(FrontEndSettings::network_only(), {}, &thread);
  for (int i = 0; i < 50; ++i) {
    front_end.compute_mask(frame_at(0.033 * i));
    EXPECT_EQ(front_end.stats().status, kNoSegmentation | kNeverSegmented);
  }
  segmenter.allow(100);
}

TEST(DetectionThread, EndsInAnyState) {
  for (int frames = 0; frames < 4; ++frames) {
    GatedSegmenter segmenter;
    {
      DetectionThread thread(segmenter);
      for (int i = 1; i <= frames; ++i) thread.segment(frame_at(i));
      if (frames > 1) segmenter.wait_for_start(1);
      segmenter.allow(2);
    }
    EXPECT_LE(segmenter.seen().size(), 2u);
  }
}

TEST(DetectionThread, CopiesTheFrame) {
  GatedSegmenter segmenter;
  std::atomic<int> color{-1}, depth{-1}, gray{-1};
  segmenter.answer = [&](const RgbdFrame& frame) {
    if (frame.depth.empty()) return result({});
    color = frame.color.at<cv::Vec3b>(5, 5)[0];
    gray = frame.gray.at<uchar>(5, 5);
    depth = frame.depth.at<std::uint16_t>(5, 5);
    EXPECT_EQ(frame.depth_units_per_m, 1000);
    EXPECT_EQ(frame.depth_timestamp, 0.01);
    return result({});
  };
  DetectionThread thread(segmenter);
  RgbdFrame frame;
  frame.color = cv::Mat(20, 30, CV_8UC3, cv::Scalar(7, 7, 7));
  frame.depth = cv::Mat(20, 30, CV_16UC1, cv::Scalar(1234));
  frame.gray = cv::Mat(20, 30, CV_8UC1, cv::Scalar(9));
  frame.depth_units_per_m = 1000;
  frame.depth_timestamp = 0.01;
  thread.segment(frame);
  // The host uses its buffers again.
  frame.color.setTo(200), frame.depth.setTo(0), frame.gray.setTo(0);
  segmenter.allow(1);
  while (depth < 0) std::this_thread::yield();
  EXPECT_EQ(color, 7);
  EXPECT_EQ(depth, 1234);
  EXPECT_EQ(gray, 9);
  segmenter.allow(100);
  frame.depth = cv::Mat();
  EXPECT_NO_THROW(thread.segment(frame));
  EXPECT_ERROR(thread.segment(RgbdFrame()), "frame.color");
}

TEST(DetectionThread, DropsWhatBelongsToASequenceThatEnded) {
  for (const bool finished : {false, true}) {
    SCOPED_TRACE(finished);
    GatedSegmenter segmenter;
    DetectionThread thread(segmenter);
    thread.segment(frame_at(100));
    segmenter.wait_for_start(1);
    if (finished) {
      segmenter.allow(1);
      EXPECT_TRUE(thread.wait_for_result(100));
    }
    EXPECT_FALSE(thread.segment(frame_at(1)).available);
    segmenter.allow(100);
    EXPECT_TRUE(thread.wait_for_result(100));
    EXPECT_EQ(thread.segment(frame_at(2)).timestamp, 1);
  }
}

TEST(DetectionThread, WaitsForEver) {
  for (const double timeout_s : {1e300, std::numeric_limits<double>::infinity()}) {
    GatedSegmenter segmenter;
    DetectionThread thread(segmenter);
    thread.segment(frame_at(1));
    std::thread later([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      segmenter.allow(1);
    });
    EXPECT_TRUE(thread.wait_for_result(timeout_s));
    later.join();
  }
  GatedSegmenter segmenter;
  segmenter.allow(1);
  DetectionThread thread(segmenter);
  EXPECT_FALSE(thread.wait_for_result(std::nan(""))) << "nothing was handed over";
}

TEST(DetectionThread, GivesMasksThatNobodyWritesOver) {
  GatedSegmenter segmenter;
  cv::Mat mask(60, 40, CV_8UC1);
  int value = 255;
  segmenter.answer = [&](const RgbdFrame&) {
    mask.setTo(value--);
    Instance person = box_instance({10, 10, 40, 60}, {320, 240});
    person.mask = mask;
    return result({person});
  };
  DetectionThread thread(segmenter);
  segmenter.allow(1);
  thread.segment(frame_at(1));
  ASSERT_TRUE(thread.wait_for_result(100));
  const Segmentation first = thread.segment(frame_at(2));
  segmenter.allow(1);
  ASSERT_TRUE(thread.wait_for_result(100));
  const Segmentation second = thread.segment(frame_at(3));
  segmenter.allow(1);
  EXPECT_EQ(first.instances.at(0).mask.at<uchar>(0, 0), 255);
  EXPECT_EQ(second.instances.at(0).mask.at<uchar>(0, 0), 254);
}

TEST(DetectionThread, LetsTheSegmenterKeepAFrame) {
  GatedSegmenter segmenter;
  std::vector<RgbdFrame> kept;
  segmenter.answer = [&](const RgbdFrame& frame) {
    kept.push_back(frame);
    return result({});
  };
  {
    DetectionThread thread(segmenter);
    segmenter.allow(100);
    for (int i = 1; i <= 4; ++i) {
      RgbdFrame frame;
      frame.timestamp = i;
      frame.color = cv::Mat(4, 4, CV_8UC1, cv::Scalar(i));
      thread.segment(frame);
      segmenter.wait_for_start(static_cast<std::size_t>(i));
    }
  }
  for (const RgbdFrame& frame : kept)
    EXPECT_EQ(frame.color.at<uchar>(0, 0), static_cast<int>(frame.timestamp));
}

}  // namespace
