// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/segmentation/remembered_object.hpp"
#include "stillpoint/segmentation/segmentation_compensator_settings.hpp"

namespace stillpoint {

/// Leaves out what a detector suddenly sees all over the image: nobody fills a third of it from one
/// frame to the next, but a detector takes a blurred desk for a person. Such an object counts once
/// several results in a row show it, or at once where something moves in it, where a remembered
/// object is, or after a pause of the segmenter. Where earlier frames have seen most of it at the
/// same place, the segmenter must insist on it for longer than blur lasts.
class SuddenObjectFilter {
 public:
  using Settings = SegmentationCompensatorSettings;

  explicit SuddenObjectFilter(const Settings& settings = {}) : settings_(settings) {}

  /// Takes the doubtful instances out of the segmenter's result that came at `now_s` (seconds) for
  /// an image of `size`; status() says whether there were some. `known`: the objects of the last
  /// frame; `movers`: instances that surely move; `labels`: what is known of the image's cells.
  /// O(instances x objects), and O(cells) for each large instance.
  void filter(double now_s, const cv::Size& size, const std::vector<RememberedObject>& known,
              const std::vector<Instance>& movers, const CellLabels& labels,
              Segmentation& segmentation) {
    status_ = kOk;
    if (!segmentation.available) return;
    const double result_s = result_time(segmentation, now_s);
    const bool paused = !(result_s - last_s_ <= kPauseS && result_s >= last_s_);
    last_s_ = result_s;
    next_.clear();
    const auto doubtful = [&](const Instance& s) {
      const double share = static_cast<double>(s.box.area()) / size.area();
      if (s.class_name.empty() || share <= settings_.sudden_share) return false;
      if (stood_there(labels.count(s))) return count_results(s.box) < kInsistentResults;
      if (paused) return false;
      const auto inside = [&](const cv::Rect& box, double least) {
        return (box & s.box).area() > least * box.area();
      };
      for (const RememberedObject& object : known)
        if (!object.class_name.empty() && inside(object.box(), kKnownShare)) return false;
      int moving_px = 0;
      for (const Instance& mover : movers)
        if (inside(mover.box, 0.5)) moving_px += mover.box.area();
      if (moving_px > kMovingShare * s.box.area()) return false;
      return count_results(s.box) < settings_.sudden_results;
    };
    std::vector<Instance>& instances = segmentation.instances;
    const std::size_t given = instances.size();
    instances.erase(std::remove_if(instances.begin(), instances.end(), doubtful), instances.end());
    std::swap(candidates_, next_);
    if (instances.size() < given) status_ = kObjectDoubted;
  }

  /// kObjectDoubted or kOk, of the last filter().
  std::uint32_t status() const { return status_; }

 private:
  // How many results in a row have shown something there.
  int count_results(const cv::Rect& box) {
    int results = 1;
    for (const Candidate& c : candidates_)
      if (2 * (c.box & box).area() > (c.box | box).area())
        results = std::max(results, c.results + 1);
    next_.push_back({box, results});
    return results;
  }

  // Enough of it was looked at, most of that is static, and hardly anything has moved. A person's
  // box has up to 0.7 of background, and what moves.
  static bool stood_there(const CellLabels::Counts& cells) {
    return cells.seen > 0.3 * cells.all && cells.of_static > 0.7 * cells.seen &&
           cells.moved < 0.02 * cells.all;
  }

  static constexpr int kInsistentResults = 45;  // 1.5 s at 30 Hz; bursts of blur are shorter
  static constexpr double kPauseS = 0.15;       // longer: people may have come close meanwhile
  static constexpr double kKnownShare = 0.25;   // of a known object's box
  static constexpr double kMovingShare = 0.1;   // of the doubtful one's box

  struct Candidate {
    cv::Rect box;
    int results;
  };

  Settings settings_;
  double last_s_ = -std::numeric_limits<double>::infinity();
  std::vector<Candidate> candidates_, next_;
  std::uint32_t status_ = kOk;
};

}  // namespace stillpoint
