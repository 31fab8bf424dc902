// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "frame_view.hpp"
#include "judge.hpp"
#include "run_job.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/evaluation/keypoint_metrics.hpp"
#include "stillpoint/evaluation/mask_metrics.hpp"
#include "stillpoint/motion/blur_meter.hpp"

namespace stillpoint::cli {

/// Writes what a run leaves behind frame by frame: masks, keypoints.csv, overlays; and the objects.
class FrameWriter {
 public:
  FrameWriter(const RunOutputs& outputs, const Camera& camera);
  void write(const FrameView& view, const std::string& stem, WholeImageJudge& judge);
  /// Throws Error if keypoints.csv or the objects could not be written to their end.
  void finish();

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  RunOutputs outputs_;
  Camera camera_;
  std::unique_ptr<std::FILE, Close> csv_;
  std::string objects_;
};

/// Keeps an image of each of the worst frames, stage by stage: those in which most of the image
/// is wrong in the mask before dilation, at least a quarter of a second apart.
class WorstFrames {
 public:
  explicit WorstFrames(const RunOutputs& outputs)
      : folder_(outputs.worst_dir), count_(outputs.worst) {}
  /// `truth`: the true mask, empty where there is none; `counts`: the final mask against it.
  void add(const FrameView& view, const std::string& stem, const cv::Mat& truth,
           const BinaryCounts& counts);
  /// Writes 01_STEM.png (the worst) and so on. Throws Error if that is not possible.
  void finish() const;

 private:
  struct Frame {
    double timestamp = 0, wrong = 0;
    std::string stem;
    cv::Mat image;
  };
  std::filesystem::path folder_;
  std::size_t count_ = 0;
  std::vector<Frame> frames_;  // the worst first
};

/// Collects numbers frame by frame and sums them up for stats.json.
class RunRecorder {
 public:
  /// `truth_dir`: masks_gt, or empty where there is none.
  explicit RunRecorder(std::filesystem::path truth_dir) : truth_dir_(std::move(truth_dir)) {}

  void add(const FrameView& view, const std::string& stem, WholeImageJudge& judge);

  /// The true mask of the last frame, empty where there is none, and the final one against it.
  const cv::Mat& truth() const { return truth_; }
  const BinaryCounts& mask_counts() const { return records_.back().after; }

  std::size_t frames() const { return records_.size(); }
  std::size_t tracked() const;
  std::vector<double> timestamps() const;
  /// The first message of a segmenter that threw, and in how many frames it did.
  const std::string& segmenter_error() const { return segmenter_error_; }
  std::size_t segmenter_errors() const { return segmenter_errors_; }

  /// Adds lost, blur, masks, keypoints, times_ms and status to `stats`.
  void summarize(nlohmann::ordered_json& stats, bool front_end) const;
  /// Curves over time: t_s, sharpness (of the edges, about 1: perfect steps), motion_px (predicted,
  /// during the exposure), mask_share, true_mask_share, kept; with masks_gt iou_before, iou_after,
  /// missed_before, missed_after (share of the people's pixels that the mask lacks).
  nlohmann::ordered_json series(bool front_end) const;

 private:
  struct Record {
    double timestamp = 0;
    StageTimes times;
    std::uint32_t status = 0;
    bool tracked = false, has_truth = false;
    int keypoints = 0, kept = 0, restored = 0;
    double mask_share = 0, true_share = 0;
    double sharpness = 0, motion_px = 0;
    BinaryCounts before, after;
    BinaryCounts measured;  // the final mask where there is depth
    /// Of the tracker's own keypoints, and of those of the whole image.
    KeypointMetrics tracked_keypoints, judged_keypoints;
  };

  void summarize_times(nlohmann::ordered_json& stats) const;
  /// The stretches of frames without a pose.
  nlohmann::ordered_json lost() const;
  /// How good the masks are by masks_gt.
  nlohmann::ordered_json masks() const;

  std::filesystem::path truth_dir_;
  BlurMeter blur_;  // for the edges, also with the front end off
  cv::Mat truth_;
  std::vector<Record> records_;
  std::string segmenter_error_;
  // The last that are known.
  double depth_delay_s_ = std::numeric_limits<double>::quiet_NaN();
  double depth_readout_s_ = std::numeric_limits<double>::quiet_NaN();
  std::size_t segmenter_errors_ = 0;
  bool any_truth_ = false;
};

}  // namespace stillpoint::cli
