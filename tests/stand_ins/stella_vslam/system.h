// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// Written from the structure of stella_vslam 0.6.0 (b0e60d6) as far as the adapter touches it: the
// same names, types and order of calls. It extracts with OpenCV's ORB and tracks nothing: its pose
// is what `pose_of` says. In the host these are several headers; the lines are named at each part.

#include <Eigen/Core>
#include <Eigen/StdVector>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <string>
#include <unordered_map>
#include <vector>

#include "config.h"

namespace stella_vslam {

using Mat44_t = Eigen::Matrix4d;
using Vec3_t = Eigen::Vector3d;
template <typename T>
using eigen_alloc_vector = std::vector<T, Eigen::aligned_allocator<T>>;  // type.h

namespace camera {
class base {  // camera/base.h
 public:
  unsigned int cols_ = 640, rows_ = 480;
};
}  // namespace camera

namespace feature {
struct orb_params {};  // feature/orb_params.h
}  // namespace feature

namespace data {

struct marker2d {};

/// data/frame_observation.h:12
struct frame_observation {
  cv::Mat descriptors_;
  std::vector<cv::KeyPoint> undist_keypts_;
  eigen_alloc_vector<Vec3_t> bearings_;
  std::vector<float> stereo_x_right_, depths_;
  std::vector<std::vector<std::vector<unsigned int>>> keypt_indices_in_cells_;
  unsigned int num_grid_cols_, num_grid_rows_;  // not initialized, as in the host
};

/// data/frame.h:36; the constructor sizes the landmarks (data/frame.cc).
class frame {
 public:
  frame() = default;
  frame(const unsigned int frame_id, const double timestamp, camera::base* camera,
        feature::orb_params* orb_params, const frame_observation frm_obs,
        const std::unordered_map<unsigned int, marker2d>& markers_2d)
      : id_(frame_id),
        timestamp_(timestamp),
        camera_(camera),
        orb_params_(orb_params),
        frm_obs_(frm_obs),
        markers_2d_(markers_2d),
        landmarks_(frm_obs_.undist_keypts_.size()) {}
  std::size_t landmarks() const { return landmarks_.size(); }  // not of the host

  unsigned int id_ = 0;
  double timestamp_ = 0;
  camera::base* camera_ = nullptr;
  const feature::orb_params* orb_params_ = nullptr;
  frame_observation frm_obs_;
  std::unordered_map<unsigned int, marker2d> markers_2d_;

 private:
  std::vector<std::shared_ptr<int>> landmarks_;
};

/// data/common.h:39
inline void assign_keypoints_to_grid(const camera::base* camera,
                                     const std::vector<cv::KeyPoint>& undist_keypts,
                                     std::vector<std::vector<std::vector<unsigned int>>>& cells,
                                     unsigned int num_grid_cols, unsigned int num_grid_rows) {
  cells.assign(num_grid_cols, std::vector<std::vector<unsigned int>>(num_grid_rows));
  for (unsigned int i = 0; i < undist_keypts.size(); ++i) {
    const auto at = [](float x, unsigned int pixels, unsigned int count) {
      return static_cast<std::size_t>(x * static_cast<float>(count) / static_cast<float>(pixels));
    };
    cells.at(at(undist_keypts[i].pt.x, camera->cols_, num_grid_cols))
        .at(at(undist_keypts[i].pt.y, camera->rows_, num_grid_rows))
        .push_back(i);
  }
}

}  // namespace data

/// system.h:57 and :115-145; create_RGBD_frame as in system.cc:467-530, feed_frame as in
/// system.cc:577-602.
class system {
 public:
  system(const std::shared_ptr<config>&, const std::string&) {}
  void startup(const bool = true) {}
  void shutdown() {}
  void save_frame_trajectory(const std::string& path, const std::string&) const {
    if (std::FILE* file = std::fopen(path.c_str(), "w")) {
      for (const data::frame& f : fed)
        std::fprintf(file, "%.6f 0 0 0 0 0 0 1\n", f.timestamp_);  // stands still
      std::fclose(file);
    }
  }

  data::frame create_RGBD_frame(const cv::Mat& rgb_img, const cv::Mat& depthmap,
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
    data::assign_keypoints_to_grid(&camera_, obs.undist_keypts_, obs.keypt_indices_in_cells_, 64,
                                   48);
    return data::frame(next_frame_id_++, timestamp, &camera_, &orb_params_, obs, {});
  }

  std::shared_ptr<Mat44_t> feed_RGBD_frame(const cv::Mat& rgb_img, const cv::Mat& depthmap,
                                           const double timestamp,
                                           const cv::Mat& mask = cv::Mat{}) {
    return feed_frame(create_RGBD_frame(rgb_img, depthmap, timestamp, mask), rgb_img, 0);
  }
  std::shared_ptr<Mat44_t> feed_frame(const data::frame& frm, const cv::Mat&, double) {
    fed.push_back(frm);
    return pose_of(frm.timestamp_);
  }

  // Not of the host.
  std::function<std::shared_ptr<Mat44_t>(double)> pose_of = [](double) {
    return std::make_shared<Mat44_t>(Mat44_t::Identity());
  };
  std::function<void(std::vector<cv::KeyPoint>&)> undistort;
  std::vector<data::frame> fed;
  cv::Mat last_mask;

 private:
  camera::base camera_;
  feature::orb_params orb_params_;
  unsigned int next_frame_id_ = 0;
};

}  // namespace stella_vslam
