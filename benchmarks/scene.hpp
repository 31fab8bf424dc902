// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/random.hpp"
#include "stillpoint/testing/degraded_masks.hpp"
#include "synthetic/sequence.hpp"

namespace stillpoint {
namespace bench {

/// Consecutive frames with what a front end is given with them: by a host that has the grey image,
/// as ORB keypoints are extracted from that.
struct Scene {
  Camera camera;
  std::vector<RgbdFrame> frames;
  std::vector<Segmentation> segmentations;
  std::vector<std::vector<cv::KeyPoint>> keypoints;
  /// Mean share of the image in the segmentations.
  double mask_share = 0;
};

/// Plays a scene forwards and backwards without end, with increasing timestamps, so that people
/// move steadily and never jump.
class Player {
 public:
  explicit Player(const Scene& scene) : scene_(scene) {}

  /// The next frame: O(1).
  const RgbdFrame& next() {
    index_ = index_at(scene_, step_++);
    frame_ = scene_.frames[index_];
    frame_.timestamp = 1.3e9 + static_cast<double>(step_) / 30;
    segmentation_ = scene_.segmentations[index_];
    segmentation_.timestamp = frame_.timestamp;
    return frame_;
  }
  /// Which frame of the scene comes at a step, the first of which is 0.
  static std::size_t index_at(const Scene& scene, std::size_t step) {
    const std::size_t n = scene.frames.size(), period = n > 1 ? 2 * n - 2 : 1;
    const std::size_t at = step % period;
    return at < n ? at : period - at;
  }
  std::size_t index() const { return index_; }
  const Segmentation& segmentation() const { return segmentation_; }
  const std::vector<cv::KeyPoint>& keypoints() const { return scene_.keypoints[index_]; }

 private:
  const Scene& scene_;
  std::size_t step_ = 0, index_ = 0;
  RgbdFrame frame_;
  Segmentation segmentation_;
};

/// What the extraction of 3000 ORB keypoints in the rendered scene takes; for shares. A machine's
/// speed changes within a second, so extract() is called in between what is measured.
class OrbYardstick {
 public:
  OrbYardstick();
  /// Extracts once.
  void extract();
  /// CPU seconds of an extraction, the mean of all.
  double seconds() const;

