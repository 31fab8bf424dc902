// SPDX-License-Identifier: BSD-2-Clause
// The front end on random input of every kind that its types allow, and on some that they do not:
// whatever comes, it answers with a mask that keeps its promises, or throws Error.
//
// STILLPOINT_FUZZ_FRAMES: how many frames (100000); STILLPOINT_FUZZ_SEED: the first seed (1).
#include "stillpoint/front_end.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <vector>

#include "stillpoint/core/mask_functions.hpp"
#include "stillpoint/core/random.hpp"

namespace stillpoint {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

long from_environment(const char* name, long otherwise) {
  const char* text = std::getenv(name);
  return text && *text ? std::atol(text) : otherwise;
}

/// What the frames reached: a fuzzer that tries nothing finds nothing.
struct Reached {
  long frames = 0, refused = 0, masked = 0, restored = 0, moving = 0, located = 0, in_world = 0,
       entering = 0;
};

/// One front end, and frames for it.
class Fuzzer {
 public:
  Fuzzer(std::uint64_t seed, Reached& reached) : random_(seed), reached_(reached) {
    // Most are small: what goes wrong, goes wrong at borders. Few are as large as real ones.
    const int longest = chance(0.005) ? 640 : chance(0.05) ? 160 : chance(0.4) ? 64 : 16;
    size_ = {1 + below(longest), 1 + below(longest)};
    settings_ = FrontEndSettings::preset(
        std::vector<std::string>{"default", "default", "network_only", "paper"}[index(4)]);
    settings_.use_compensation = !chance(0.1);
    settings_.use_depth = !chance(0.1);
    settings_.use_probability = !chance(0.1);
    settings_.dynamic_classes = {"person", {"chair", 0.4f}};
    if (chance(0.3)) settings_.depth.dilation_px = below(30);
    if (chance(0.3)) settings_.motion.block_px = 2 * below(6);
    if (chance(0.2)) settings_.objects.max_lost_s = 0;
    if (!chance(0.2)) {
      camera_.fx = camera_.fy = 0.3 + 2.0 * random_.uniform() * size_.width;
      camera_.cx = size_.width * random_.uniform(), camera_.cy = size_.height * random_.uniform();
      if (chance(0.3)) camera_.k1 = random_.uniform() - 0.5, camera_.p1 = 0.1 * random_.uniform();
    }
    front_end_.emplace(settings_, camera_);
    scene_ = noise(CV_8UC1);
  }

  int frames() const { return 1 + static_cast<int>(30 * std::pow(1.0 / size_.area(), 0.1)); }

  void step() {
    ++reached_.frames;
    const RgbdFrame frame = next_frame();
    const Segmentation segmentation = next_segmentation(frame.timestamp);
    std::optional<Eigen::Isometry3d> motion;
    if (chance(0.5)) motion = pose();
    const bool refuses = motion && !motion->matrix().allFinite();
    const bool time_is_set = frame.timestamp != 0;
    try {
      const DynamicMask& mask = front_end_->compute_mask(frame, segmentation, motion);
      check_mask(mask, frame);
      if (refuses) {
        EXPECT_TRUE(front_end_->stats().status & kPoseRefused);
      }
    } catch (const Error&) {
      EXPECT_FALSE(time_is_set && valid_) << "only what breaks the rules is refused";
      ++reached_.refused;
      return;
    }
    EXPECT_TRUE(valid_) << "what breaks the rules is refused";
    if (chance(0.3)) check_objects();
    if (chance(0.7)) check_selections();
    if (chance(0.6)) front_end_->correct_pose(pose());
    check_objects();
    if (chance(0.1)) check_functions(frame);
  }

 private:
  bool chance(double p) { return random_.uniform() < p; }
  int below(int n) { return static_cast<int>(random_.uniform() * n); }
  std::size_t index(int n) { return static_cast<std::size_t>(below(n)); }
  double number() {
    static constexpr double kOdd[] = {kNan, kInfinity, -kInfinity, 0, -0.0, 1e300, -1e9, 1e-300};
    return chance(0.1) ? kOdd[index(8)] : 10 * (random_.uniform() - 0.5);
  }

  cv::Mat noise(int type) {
    cv::Mat image(size_, type);
    for (int y = 0; y < image.rows; ++y)
      for (std::size_t k = 0; k < image.cols * image.elemSize(); ++k)
        image.ptr<uchar>(y)[k] = static_cast<uchar>(below(256));
    return image;
  }

  cv::Mat next_color() {
    if (chance(0.1)) return noise(chance(0.5) ? CV_8UC1 : CV_8UC3);
    if (chance(0.1)) return cv::Mat(size_, CV_8UC3, cv::Scalar::all(below(256)));
    if (chance(0.02)) scene_ = noise(CV_8UC1);
    if (chance(0.5)) return scene_;  // a camera at rest
    cv::Mat shifted;
    const cv::Matx23d by(1, 0, below(5) - 2, 0, 1, below(5) - 2);
    cv::warpAffine(scene_, shifted, by, size_, cv::INTER_NEAREST, cv::BORDER_REFLECT);
    return shifted;
  }

