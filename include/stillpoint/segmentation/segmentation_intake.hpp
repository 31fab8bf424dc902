// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/segmentation/dynamic_class.hpp"
#include "stillpoint/segmentation/forward_predictor.hpp"
#include "stillpoint/segmentation/late_segmentation_settings.hpp"
#include "stillpoint/segmentation/remembered_object.hpp"
#include "stillpoint/segmentation/segmentation_age.hpp"
#include "stillpoint/segmentation/segmentation_compensator_settings.hpp"
#include "stillpoint/segmentation/segmenter.hpp"
#include "stillpoint/segmentation/sudden_object_filter.hpp"

namespace stillpoint {

/// What the front end takes of a segmentation: dynamic classes only, late ones predicted forward
/// (ForwardPredictor), without what appears out of nothing (SuddenObjectFilter); and the movers.
/// Keeps count of how old the newest result is. Not thread-safe; one object per camera.
class SegmentationIntake {
 public:
  /// `doubt`: whether sudden objects are left out.
  SegmentationIntake(const std::vector<DynamicClass>& classes, const LateSegmentationSettings& late,
                     const SegmentationCompensatorSettings& compensation, bool doubt,
                     const Camera& camera)
      : classes_(classes),
        late_(late),
        doubt_(doubt),
        predictor_(late, compensation, camera),
        sudden_(compensation) {}

  /// What a segmenter says of a checked frame; null: nothing. One that throws, or whose result does
  /// not fit the frame, counts as one without a result; see error(). The reference stays valid
  /// until the next call.
  const Segmentation& ask(Segmenter* segmenter, const RgbdFrame& frame) {
    error_.clear();
    failed_ = false;
    asked_ = Segmentation();
    if (!segmenter) return asked_;
    may_be_late_ = true;
    try {
      asked_ = segmenter->segment(frame);
      check_segmentation(asked_, frame);
      return asked_;
    } catch (const std::exception& error) {
      error_ = error.what();
    } catch (...) {
      error_ = "an exception that is not a std::exception";
    }
    failed_ = true;
    return asked_ = Segmentation();
  }
  /// The next segmentation is the caller's own.
  void ask_nobody() {
    error_.clear();
    failed_ = false;
    may_be_late_ = true;
  }

  /// Takes the segmentation of a frame. `starts_anew`: time went back.
  void take(const FrameContext& context, const Segmentation& segmentation,
            const std::vector<Instance>& movers, const std::vector<RememberedObject>& remembered,
            bool starts_anew) {
    dynamic_.available = segmentation.available;
    dynamic_.timestamp = segmentation.timestamp;
    dynamic_.instances.clear();
    if (segmentation.available)
      for (const Instance& s : segmentation.instances)
        if (is_dynamic(s, classes_)) dynamic_.instances.push_back(s);
    raw_ = dynamic_.instances;
    if (may_be_late_) predictor_.forward(context, dynamic_);
    const double now_s = context.frame.timestamp;
    if (doubt_) sudden_.filter(now_s, context.size(), remembered, movers, context.labels, dynamic_);
    dynamic_.instances.insert(dynamic_.instances.end(), movers.begin(), movers.end());
    if (starts_anew) age_ = SegmentationAge();
    age_.add(now_s, dynamic_);
  }

  /// What the last take() left: dynamic instances, then the movers.
  Segmentation& taken() { return dynamic_; }
  const Segmentation& taken() const { return dynamic_; }

  /// Takes note of where the compensator's objects were found in the frame of take().
  void remember(const std::vector<RememberedObject>& objects) { predictor_.remember(objects); }
  /// Tells the camera's motion to the frame of take(), once it is known better.
  void set_motion(const std::optional<Eigen::Isometry3d>& T_current_last) {
    predictor_.set_motion(T_current_last);
  }

  /// The segmenter's own instances of dynamic classes.
  const std::vector<Instance>& raw() const { return raw_; }
  /// Message of what the segmenter threw in the last ask(); empty if it did not.
  const std::string& error() const { return error_; }
  /// Age of the newest result at the last frame, seconds; infinity before the first.
  double age_s() const { return age_.age_s(); }
  /// By how much masks of that age are widened.
  int widening_px() const { return late_.widening_px(age_.age_s()); }
  /// Bits of the last frame: kNoSegmentation, kNeverSegmented, kMaskStale, kObjectDoubted,
  /// kSegmenterFailed.
  std::uint32_t status() const {
    return predictor_.status() | sudden_.status() | age_.status() |
           (failed_ ? std::uint32_t{kSegmenterFailed} : std::uint32_t{kOk});
  }

 private:
  std::vector<DynamicClass> classes_;
  LateSegmentationSettings late_;
  bool doubt_;
  ForwardPredictor predictor_;
  SuddenObjectFilter sudden_;
  Segmentation asked_, dynamic_;
  std::string error_;
  bool failed_ = false;       // of the last ask()
  bool may_be_late_ = false;  // a result: there is a segmenter, or the caller has told some
  std::vector<Instance> raw_;
  SegmentationAge age_;
};

}  // namespace stillpoint
