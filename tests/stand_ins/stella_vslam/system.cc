// SPDX-License-Identifier: BSD-2-Clause
#include "system.h"

#include <cstdint>
#include <cstdio>
#include <opencv2/features2d.hpp>

#include "data/frame.h"

namespace stella_vslam {

struct system::Parts {
  camera::base camera;
  feature::orb_params orb_params;
  unsigned int next_frame_id = 0;
};

system::system(const std::shared_ptr<config>&, const std::string&)
    : pose_of([](double) { return std::make_shared<Mat44_t>(Mat44_t::Identity()); }),
      parts_(new Parts) {}
system::~system() = default;
void system::startup(const bool) {}
void system::shutdown() {}

void system::save_frame_trajectory(const std::string& path, const std::string&) const {
  if (std::FILE* file = std::fopen(path.c_str(), "w")) {
    for (const auto& f : fed)
      std::fprintf(file, "%.6f 0 0 0 0 0 0 1\n", f->timestamp_);  // stands still
    std::fclose(file);
  }
}

// As system.cc:467-530 of the host.
data::frame system::create_RGBD_frame(const cv::Mat& rgb_img, const cv::Mat& depthmap,
                                      const double timestamp, const cv::Mat& mask) {
  last_mask = mask.clone();
  std::vector<cv::KeyPoint> keypts;
  data::frame_observation obs;
  cv::ORB::create(1000)->detectAndCompute(rgb_img, mask, keypts, obs.descriptors_);
  obs.undist_keypts_ = keypts;
  if (undistort) undistort(obs.undist_keypts_);
  for (std::size_t i = 0; i < keypts.size(); ++i) {
    const float depth = depthmap.at<std::uint16_t>(static_cast<int>(keypts[i].pt.y),
                                                   static_cast<int>(keypts[i].pt.x)) /
                        5000.0f;
    obs.depths_.push_back(depth > 0 ? depth : -1);
    obs.stereo_x_right_.push_back(static_cast<float>(i));  // a number to know it by
    obs.bearings_.emplace_back(static_cast<double>(i), 0, 1);
  }
  obs.num_grid_cols_ = 64;
  obs.num_grid_rows_ = 48;
  data::assign_keypoints_to_grid(&parts_->camera, obs.undist_keypts_, obs.keypt_indices_in_cells_,
                                 obs.num_grid_cols_, obs.num_grid_rows_);
  return data::frame(parts_->next_frame_id++, timestamp, &parts_->camera, &parts_->orb_params, obs,
                     {});
}

std::shared_ptr<Mat44_t> system::feed_RGBD_frame(const cv::Mat& rgb_img, const cv::Mat& depthmap,
                                                 const double timestamp, const cv::Mat& mask) {
  return feed_frame(create_RGBD_frame(rgb_img, depthmap, timestamp, mask), rgb_img, 0);
}

std::shared_ptr<Mat44_t> system::feed_frame(const data::frame& frm, const cv::Mat&, double) {
  fed.push_back(std::make_shared<data::frame>(frm));
  return pose_of(frm.timestamp_);
}

}  // namespace stella_vslam
