// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// The stand-in's system: the same calls as the host's (system.h:57, :79, :115-145), and as there
// the frame is declared only, so that who creates one must include data/frame.h. It extracts with
// OpenCV's ORB and tracks nothing: its pose is what `pose_of` says.

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "config.h"

namespace stella_vslam {

using Mat44_t = Eigen::Matrix4d;

namespace data {
class frame;
}

class system {
 public:
  system(const std::shared_ptr<config>& cfg, const std::string& vocab_file_path);
  ~system();
  void startup(const bool need_initialize = true);
  void shutdown();
  void save_frame_trajectory(const std::string& path, const std::string& format) const;
  std::shared_ptr<Mat44_t> feed_frame(const data::frame& frm, const cv::Mat& img,
                                      double extraction_time_elapsed_ms);
  data::frame create_RGBD_frame(const cv::Mat& rgb_img, const cv::Mat& depthmap,
                                const double timestamp, const cv::Mat& mask);
  std::shared_ptr<Mat44_t> feed_RGBD_frame(const cv::Mat& rgb_img, const cv::Mat& depthmap,
                                           const double timestamp, const cv::Mat& mask = cv::Mat{});

  // Not of the host.
  std::function<std::shared_ptr<Mat44_t>(double)> pose_of;
  std::function<void(std::vector<cv::KeyPoint>&)> undistort;
  std::vector<std::shared_ptr<data::frame>> fed;
  cv::Mat last_mask;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace stella_vslam
