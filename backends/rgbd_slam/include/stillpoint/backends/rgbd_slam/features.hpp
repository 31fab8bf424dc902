// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
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
/// On each level of the pyramid FAST corners are found with a threshold that falls in the cells
/// where nothing stands out. Those on or at the rim of the dynamic mask are dropped *before* the
/// level's budget is spent, so that all of it goes to the static area, and the budget grows with
/// what the mask hides; what a level can't spend goes on to the next. The best corners of even
/// cells are kept (`spread`), rotated by their intensity centroid and described by cv::ORB.
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
    /// FAST threshold (grey values), and the one for cells without any corner.
    int fast_threshold = 20;
    int min_fast_threshold = 7;
    /// Side of the cells of the adaptive threshold, in pixels of the level.
    int cell_px = 32;
    /// Distance of a corner from the dynamic mask, in pixels of the level: the FAST ring must not
    /// touch what moves.
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
    require(settings.min_fast_threshold > 0, "min_fast_threshold > 0", settings.min_fast_threshold);
    require(settings.cell_px >= 8, "cell_px >= 8", settings.cell_px);
    describer_ = cv::ORB::create(settings.features, 2.0f, 1, kBorder, 0, 2, cv::ORB::HARRIS_SCORE,
                                 2 * kRadius + 1);
    for (int v = 0; v <= kRadius; ++v)
      half_width_[static_cast<std::size_t>(v)] =
          static_cast<int>(std::lround(std::sqrt(static_cast<double>(kRadius * kRadius - v * v))));
  }

  int levels() const override { return settings_.levels; }
  double scale_factor() const override { return settings_.scale_factor; }
  const Settings& settings() const { return settings_; }

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
    const double ratio = 1 / settings_.scale_factor;
    // Share of level 0 such that the geometric row over all levels sums to the whole budget.
    const double share = (1 - ratio) / (1 - std::pow(ratio, settings_.levels));
    const double wanted = wanted_under(mask);
    double budget = 0;
    pyramid_.build(gray, settings_.levels, settings_.scale_factor, 2 * kBorder + 1);
    for (int level = 0; level < pyramid_.levels(); ++level) {
      const cv::Mat& image = pyramid_.image(level);
      if (std::min(image.cols, image.rows) <= 2 * kBorder) break;
      budget += wanted * share * std::pow(ratio, level);
      shrink_mask(mask, image.size());
      detect(image);
      spread(corners_, static_cast<int>(budget + 0.5), image.size());
      budget -= static_cast<double>(corners_.size());
      for (cv::KeyPoint& k : corners_) k.angle = orientation(image, k.pt);
      append(level, features);
    }
  }

 private:
  // Radius of the described patch, and the border that keeps its rotated corners inside.
  static constexpr int kRadius = 15;
  static constexpr int kBorder = 19;

  // Keypoints to look for under this mask.
  double wanted_under(const cv::Mat& mask) const {
    if (mask.empty()) return settings_.features;
    const double left = 1 - cv::countNonZero(mask) / static_cast<double>(mask.total());
    const double most = settings_.most_masked;
    return settings_.features * (left * left * most > 1 ? 1 / (left * left) : most);
  }

  void shrink_mask(const cv::Mat& mask, cv::Size size) {
    level_mask_.release();
    if (mask.empty()) return;
    cv::resize(mask, level_mask_, size, 0, 0, cv::INTER_NEAREST);
    if (settings_.mask_margin_px <= 0) return;
    const int side = 2 * settings_.mask_margin_px + 1;
    cv::dilate(level_mask_, level_mask_, cv::Mat::ones(side, side, CV_8UC1));
  }

  bool usable(cv::Point2f p, cv::Size size) const {
    if (p.x < kBorder || p.y < kBorder || p.x >= static_cast<float>(size.width - kBorder) ||
        p.y >= static_cast<float>(size.height - kBorder))
      return false;
    return level_mask_.empty() ||
           level_mask_.at<uchar>(static_cast<int>(p.y), static_cast<int>(p.x)) == 0;
  }

  void detect(const cv::Mat& image) {
    const int cell = settings_.cell_px;
    const int columns = (image.cols + cell - 1) / cell, rows = (image.rows + cell - 1) / cell;
    occupied_.assign(static_cast<std::size_t>(columns * rows), 0);
    const auto cell_of = [&](cv::Point2f p) {
      return static_cast<std::size_t>(static_cast<int>(p.y) / cell * columns +
                                      static_cast<int>(p.x) / cell);
    };
    corners_.clear();
    cv::FAST(image, found_, settings_.fast_threshold, true);
    for (const cv::KeyPoint& k : found_) {
      if (!usable(k.pt, image.size())) continue;
      corners_.push_back(k);
      occupied_[cell_of(k.pt)] = 1;
    }
    if (settings_.min_fast_threshold >= settings_.fast_threshold) return;
    const cv::Rect inner(kBorder, kBorder, image.cols - 2 * kBorder, image.rows - 2 * kBorder);
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c) {
        if (occupied_[static_cast<std::size_t>(r * columns + c)]) continue;
        cv::Rect area = cv::Rect(c * cell, r * cell, cell, cell) & inner;
        if (area.empty()) continue;
        if (!level_mask_.empty() && cv::countNonZero(level_mask_(area)) == area.area()) continue;
        // FAST leaves a rim of three pixels, and one more decides about the strongest in place.
        area = cv::Rect(area.x - 4, area.y - 4, area.width + 8, area.height + 8);
        cv::FAST(image(area), found_, settings_.min_fast_threshold, true);
        for (cv::KeyPoint k : found_) {
          k.pt += cv::Point2f(static_cast<float>(area.x), static_cast<float>(area.y));
          if (usable(k.pt, image.size()) &&
              cell_of(k.pt) == static_cast<std::size_t>(r * columns + c))
            corners_.push_back(k);
        }
      }
  }

  // Direction from the patch's middle to its intensity centroid, degrees.
  float orientation(const cv::Mat& image, cv::Point2f p) const {
    const int x = static_cast<int>(p.x + 0.5f), y = static_cast<int>(p.y + 0.5f);
    int m01 = 0, m10 = 0;
    const auto step = static_cast<std::ptrdiff_t>(image.step);
    const uchar* middle = image.ptr<uchar>(y) + x;
    for (int u = -kRadius; u <= kRadius; ++u) m10 += u * middle[u];
    for (int v = 1; v <= kRadius; ++v) {
      const uchar *above = middle - v * step, *below = middle + v * step;
      int difference = 0;
      const int width = half_width_[static_cast<std::size_t>(v)];
      for (int u = -width; u <= width; ++u) {
        difference += below[u] - above[u];
        m10 += u * (below[u] + above[u]);
      }
      m01 += v * difference;
    }
    return cv::fastAtan2(static_cast<float>(m01), static_cast<float>(m10));
  }

  void append(int level, Features& features) {
    if (corners_.empty()) return;
    for (cv::KeyPoint& k : corners_) k.octave = 0;
    describer_->compute(pyramid_.image(level), corners_, rows_);
    const std::vector<Descriptor> described = descriptors_from_rows(rows_);
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      cv::KeyPoint k = corners_[i];
      const Eigen::Vector2d p = pyramid_.from_level({k.pt.x, k.pt.y}, level);
      k.pt = cv::Point2f(static_cast<float>(p.x()), static_cast<float>(p.y()));
      k.octave = level;
      k.size = static_cast<float>((2 * kRadius + 1) * pyramid_.scale(level));
      k.class_id = -1;
      features.keypoints.push_back(k);
      features.descriptors.push_back(described[i]);
    }
  }

  Settings settings_;
  cv::Ptr<cv::ORB> describer_;
  std::array<int, kRadius + 1> half_width_{};
  ImagePyramid pyramid_;
  cv::Mat level_mask_, rows_;
  std::vector<cv::KeyPoint> found_, corners_;
  std::vector<char> occupied_;
};

}  // namespace stillpoint::rgbd_slam