  cv::Mat next_depth() {
    if (chance(0.1)) return {};
    const double wall = chance(0.1) ? number() : 1 + 4 * random_.uniform();
    cv::Mat metres(size_, CV_32FC1, cv::Scalar(std::isnan(wall) ? 0 : wall));
    for (int n = below(4); n > 0; --n) metres(box()).setTo(0.5 + 5 * random_.uniform());
    if (chance(0.5)) {
      for (int n = below(20); n > 0; --n)
        metres.at<float>(below(size_.height), below(size_.width)) = static_cast<float>(number());
      return metres;
    }
    cv::Mat units;
    cv::patchNaNs(metres, 0);
    metres.convertTo(units, CV_16U, 5000);
    return units;
  }

  RgbdFrame next_frame() {
    RgbdFrame frame;
    valid_ = true;
    frame.color = next_color(), frame.depth = next_depth();
    now_ += chance(0.9) ? 1 / 30.0 : chance(0.3) ? 0 : chance(0.5) ? 5 * random_.uniform() : -1;
    frame.timestamp = now_;
    if (chance(0.1)) frame.depth_timestamp = now_ + 0.02 * (random_.uniform() - 0.5);
    if (chance(0.01)) break_it(frame);
    return frame;
  }

  void break_it(RgbdFrame& frame) {
    valid_ = false;
    switch (below(5)) {
      case 0:
        frame.color.release();
        break;
      case 1:
        frame.color.convertTo(frame.color, CV_16U);
        break;
      case 2:
        frame.timestamp = chance(0.5) ? kNan : kInfinity;
        break;
      case 3:
        frame.depth = cv::Mat(size_, CV_64FC1, cv::Scalar(1));
        break;
      default:
        frame.depth = cv::Mat(size_.height + 1, size_.width, CV_16UC1, cv::Scalar(1));
    }
  }

  cv::Rect box() {
    const int x = below(size_.width), y = below(size_.height);
    return {x, y, 1 + below(size_.width - x), 1 + below(size_.height - y)};
  }

  Segmentation next_segmentation(double now) {
    Segmentation s;
    s.available = chance(0.7);
    if (chance(0.2)) s.timestamp = now - 0.3 * random_.uniform();
    for (int n = below(4); n > 0; --n) {
      Instance instance;
      static const char* const kNames[] = {"person", "person", "chair", "", "cat"};
      instance.class_name = kNames[index(5)];
      instance.score = static_cast<float>(random_.uniform());
      instance.box = box();
      if (!chance(0.2)) {
        instance.mask = cv::Mat(instance.box.size(), CV_8UC1, cv::Scalar(chance(0.1) ? 0 : 255));
        for (int k = below(3); k > 0; --k)
          instance.mask.rowRange(0, 1 + below(instance.box.height)).setTo(0);
      }
      s.instances.push_back(instance);
    }
    if (chance(0.01)) {
      s.instances.emplace_back();
      s.instances.back().box = {size_.width - 1, 0, 2, 1};  // beyond the image
      valid_ = false;
    }
    return s;
  }

  Eigen::Isometry3d pose() {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    if (chance(0.5)) return T;
    const double large = chance(0.2) ? 1 : 0.02;
    T.translation() =
        large * Eigen::Vector3d(random_.uniform(), random_.uniform(), random_.uniform());
    T.rotate(Eigen::AngleAxisd(large * random_.uniform(), Eigen::Vector3d::UnitY()));
    if (chance(0.1)) T.matrix()(below(3), below(4)) = number();
    return T;
  }

  void check_mask(const DynamicMask& mask, const RgbdFrame& frame) {
    ASSERT_EQ(mask.image.type(), CV_8UC1);
    ASSERT_EQ(mask.image.size(), size_);
    int dynamic = 0;
    for (int y = 0; y < size_.height; ++y)
      for (int x = 0; x < size_.width; ++x) {
        const uchar value = mask.image.at<uchar>(y, x);
        ASSERT_TRUE(value == 0 || value == 255);
        dynamic += value != 0;
      }
    reached_.masked += dynamic > 0;
    reached_.restored += front_end_->stats().restored > 0;
    reached_.moving += front_end_->stats().moving > 0;
    EXPECT_EQ(mask.timestamp, frame.timestamp);
    EXPECT_GE(mask.age_s, 0);
    const FrameStats& stats = front_end_->stats();
    EXPECT_NEAR(stats.mask_share, dynamic / static_cast<double>(size_.area()), 1e-9);
    const cv::Mat undilated = front_end_->undilated_mask();
    EXPECT_EQ(cv::countNonZero(undilated & (mask.image == 0)), 0) << "dilation only adds";
  }

