// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// Written from the structure of stella_vslam 0.6.0 (b0e60d6) as far as the adapter touches it: the
// same names and types. In the host these are several headers; the lines are named at each part.

#include <Eigen/Core>
#include <Eigen/StdVector>
#include <memory>
#include <opencv2/core.hpp>
#include <unordered_map>
#include <vector>

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

}  // namespace stella_vslam