 private:
  cv::Ptr<cv::ORB> orb_;
  std::vector<cv::KeyPoint> keypoints_;
  cv::Mat descriptors_;
  std::clock_t taken_ = 0;
  std::size_t times_ = 0;
};

inline std::vector<Instance> instances_of(const cv::Mat& labels) {
  std::vector<Instance> instances;
  double most = 0;
  cv::minMaxLoc(labels, nullptr, &most);
  for (int label = 1; label <= static_cast<int>(most); ++label) {
    Instance instance = instance_from_mask(labels == label);
    if (!instance.box.empty()) instances.push_back(instance);
  }
  return instances;
}

inline double share_of(const std::vector<Segmentation>& all, const cv::Size& size) {
  double sum = 0;
  for (const Segmentation& s : all)
    for (const Instance& i : s.instances)
      sum += cv::countNonZero(i.mask) / static_cast<double>(size.area());
  return all.empty() ? 0 : sum / static_cast<double>(all.size());
}

/// The first of 8 frames of a sequence in which two people are in view and cover most nearly a
/// quarter of the image; looked for in tiny images.
inline int quarter_covered(SyntheticSettings settings) {
  settings.width = 80, settings.height = 60, settings.shutter_s = 0;
  const SyntheticSequence tiny(settings);
  std::vector<double> people[2];
  for (int i = 0; i < tiny.frame_count(); ++i) {
    const cv::Mat labels = tiny.frame(i).labels;
    for (int k : {0, 1})
      people[k].push_back(cv::countNonZero(labels == k + 1) / static_cast<double>(labels.total()));
  }
  int best = 0;
  double best_miss = 2;
  for (std::size_t i = 0; i + 8 <= people[0].size(); ++i) {
    double cover = 0, least = 1;
    for (std::size_t j = i; j < i + 8; ++j) {
      cover += (people[0][j] + people[1][j]) / 8;
      least = std::min({least, people[0][j], people[1][j]});
    }
    const double miss = std::abs(cover - 0.25) + (least < 0.03 ? 1 : 0);
    if (miss < best_miss) best = static_cast<int>(i), best_miss = miss;
  }
  return best;
}

/// 8 consecutive rendered frames, 640 x 480: two walking people who cover about a quarter of the
/// image, camera motion xyz, masks damaged by blur as a segmenter's are, 3000 ORB keypoints.
/// Rendered once.
inline const Scene& rendered_scene() {
  static const Scene scene = [] {
    cv::setNumThreads(1);
    SyntheticSettings settings;
    settings.frames = 150;
    const SyntheticSequence sequence(settings);
    Scene s;
    s.camera = sequence.camera();
    const cv::Ptr<cv::ORB> orb = cv::ORB::create(3000);
    const int first = quarter_covered(settings);
    for (int i = first; i < first + 8; ++i) {
      const SyntheticFrame rendered = sequence.frame(i);
      RgbdFrame frame = sequence.rgbd(rendered);
      cv::cvtColor(frame.color, frame.gray, cv::COLOR_BGR2GRAY);
      s.frames.push_back(frame);
      Segmentation segmentation;
      segmentation.available = true;
      segmentation.timestamp = frame.timestamp;
      segmentation.instances =
          instances_of(degrade_masks(rendered.labels, rendered.limbs, i, [&](int label, int k) {
            return sequence.expected_blur_px(label, k);
          }));
      s.segmentations.push_back(segmentation);
      s.keypoints.emplace_back();
      orb->detect(frame.gray, s.keypoints.back());
    }
    s.mask_share = share_of(s.segmentations, s.frames[0].color.size());
    return s;
  }();
  return scene;
}

/// The rendered scene at another size of image; keypoints move along.
inline Scene scaled_scene(const cv::Size& size) {
  const Scene& from = rendered_scene();
  Scene s;
  const double fx = static_cast<double>(size.width) / from.camera.width;
  const double fy = static_cast<double>(size.height) / from.camera.height;
  s.camera = from.camera;
  s.camera.width = size.width, s.camera.height = size.height;
  s.camera.fx *= fx, s.camera.cx = (s.camera.cx + 0.5) * fx - 0.5;
  s.camera.fy *= fy, s.camera.cy = (s.camera.cy + 0.5) * fy - 0.5;
  for (std::size_t i = 0; i < from.frames.size(); ++i) {
    RgbdFrame frame = from.frames[i];
    frame.color = frame.gray = frame.depth = cv::Mat();
    cv::resize(from.frames[i].color, frame.color, size);
    cv::resize(from.frames[i].gray, frame.gray, size);
    cv::resize(from.frames[i].depth, frame.depth, size, 0, 0, cv::INTER_NEAREST);
    s.frames.push_back(frame);
    Segmentation segmentation = from.segmentations[i];
    segmentation.instances.clear();
    for (const Instance& instance : from.segmentations[i].instances) {
      cv::Mat whole = cv::Mat::zeros(from.frames[i].color.size(), CV_8UC1), scaled;
      instance.mask.copyTo(whole(instance.box));
      cv::resize(whole, scaled, size, 0, 0, cv::INTER_NEAREST);
      segmentation.instances.push_back(instance_from_mask(scaled));
    }
    s.segmentations.push_back(segmentation);
    s.keypoints.push_back(from.keypoints[i]);
    for (cv::KeyPoint& k : s.keypoints.back())
      k.pt.x *= static_cast<float>(fx), k.pt.y *= static_cast<float>(fy);
  }
  s.mask_share = share_of(s.segmentations, size);
  return s;
}

/// `n` keypoints spread evenly over an image.
inline std::vector<cv::KeyPoint> even_keypoints(std::size_t n, const cv::Size& size,
                                                std::uint64_t seed) {
  RandomGenerator random(seed);
  std::vector<cv::KeyPoint> keypoints;
  for (std::size_t k = 0; k < n; ++k)
    keypoints.emplace_back(static_cast<float>(random.uniform() * (size.width - 1)),
                           static_cast<float>(random.uniform() * (size.height - 1)), 31.0f);
  return keypoints;
}

/// 1 to 20 people of 26 x 100 pixels, side by side before a wall, who step to the right; 640 x 480.
/// Each costs the same, so that cost per person shows.
inline Scene crowd_scene(int people) {
  Scene s;
  s.camera = rendered_scene().camera;
  const cv::Size size(s.camera.width, s.camera.height);
  for (int i = 0; i < 8; ++i) {
    RgbdFrame frame;
    frame.color = rendered_scene().frames[0].color;
    frame.gray = rendered_scene().frames[0].gray;
    frame.depth.create(size, CV_16UC1);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x)
        frame.depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(22500 + x % 16 + y % 8);
    Segmentation segmentation;
    segmentation.available = true;
    for (int p = 0; p < people; ++p) {
      const cv::Rect box(10 + 62 * (p % 10) + 2 * i, 40 + 220 * (p / 10), 26, 100);
      frame.depth(box).setTo(13000 + 100 * p);
      Instance instance;
      instance.box = box;
      instance.mask = cv::Mat(box.size(), CV_8UC1, cv::Scalar(255));
      segmentation.instances.push_back(instance);
    }
    s.frames.push_back(frame);
    s.segmentations.push_back(segmentation);
    s.keypoints.push_back(even_keypoints(3000, size, static_cast<std::uint64_t>(i)));
  }
  s.mask_share = share_of(s.segmentations, size);
  return s;
}

/// Sizes of image over which cost in pixels is shown.
inline const std::vector<cv::Size>& image_sizes() {
  static const std::vector<cv::Size> sizes{{320, 240}, {640, 480}, {1280, 960}, {1920, 1080}};
  return sizes;
}
inline const std::vector<int>& keypoint_counts() {
  static const std::vector<int> counts{500, 1000, 3000, 10000, 20000};
  return counts;
}
inline const std::vector<int>& people_counts() {
  static const std::vector<int> counts{1, 2, 5, 10, 20};
  return counts;
}

}  // namespace bench
}  // namespace stillpoint