  void check_objects() {
    std::vector<int> ids;
    for (const DynamicObject& o : front_end_->objects()) {
      ids.push_back(o.id);
      reached_.located += o.in_camera.has_value();
      reached_.in_world += o.in_world.has_value();
      EXPECT_EQ(o.box & cv::Rect(cv::Point(), size_), o.box);
      EXPECT_FALSE(o.box.empty());
      EXPECT_TRUE(o.mask.empty() || o.mask.size() == o.box.size());
      EXPECT_GE(o.depth_m, 0);
      EXPECT_TRUE(o.tracked_s >= o.unseen_s && o.unseen_s >= 0);
      for (const auto& state : {o.in_camera, o.in_world}) {
        if (!state) continue;
        EXPECT_TRUE(state->centroid_m.allFinite() && state->velocity_m_s.allFinite());
        EXPECT_TRUE(state->covariance.allFinite());
        EXPECT_GT(state->covariance.diagonal().minCoeff(), 0);
      }
    }
    std::sort(ids.begin(), ids.end());
    EXPECT_TRUE(std::adjacent_find(ids.begin(), ids.end()) == ids.end()) << "an id is one object";
  }

  void check_selections() {
    std::vector<cv::Point2f> points, before;
    for (int n = below(40); n > 0; --n) {
      const auto any = [this](int side) {
        return static_cast<float>(chance(0.1) ? number() : random_.uniform() * side);
      };
      points.emplace_back(any(size_.width), any(size_.height));
      before.emplace_back(any(size_.width), any(size_.height));
    }
    const Selection& selection =
        chance(0.5) ? front_end_->select(points) : front_end_->select_tracked(points, before);
    ASSERT_EQ(selection.size(), points.size());
    std::size_t kept = 0;
    for (std::size_t i = 0; i < selection.size(); ++i) {
      reached_.entering += selection.reason[i] == KeypointReason::kEntering;
      EXPECT_TRUE(selection.probability[i] >= 0 && selection.probability[i] <= 1);
      if (selection.is_kept(i)) {
        ASSERT_LT(kept, selection.kept.size());
        EXPECT_EQ(selection.kept[kept++], static_cast<int>(i));
      }
    }
    EXPECT_EQ(kept, selection.kept.size());
    EXPECT_EQ(front_end_->stats().kept, static_cast<int>(kept));
  }

  void check_functions(const RgbdFrame& frame) {
    const cv::Mat& mask = front_end_->mask().image;
    EXPECT_EQ(cv::countNonZero(feature_mask(mask, below(5)) & mask), 0);
    const cv::Mat probability = dynamic_probability(mask, static_cast<float>(below(20)));
    double least = 0, most = 0;
    cv::minMaxLoc(probability, &least, &most);
    EXPECT_TRUE(least >= 0 && most <= 1);
    if (!frame.depth.empty()) {
      EXPECT_EQ(cv::countNonZero((masked_depth(frame.depth, mask) != 0) & mask), 0);
    }
  }

  RandomGenerator random_;
  Reached& reached_;
  cv::Size size_;
  FrontEndSettings settings_;
  Camera camera_;
  std::optional<FrontEnd> front_end_;
  cv::Mat scene_;
  double now_ = 1;
  bool valid_ = true;  // the next frame keeps the rules
};

TEST(Fuzz, TheFrontEndKeepsItsPromises) {
  const long wanted = from_environment("STILLPOINT_FUZZ_FRAMES", 100000);
  const std::uint64_t first =
      static_cast<std::uint64_t>(from_environment("STILLPOINT_FUZZ_SEED", 1));
  cv::setNumThreads(1);
  Reached reached;
  std::uint64_t seed = first;
  for (; reached.frames < wanted; ++seed) {
    Fuzzer fuzzer(seed, reached);
    for (int i = fuzzer.frames(); i > 0 && reached.frames < wanted; --i) {
      fuzzer.step();
      if (reached.frames % 1000000 == 0) {  // an hour without a word looks like a hang
        std::printf("%ld of %ld frames, seed %llu\n", reached.frames, wanted,
                    static_cast<unsigned long long>(seed));
        std::fflush(stdout);
      }
    }
    if (::testing::Test::HasFailure()) break;
  }
  ASSERT_FALSE(::testing::Test::HasFailure())
      << "seed " << seed << "; STILLPOINT_FUZZ_SEED takes it";
  std::printf("%ld frames, %ld refused, %ld with a mask, %ld restored, %ld with movers\n",
              reached.frames, reached.refused, reached.masked, reached.restored, reached.moving);
  std::printf("%ld objects located, %ld in the world, %ld points entering\n", reached.located,
              reached.in_world, reached.entering);
  if (wanted < 10000) return;
  const auto some = [&](long n) { return n > wanted / 1000; };
  EXPECT_TRUE(some(reached.refused) && some(reached.masked) && some(reached.restored));
  EXPECT_TRUE(some(reached.moving) && some(reached.located) && some(reached.in_world));
  EXPECT_TRUE(some(reached.entering));
}

}  // namespace
}  // namespace stillpoint
