// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <string>
#include <vector>

#include "pipeline.hpp"
#include "run_job.hpp"
#include "stillpoint/io/tum_sequence.hpp"

namespace stillpoint::cli {

/// Writes what a run leaves behind frame by frame: masks, keypoints.csv, overlays.
class FrameWriter {
 public:
  explicit FrameWriter(const RunOutputs& outputs);
  void write(const Pipeline& pipeline, const RgbdFrame& frame, const std::string& stem,
             std::size_t index);
  /// Throws Error if keypoints.csv could not be written to its end.
  void finish();

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  RunOutputs outputs_;
  std::unique_ptr<std::FILE, Close> csv_;
};

/// Collects numbers frame by frame and sums them up for stats.json.
class RunRecorder {
 public:
  /// `truth_dir`: masks_gt, or empty where there is none.
  RunRecorder(std::filesystem::path truth_dir, const FrontEndSettings& front_end);

  void add(const Pipeline& pipeline, const RgbdFrame& frame, const std::string& stem);

  std::size_t frames() const { return records_.size(); }
  std::size_t tracked() const;
  std::vector<double> timestamps() const;

  /// Adds masks, keypoints, times_ms, status and so on to `stats`.
  void summarize(nlohmann::ordered_json& stats, bool front_end) const;
  /// Curves over time: t_s, sharpness, mask_share, true_mask_share, tracked.
  nlohmann::ordered_json series(bool front_end) const;

 private:
  /// Pixels or keypoints: claimed and true, claimed but false, missed, rightly left.
  struct Counts {
    double hit = 0, false_alarm = 0, missed = 0, left = 0;
  };
  struct Record {
    double timestamp = 0;
    StageTimes times;
    std::uint32_t status = 0;
    bool tracked = false, has_truth = false;
    int keypoints = 0, kept = 0, restored = 0;
    double mask_share = 0, true_share = 0, sharpness = 0;
    Counts before, after, judged;
    int kept_on_people = 0;
  };

  static Counts compare(const cv::Mat& mask, const cv::Mat& truth);

  std::filesystem::path truth_dir_;
  ProbabilisticKeypointFilter<> judge_;
  bool use_probability_;
  cv::Ptr<cv::Feature2D> extractor_;
  std::vector<Record> records_;
  std::string segmenter_error_;
  bool any_truth_ = false;
};

}  // namespace stillpoint::cli
