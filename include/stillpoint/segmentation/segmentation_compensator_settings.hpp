// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <string>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Settings of SegmentationCompensator (paper section 3.1).
struct SegmentationCompensatorSettings {
  enum class Trigger {
    kGlobal,    ///< the paper's: area of the whole mask against that of the last frame
    kPerObject  ///< each remembered object for itself
  };
  Trigger trigger = Trigger::kPerObject;
  /// A mask under this share of the last one (or an object seen to less than this share) counts as
  /// missed.
  double area_ratio = 0.9;
  /// n: how many last places the line is fitted to, at most 8.
  int history = 5;
  /// True: the line runs through the upper-left corners of the boxes (paper), else through the
  /// centres of the masks.
  bool corner_history = false;
  /// Use the depth, where there is one, to find the object near its predicted place and to tell
  /// whether it is still there.
  bool use_depth = true;
  /// Reach of the search around the predicted place.
  int search_px = 24;
  /// Template correlation from which an object counts as still there (used where depth cannot
  /// tell).
  double min_template_score = 0.5;
  /// Share of the object's measured pixels whose depth must agree with it.
  double min_depth_support = 0.5;
  /// How many results of the segmenter in a row may miss an object before it is forgotten; at most
  /// 2 if it was seen once only and 5 if twice, but in the paper's. Objects without a class, of
  /// which a segmenter says nothing, are bounded by time alone.
  int max_restored_frames = 8;
  /// A result that misses an object counts as two of them where the object would move
  /// by less than so many pixels during the exposure and the edges are sharp: who is there is
  /// seldom missed then. 0: all count alike.
  double sharp_px = 4;
  /// How long an object is carried along without being seen, where no results end it before. An
  /// object that goes away from the camera, or towards it, for itself by 15 cm counts as seen,
  /// for up to 2 s.
  double max_prediction_s = 0.6;
  /// The same for an object without a class, if it was seen for a while: the motion check finds it
  /// again as soon as it moves, and the depth says whether it is still there. Seen once, it is
  /// carried along for max_prediction_s where the camera stands still, and down to 0.1 s (2.5
  /// frames of a slow camera) where the camera rotates, as false movers are seen once then; each
  /// second of being seen gives three more, up to this.
  double max_unnamed_s = 1.8;
  /// An object with a name that appears from one result to the next over more than this share of
  /// the image is doubted (SuddenObjectFilter) until it is in `sudden_results` results in a row, in
  /// 45 where what it covers is known to be static. 1: none is.
  double sudden_share = 0.3;
  int sudden_results = 3;
  /// Bound on an object's own speed.
  double max_speed_m_s = 3;

  /// The literal method: global trigger, three corners, template only.
  static SegmentationCompensatorSettings paper() {
    SegmentationCompensatorSettings settings;
    settings.trigger = Trigger::kGlobal;
    settings.history = 3;
    settings.corner_history = true;
    settings.use_depth = false;
    settings.sharp_px = 0;
    settings.sudden_share = 1;
    return settings;
  }

  /// Throws Error if a setting makes no sense.
  void check() const {
    const auto fail = [](const char* name, const char* expected, double found) {
      throw Error(std::string("SegmentationCompensatorSettings.") + name + ": expected " +
                  expected + ", found " + std::to_string(found));
    };
    if (!(area_ratio > 0 && area_ratio <= 1))
      fail("area_ratio", "more than 0, at most 1", area_ratio);
    if (!(min_template_score >= -1 && min_template_score <= 1))
      fail("min_template_score", "-1 to 1", min_template_score);
    if (!(min_depth_support >= 0 && min_depth_support <= 1))
      fail("min_depth_support", "0 to 1", min_depth_support);
    if (history < 1 || history > 8) fail("history", "1 to 8", history);
    if (search_px < 0 || search_px > 1000) fail("search_px", "0 to 1000", search_px);
    if (max_restored_frames < 0) fail("max_restored_frames", "at least 0", max_restored_frames);
    if (!(sharp_px >= 0)) fail("sharp_px", "at least 0", sharp_px);
    if (!(max_prediction_s >= 0)) fail("max_prediction_s", "at least 0", max_prediction_s);
    if (!(max_unnamed_s >= 0)) fail("max_unnamed_s", "at least 0", max_unnamed_s);
    if (!(sudden_share > 0 && sudden_share <= 1))
      fail("sudden_share", "more than 0, at most 1", sudden_share);
    if (sudden_results < 1) fail("sudden_results", "at least 1", sudden_results);
    if (!(max_speed_m_s >= 0)) fail("max_speed_m_s", "at least 0", max_speed_m_s);
  }
};

}  // namespace stillpoint
