// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "stillpoint/backends/rgbd_slam/descriptor.hpp"
#include "stillpoint/backends/rgbd_slam/image_pyramid.hpp"
#include "stillpoint/backends/rgbd_slam/spread.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/mask_functions.hpp"

namespace stillpoint::rgbd_slam {

/// Keypoints (raw pixels of the full image, `octave` = pyramid level, `angle` in degrees) and one
/// descriptor for each.
struct Features {
  std::vector<cv::KeyPoint> keypoints;
  std::vector<Descriptor> descriptors;
};

/// The door for any extractor of 256-bit descriptors: cv::ORB, a network's binarised ones, ...
class FeatureExtractor {
 public:
  virtual ~FeatureExtractor() = default;
  /// Fills `features` from a grey image (CV_8UC1); `mask` (CV_8UC1, 255 = dynamic, may be empty)
  /// says where not to look. Called from one thread.
  virtual void extract(const cv::Mat& gray, const cv::Mat& mask, Features& features) = 0;
  /// Number of pyramid levels; `octave` of every keypoint is below it.
  virtual int levels() const = 0;
  /// Size ratio of neighboring levels, over 1. A keypoint's position error grows with it.
  virtual double scale_factor() const = 0;
};

/// ORB keypoints spread evenly over image and pyramid.
///
/// On each level of the pyramid FAST finds all corners, also weak ones. Of those outside the
/// dynamic mask the best of even cells are kept (`spread`), as many as the level's share of the
/// budget allows, and only these are described by cv::ORB. So all of the budget goes to the static
/// area; it grows with what the mask hides, and what a level can't spend goes on to the next.
/// Deterministic. One object serves one thread.
class OrbExtractor final : public FeatureExtractor {
 public:
  struct Settings {
    /// Keypoints per image, all levels together, if no mask hides anything.
    int features = 1000;
    /// A mask that hides a part of the image leaves fewer directions to tell the pose by: more
    /// keypoints in the rest make up for that. Their number is `features` divided by the square of
    /// the share that is left, but at most so many times `features`; 1: never more.
    double most_masked = 3;
    int levels = 8;
    double scale_factor = 1.2;
    /// FAST threshold, grey values.
    int fast_threshold = 7;
    /// Distance of a corner from the dynamic mask, in pixels: the FAST ring must not touch what
    /// moves.
    int mask_margin_px = 4;
  };

  OrbExtractor() : OrbExtractor(Settings()) {}

  /// Throws Error for settings that make no sense.
  explicit OrbExtractor(const Settings& settings) : settings_(settings) {
    const auto require = [](bool condition, const char* what, double found) {
      detail::check(condition, [&] {
        return "OrbExtractor settings: expected " + std::string(what) + ", found " +
               std::to_string(found);
      });
    };
    require(settings.features > 0, "features > 0", settings.features);
    require(settings.most_masked >= 1, "most_masked >= 1", settings.most_masked);
    require(settings.levels > 0 && settings.levels <= 16, "1 to 16 levels", settings.levels);
    require(settings.scale_factor > 1, "scale_factor > 1", settings.scale_factor);
    require(settings.fast_threshold > 0, "fast_threshold > 0", settings.fast_threshold);
    describer_ = cv::ORB::create(settings.features, 2.0f, 1, kBorder, 0, 2, cv::ORB::FAST_SCORE,
                                 2 * kRadius + 1);
  }

  int levels() const override { return settings_.levels; }
  double scale_factor() const override { return settings_.scale_factor; }

