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
#include "stillpoint/backends/rgbd_slam/spread.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"

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
/// cv::ORB finds all corners outside the dynamic mask, also weak ones. On each level of the pyramid
/// the best of even cells are kept (`spread`), as many as the level's share of the budget allows.
/// So all of the budget goes to the static area; it grows with what the mask hides, and what a
/// level can't spend goes on to the next. Deterministic. One object serves one thread.
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
    orb_ = cv::ORB::create(kAllCorners, static_cast<float>(settings.scale_factor), settings.levels,
                           kBorder, 0, 2, cv::ORB::FAST_SCORE, 31, settings.fast_threshold);
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
    if (std::min(gray.cols, gray.rows) <= 2 * kBorder) return;
    orb_->detect(gray, corners_, static_part(mask));
    const double ratio = 1 / settings_.scale_factor;
    // Share of level 0 such that the geometric row over all levels sums to the whole budget.
    const double share = (1 - ratio) / (1 - std::pow(ratio, settings_.levels));
    const double wanted = wanted_under(mask);
    double budget = 0;
    for (int level = 0; level < settings_.levels; ++level) {
      budget += wanted * share * std::pow(ratio, level);
      level_.clear();
      for (const cv::KeyPoint& k : corners_)
        if (k.octave == level) level_.push_back(k);
      spread(level_, static_cast<int>(budget + 0.5), gray.size());
      budget -= static_cast<double>(level_.size());
      features.keypoints.insert(features.keypoints.end(), level_.begin(), level_.end());
    }
    orb_->compute(gray, features.keypoints, rows_);
    features.descriptors = descriptors_from_rows(rows_);
    for (cv::KeyPoint& k : features.keypoints) k.pt = in_image(k, gray.size());
  }

 private:
  static constexpr int kAllCorners = 1000000;
  // Keeps the rotated corners of the described patch inside.
  static constexpr int kBorder = 19;

  // Keypoints to look for under this mask.
  double wanted_under(const cv::Mat& mask) const {
    if (mask.empty()) return settings_.features;
    const double left = 1 - cv::countNonZero(mask) / static_cast<double>(mask.total());
    const double most = settings_.most_masked;
    return settings_.features * (left * left * most > 1 ? 1 / (left * left) : most);
  }

  // 255 where to look; empty: everywhere.
  cv::Mat static_part(const cv::Mat& mask) const {
    if (mask.empty()) return cv::Mat();
    const int side = 2 * settings_.mask_margin_px + 1;
    cv::Mat dilated;
    cv::dilate(mask, dilated, cv::Mat::ones(side, side, CV_8UC1));
    return dilated == 0;
  }

  // cv::ORB multiplies a pixel of a level by its scale. But the level's size is rounded, and the
  // centres of pixels are at whole numbers.
  cv::Point2f in_image(const cv::KeyPoint& k, cv::Size size) const {
    const double scale = std::pow(settings_.scale_factor, k.octave);
    const auto place = [&](float p, int whole) {
      return static_cast<float>((p / scale + 0.5) * whole / cvRound(whole / scale) - 0.5);
    };
    return {place(k.pt.x, size.width), place(k.pt.y, size.height)};
  }

  Settings settings_;
  cv::Ptr<cv::ORB> orb_;
  cv::Mat rows_;
  std::vector<cv::KeyPoint> corners_, level_;
};

}  // namespace stillpoint::rgbd_slam
