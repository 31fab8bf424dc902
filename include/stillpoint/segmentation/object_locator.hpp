// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/segmentation/remembered_object.hpp"
#include "stillpoint/segmentation/segmentation_compensator_settings.hpp"

namespace stillpoint {

/// Looks for a remembered object near its predicted place, by the depth of its pixels and of those
/// around it, or by template matching where depth cannot tell.
class ObjectLocator {
 public:
  explicit ObjectLocator(const SegmentationCompensatorSettings& settings) : settings_(settings) {}

  /// Moves the object's prediction to where it is found; false if it is not there (any more).
  /// O(search places x 400 points).
  bool locate(const RgbdFrame& frame, RememberedObject& object) const {
    if (share_in_picture(frame, object) < 0.15) return false;
    if (settings_.use_depth && !frame.depth.empty() && object.depth_m() > 0) {
      align_by_depth(frame, object);
      const Support s = support(frame, object, {0, 0});
      if (s.measured >= 12)
        return s.agree >= settings_.min_depth_support * static_cast<double>(s.measured);
    }
    if (object.patch().empty()) return true;
    const auto corner = object.predicted(
        {static_cast<float>(object.box().x), static_cast<float>(object.box().y), 0});
    const cv::Point start(static_cast<int>(std::lround(corner.x)),
                          static_cast<int>(std::lround(corner.y)));
    cv::Point found = start;
    if (object.patch().locate(frame.color, settings_.search_px, found) <
        settings_.min_template_score)
      return false;
    // The paper copies the mask to the predicted corner; the match only says that it is there.
    if (settings_.use_depth) object.shift_prediction(found - start);
    return true;
  }

  /// Share of the object's predicted pixels that no instance covers although, as far as the depth
  /// can tell, the object is there.
  double missing_share(const RgbdFrame& frame, const RememberedObject& object,
                       const std::vector<Instance>& instances, std::size_t count) const {
    std::size_t total = 0, missing = 0;
    const bool use_depth = settings_.use_depth && !frame.depth.empty() && object.depth_m() > 0;
    for (const auto& point : object.inside()) {
      const auto p = object.predicted(point);
      const int x = static_cast<int>(std::floor(p.x + 0.5f)),
                y = static_cast<int>(std::floor(p.y + 0.5f));
      if (x < 0 || y < 0 || x >= frame.color.cols || y >= frame.color.rows) continue;
      ++total;
      bool covered = false;
      for (std::size_t i = 0; i < count && !covered; ++i) {
        const Instance& s = instances[i];
        covered = s.box.contains({x, y}) &&
                  (s.mask.empty() || s.mask.ptr<uchar>(y - s.box.y)[x - s.box.x]);
      }
      if (covered) continue;
      if (use_depth) {
        const float z = depth_m_at(frame, x, y);
        if (z == 0 || std::abs(z - p.z) > tolerance(p.z)) continue;
      }
      ++missing;
    }
    return total == 0 ? 0 : static_cast<double>(missing) / static_cast<double>(total);
  }

 private:
  struct Support {
    int agree = 0, measured = 0;
    int score = 0;
  };

  static float tolerance(float z) { return 0.15f + 0.03f * z; }

  static double share_in_picture(const RgbdFrame& frame, const RememberedObject& object) {
    std::size_t in = 0;
    for (const auto& point : object.inside()) {
      const auto p = object.predicted(point);
      in += p.x >= 0 && p.y >= 0 && p.x < static_cast<float>(frame.color.cols) &&
            p.y < static_cast<float>(frame.color.rows);
    }
    return object.inside().empty()
               ? 0
               : static_cast<double>(in) / static_cast<double>(object.inside().size());
  }

  Support support(const RgbdFrame& frame, const RememberedObject& object,
                  const cv::Point& shift) const {
    Support s;
    const auto depth_at = [&](const RememberedObject::Point& p) {
      const int x = static_cast<int>(std::floor(p.x + 0.5f)) + shift.x;
      const int y = static_cast<int>(std::floor(p.y + 0.5f)) + shift.y;
      return x >= 0 && y >= 0 && x < frame.depth.cols && y < frame.depth.rows
                 ? depth_m_at(frame, x, y)
                 : 0.0f;
    };
    for (const auto& point : object.inside()) {
      const auto p = object.predicted(point);
      const float z = depth_at(p);
      if (z == 0) continue;
      ++s.measured;
      s.agree += std::abs(z - p.z) < tolerance(p.z);
    }
    int ring = 0;
    for (const auto& point : object.ring()) {
      const auto p = object.predicted(point);
      const float z = depth_at(p);
      ring += z > 0 && std::abs(z - object.predicted_depth_m()) < tolerance(z);
    }
    s.score = s.agree - ring;
    return s;
  }

  // Coarse to fine over the shifts; of equal scores the nearest to the prediction wins.
  void align_by_depth(const RgbdFrame& frame, RememberedObject& object) const {
    cv::Point best(0, 0);
    int best_score = support(frame, object, best).score;
    for (int step = std::max(1, settings_.search_px / 3), first = step; step >= 2; step /= 2) {
      const cv::Point center = best;
      const int reach = step == first ? settings_.search_px / step : 1;
      for (int y = -reach; y <= reach; ++y)
        for (int x = -reach; x <= reach; ++x) {
          if (x == 0 && y == 0) continue;
          const cv::Point shift = center + cv::Point(x * step, y * step);
          const int score = support(frame, object, shift).score;
          // A far shift must earn its distance.
          const auto cost = [](const cv::Point& s) { return (std::abs(s.x) + std::abs(s.y)) / 4; };
          if (score - cost(shift) > best_score - cost(best)) best = shift, best_score = score;
        }
    }
    object.shift_prediction(best);
  }

  SegmentationCompensatorSettings settings_;
};

}  // namespace stillpoint
