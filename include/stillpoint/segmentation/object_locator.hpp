// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/image_scale.hpp"
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
  /// `depth` may be empty. O(search places x 300 points).
  bool locate(const FrameContext& context, const DepthView& depth, RememberedObject& object) {
    if (share_in_image(object, context.size()) < 0.15) return false;
    if (!depth.empty() && object.depth_m() > 0) {
      align_by_depth(depth, object);
      const Support s = support(depth, {0, 0});
      if (s.measured >= kFewestMeasured)
        return s.agree >= settings_.min_depth_support * static_cast<double>(s.measured);
    }
    // What has no name was found by its depth: where that shows nothing of it, it is gone.
    if (object.class_name.empty() && !depth.empty()) return false;
    if (object.patch().empty()) return true;
    const auto corner = object.predicted(
        {static_cast<float>(object.box().x), static_cast<float>(object.box().y), 0});
    const cv::Point start(round(corner.x), round(corner.y));
    cv::Point found = start;
    if (object.patch().locate(context.gray(), scaled_px(settings_.search_px, context.size()),
                              found) < settings_.min_template_score)
      return false;
    // The paper copies the mask to the predicted corner; the match only says that it is there.
    if (settings_.use_depth) object.shift_prediction(found - start);
    return true;
  }

  /// locate() for an object that may have gone far, by depth only: looks everywhere within
  /// `reach_px` to the sides (a third of it up and down) first. `depth` is not empty.
  /// O(search places x 300 points).
  bool locate_far(const DepthView& depth, int reach_px, RememberedObject& object) {
    set_probes(depth, object);
    const int step = scaled_px(kFarStepPx, depth.size()),
              price = scaled_px(kFarPricePx, depth.size());
    cv::Point start(0, 0);
    int best = support(depth, start).score;
    for (int y = -reach_px / 3 / step; y <= reach_px / 3 / step; ++y)
      for (int x = -reach_px / step; x <= reach_px / step; ++x) {
        const cv::Point shift(x * step, y * step);
        const int score =
            support(depth, shift).score - (std::abs(shift.x) + std::abs(shift.y)) / price;
        if (score > best) best = score, start = shift;
      }
    object.shift_prediction(start);
    align_by_depth(depth, object);
    const Support s = support(depth, {0, 0});
    return s.measured >= kFewestMeasured &&
           s.agree >= settings_.min_depth_support * static_cast<double>(s.measured);
  }

  /// Whether depth measures too little of an object at its predicted place to tell anything.
  bool is_unmeasured(const DepthView& depth, const RememberedObject& object) {
    set_probes(depth, object);
    return support(depth, {0, 0}).measured < kFewestMeasured;
  }

  /// Moves the prediction of an object onto what `seen` shows of it, for use where depth cannot
  /// tell: else its parts that are merely predicted beside it would be taken for missing.
  /// O(search places x 300 points).
  void align_to(const Instance& seen, const cv::Size& size, RememberedObject& object) const {
    object.shift_prediction(best_shift(size, [&](const cv::Point& shift) {
      const auto covered = [&](const RememberedObject::Point& point, int& in_image) {
        const auto p = object.predicted(point);
        const cv::Point at = cv::Point(round(p.x), round(p.y)) + shift;
        in_image += at.x >= 0 && at.y >= 0 && at.x < size.width && at.y < size.height;
        return covers(seen, at.x, at.y) ? 1 : 0;
      };
      int score = 0, in_image = 0, ignored = 0;
      for (const auto& point : object.inside()) score += 2 * covered(point, in_image);
      for (const auto& point : object.ring()) score -= covered(point, ignored);
      return score - in_image;
    }));
  }

  /// Share of the object's predicted pixels that the instance holds.
  double share_in(const RememberedObject& object, const Instance& instance) const {
    int held = 0;
    for (const auto& point : object.inside()) {
      const auto p = object.predicted(point);
      held += covers(instance, round(p.x), round(p.y));
    }
    return object.inside().empty()
               ? 0
               : static_cast<double>(held) / static_cast<double>(object.inside().size());
  }

  /// Share of the object's predicted pixels in the image that none of the first `count` instances
  /// covers although, as far as the depth can tell, the object is there.
  double missing_share(const DepthView& depth, const cv::Size& size, const RememberedObject& object,
                       const std::vector<Instance>& instances, std::size_t count) const {
    std::size_t total = 0, missing = 0;
    const bool use_depth = !depth.empty() && object.measurable();
    for (const auto& point : object.inside()) {
      const auto p = object.predicted(point);
      const int x = round(p.x), y = round(p.y);
      if (x < 0 || y < 0 || x >= size.width || y >= size.height) continue;
      ++total;
      bool covered = false;
      for (std::size_t i = 0; i < count && !covered; ++i) covered = covers(instances[i], x, y);
      if (covered) continue;
      if (use_depth) {
        const std::uint16_t z = depth.row(y)[x];
        if (z == 0 || std::abs(depth.to_m(z) - p.z) > tolerance(p.z)) continue;
      }
      ++missing;
    }
    return total == 0 ? 0 : static_cast<double>(missing) / static_cast<double>(total);
  }

 private:
  // In an image 640 wide: from place to place of a far search, and what costs one of 300 points.
  static constexpr int kFarStepPx = 16, kFarPricePx = 8;
  static constexpr int kFewestMeasured = 12;  // pixels of an object by which depth tells

  struct Support {
    int agree = 0, measured = 0;
    int score = 0;
  };
  // A predicted pixel and the units of depth that speak for the object there.
  struct Probe {
    int x, y;
    std::uint16_t lo, span;
  };

  // Predictions may lie anywhere.
  static int round(float v) {
    return static_cast<int>(std::floor(std::min(1e6f, std::max(-1e6f, v)) + 0.5f));
  }
  static float tolerance(float z) { return 0.15f + 0.03f * z; }

  static bool covers(const Instance& s, int x, int y) {
    const int u = x - s.box.x, v = y - s.box.y;
    return u >= 0 && v >= 0 && u < s.box.width && v < s.box.height &&
           (s.mask.data == nullptr || s.mask.ptr<uchar>(v)[u] != 0);
  }

  static double share_in_image(const RememberedObject& object, const cv::Size& size) {
    std::size_t in = 0;
    for (const auto& point : object.inside()) {
      const auto p = object.predicted(point);
      in += p.x >= 0 && p.y >= 0 && p.x < static_cast<float>(size.width) &&
            p.y < static_cast<float>(size.height);
    }
    return object.inside().empty()
               ? 0
               : static_cast<double>(in) / static_cast<double>(object.inside().size());
  }

  static Probe make_probe(const DepthView& depth, const RememberedObject::Point& p, float z) {
    const float slack = tolerance(z);
    const int lo = std::max(1, depth.first_units(z - slack));
    return {round(p.x), round(p.y), static_cast<std::uint16_t>(lo),
            static_cast<std::uint16_t>(std::max(0, depth.last_units(z + slack) - lo))};
  }

  Support support(const DepthView& depth, const cv::Point& shift) const {
    Support s;
    const unsigned width = static_cast<unsigned>(depth.size().width);
    const unsigned height = static_cast<unsigned>(depth.size().height);
    for (const Probe& p : inside_) {
      const unsigned x = static_cast<unsigned>(p.x + shift.x),
                     y = static_cast<unsigned>(p.y + shift.y);
      if (x >= width || y >= height) continue;
      const std::uint16_t z = depth.row(static_cast<int>(y))[x];
      s.measured += z != 0;
      s.agree += static_cast<std::uint16_t>(z - p.lo) <= p.span;
    }
    int ring = 0;
    for (const Probe& p : ring_) {
      const unsigned x = static_cast<unsigned>(p.x + shift.x),
                     y = static_cast<unsigned>(p.y + shift.y);
      if (x >= width || y >= height) continue;
      ring += static_cast<std::uint16_t>(depth.row(static_cast<int>(y))[x] - p.lo) <= p.span;
    }
    // Pixels beyond the border speak neither for nor against a place.
    s.score = 2 * s.agree - s.measured - ring;
    return s;
  }

  // Coarse to fine over the shifts; of equal scores the nearest to the prediction wins.
  template <class Score>
  cv::Point best_shift(const cv::Size& size, Score&& score_at) const {
    const int search_px = scaled_px(settings_.search_px, size);
    cv::Point best(0, 0);
    int best_score = score_at(best);
    const auto cost = [](const cv::Point& s) { return (std::abs(s.x) + std::abs(s.y)) / 4; };
    for (int step = std::max(1, search_px / 3), first = step; step >= 2; step /= 2) {
      const cv::Point center = best;
      const int reach = step == first ? search_px / step : 1;
      for (int y = -reach; y <= reach; ++y)
        for (int x = -reach; x <= reach; ++x) {
          if (x == 0 && y == 0) continue;
          const cv::Point shift = center + cv::Point(x * step, y * step);
          const int score = score_at(shift);
          // A far shift must earn its distance.
          if (score - cost(shift) > best_score - cost(best)) best = shift, best_score = score;
        }
    }
    return best;
  }

  void set_probes(const DepthView& depth, const RememberedObject& object) {
    inside_.clear(), ring_.clear();
    for (const auto& point : object.inside()) {
      const auto p = object.predicted(point);
      inside_.push_back(make_probe(depth, p, p.z));
    }
    for (const auto& point : object.ring())
      ring_.push_back(make_probe(depth, object.predicted(point), object.predicted_depth_m()));
  }

  void align_by_depth(const DepthView& depth, RememberedObject& object) {
    set_probes(depth, object);
    const cv::Point best = best_shift(
        depth.size(), [&](const cv::Point& shift) { return support(depth, shift).score; });
    object.shift_prediction(best);
    for (Probe& p : inside_) p.x += best.x, p.y += best.y;
  }

  SegmentationCompensatorSettings settings_;
  std::vector<Probe> inside_, ring_;
};

}  // namespace stillpoint