  void extract(const cv::Mat& gray, const cv::Mat& mask, Features& features) override {
    detail::check(gray.type() == CV_8UC1 && !gray.empty(), [&] {
      return "OrbExtractor::extract: expected a CV_8UC1 image, found " +
             stillpoint::detail::type_text(gray);
    });
    detail::check(mask.empty() || (mask.type() == CV_8UC1 && mask.size() == gray.size()), [&] {
      return "OrbExtractor::extract: expected a CV_8UC1 mask of " +
             stillpoint::detail::size_text(gray) + ", found " +
             stillpoint::detail::type_text(mask) + " " + stillpoint::detail::size_text(mask);
    });
    features.keypoints.clear();
    features.descriptors.clear();
    const cv::Mat allowed = static_part(mask);
    const double ratio = 1 / settings_.scale_factor;
    // Share of level 0 such that the geometric row over all levels sums to the whole budget.
    const double share = (1 - ratio) / (1 - std::pow(ratio, settings_.levels));
    const double wanted = wanted_under(mask);
    double budget = 0;
    pyramid_.build(gray, settings_.levels, settings_.scale_factor);
    for (int level = 0; level < pyramid_.levels(); ++level) {
      budget += wanted * share * std::pow(ratio, level);
      find_corners(pyramid_.image(level), allowed);
      spread(corners_, static_cast<int>(budget + 0.5), pyramid_.image(level).size());
      budget -= static_cast<double>(corners_.size());
      describe(level, features);
    }
  }

 private:
  // Of the described patch, and what keeps its rotated corners inside the image.
  static constexpr int kRadius = 15, kBorder = 19;

  // Keypoints to look for under this mask.
  double wanted_under(const cv::Mat& mask) const {
    if (mask.empty()) return settings_.features;
    const double left = 1 - cv::countNonZero(mask) / static_cast<double>(mask.total());
    const double most = settings_.most_masked;
    return settings_.features * (left * left * most > 1 ? 1 / (left * left) : most);
  }

  // 255 where to look; empty: everywhere.
  cv::Mat static_part(const cv::Mat& mask) const {
    return mask.empty() ? cv::Mat() : feature_mask(mask, settings_.mask_margin_px);
  }

  void find_corners(const cv::Mat& image, const cv::Mat& allowed) {
    cv::FAST(image, corners_, settings_.fast_threshold, true);
    cv::KeyPointsFilter::runByImageBorder(corners_, image.size(), kBorder);
    if (allowed.empty() || corners_.empty()) return;
    cv::resize(allowed, allowed_here_, image.size(), 0, 0, cv::INTER_NEAREST);
    cv::KeyPointsFilter::runByPixelsMask(corners_, allowed_here_);
  }

  void describe(int level, Features& features) {
    if (corners_.empty()) return;
    for (cv::KeyPoint& k : corners_) k.angle = orientation(pyramid_.image(level), k.pt);
    describer_->compute(pyramid_.image(level), corners_, rows_);
    for (const Descriptor& d : descriptors_from_rows(rows_)) features.descriptors.push_back(d);
    for (cv::KeyPoint k : corners_) {
      const Eigen::Vector2d p = pyramid_.from_level({k.pt.x, k.pt.y}, level);
      k.pt = cv::Point2f(static_cast<float>(p.x()), static_cast<float>(p.y()));
      k.octave = level;
      k.size = static_cast<float>((2 * kRadius + 1) * pyramid_.scale(level));
      features.keypoints.push_back(k);
    }
  }

  // Direction from a corner to the centroid of brightness around it, degrees.
  static float orientation(const cv::Mat& image, cv::Point2f corner) {
    int by_x = 0, by_y = 0;
    for (int v = -kRadius; v <= kRadius; ++v) {
      const int width = cvRound(std::sqrt(kRadius * kRadius - v * v));
      const uchar* pixel = image.ptr<uchar>(cvRound(corner.y) + v) + cvRound(corner.x);
      int sum = 0;
      for (int u = -width; u <= width; ++u) sum += pixel[u], by_x += u * pixel[u];
      by_y += v * sum;
    }
    return cv::fastAtan2(static_cast<float>(by_y), static_cast<float>(by_x));
  }

  Settings settings_;
  cv::Ptr<cv::ORB> describer_;
  ImagePyramid pyramid_;
  cv::Mat allowed_here_, rows_;
  std::vector<cv::KeyPoint> corners_;
};

}  // namespace stillpoint::rgbd_slam
