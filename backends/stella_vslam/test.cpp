// SPDX-License-Identifier: BSD-2-Clause
// The adapter's header first: it must not need the host's.
#include <gtest/gtest.h>

#include <stillpoint/backends/stella_vslam.hpp>

#include "../../tests/flat_scene.hpp"
#include "../../tests/io/temporary_folder.hpp"
#include "../../tests/stand_ins/stella_vslam/data/frame.h"
#include "../../tests/stand_ins/stella_vslam/system.h"

namespace {

using namespace stillpoint;
using Adapter = StellaVslam<stella_vslam::system>;

const double kStart_s = 1300000000;

Segmentation seen(const Figure& figure) {
  return result({box_instance(figure.box, large_scene().size)});
}

TEST(StellaVslam, FeedsAFrameOfWhatIsStatic) {
  const FlatScene scene = large_scene();
  stella_vslam::system slam(nullptr, "");
  FrontEnd front_end(FrontEndSettings::network_only(), scene.camera());
  Adapter adapter(slam, front_end, scene.camera());
  for (int i = 0; i < 4; ++i) {
    const RgbdFrame frame = scene.frame(kStart_s + i / 30.0, {walker(i)});
    stella_vslam::system alone(nullptr, "");
    const auto all = alone.create_RGBD_frame(frame.color, frame.depth, frame.timestamp, cv::Mat());
    const auto pose =
        i % 2 ? adapter.track_rgbd(frame) : adapter.track_rgbd(frame, seen(walker(i)));
    ASSERT_TRUE(pose);
    ASSERT_EQ(slam.fed.size(), static_cast<std::size_t>(i + 1));
    const auto& fed = *slam.fed.back();
    const auto& obs = fed.frm_obs_;
    EXPECT_EQ(fed.id_, static_cast<unsigned>(i));
    EXPECT_EQ(fed.timestamp_, frame.timestamp);
    EXPECT_TRUE(fed.camera_ && fed.orb_params_);
    const std::size_t n = adapter.selection().kept.size();
    EXPECT_GT(n, 50u);
    EXPECT_LT(n, all.frm_obs_.undist_keypts_.size());
    ASSERT_EQ(obs.undist_keypts_.size(), n);
    ASSERT_EQ(obs.bearings_.size(), n);
    ASSERT_EQ(obs.depths_.size(), n);
    ASSERT_EQ(obs.stereo_x_right_.size(), n);
    ASSERT_EQ(obs.descriptors_.rows, static_cast<int>(n));
    EXPECT_EQ(fed.landmarks(), n) << "sized by the constructor";
    EXPECT_EQ(obs.num_grid_cols_, 64u);
    EXPECT_EQ(obs.num_grid_rows_, 48u);
    std::size_t in_cells = 0;
    for (const auto& column : obs.keypt_indices_in_cells_)
      for (const auto& cell : column)
        for (const unsigned int k : cell) {
          ++in_cells;
          ASSERT_LT(k, n);
        }
    EXPECT_EQ(in_cells, n);
    for (std::size_t k = 0; k < n; ++k) {
      // Each keypoint with what was its own.
      const auto from = static_cast<std::size_t>(obs.stereo_x_right_[k]);
      EXPECT_EQ(obs.bearings_[k].x(), static_cast<double>(from));
      EXPECT_EQ(obs.undist_keypts_[k].pt, all.frm_obs_.undist_keypts_[from].pt);
      EXPECT_EQ(obs.depths_[k], all.frm_obs_.depths_[from]);
      EXPECT_EQ(cv::norm(obs.descriptors_.row(static_cast<int>(k)),
                         all.frm_obs_.descriptors_.row(static_cast<int>(from)), cv::NORM_INF),
                0);
      EXPECT_FALSE(
          front_end.mask().dynamic_at(obs.undist_keypts_[k].pt.x, obs.undist_keypts_[k].pt.y));
    }
  }
  EXPECT_GT(adapter.budget().features_for(1000, 5000), 1000);
}

TEST(StellaVslam, LooksTheMaskUpInTheRawPicture) {
  const FlatScene scene = large_scene();
  Camera camera = scene.camera();
  camera.k1 = 0.3;
  stella_vslam::system slam(nullptr, "");
  slam.undistort = [&](std::vector<cv::KeyPoint>& keypoints) {
    for (cv::KeyPoint& k : keypoints) {
      const Eigen::Vector2d p = undistort_pixel(camera, {k.pt.x, k.pt.y});
      k.pt = cv::Point2f(static_cast<float>(p.x()), static_cast<float>(p.y()));
    }
  };
  FrontEndSettings settings = FrontEndSettings::network_only();
  settings.use_compensation = settings.use_depth = settings.use_probability = false;
  FrontEnd front_end(settings, camera);
  Adapter adapter(slam, front_end, camera);
  const Figure person{{70, 20, 100, 440}, 2, 7};  // near the edge: moved most
  adapter.track_rgbd(scene.frame(kStart_s, {person}), seen(person));
  const auto& kept = slam.fed.back()->frm_obs_.undist_keypts_;
  ASSERT_GT(kept.size(), 50u);
  int would_differ = 0;
  for (const cv::KeyPoint& k : kept) {
    const Eigen::Vector2d raw = distort_pixel(camera, {k.pt.x, k.pt.y});
    EXPECT_FALSE(
        front_end.mask().dynamic_at(static_cast<float>(raw.x()), static_cast<float>(raw.y())));
    would_differ += front_end.mask().dynamic_at(k.pt.x, k.pt.y);
  }
  EXPECT_GT(would_differ, 0) << "the lens must matter here";
}

TEST(StellaVslam, CanLeaveTheMaskToTheExtractor) {
  const FlatScene scene = large_scene();
  stella_vslam::system slam(nullptr, "");
  FrontEnd front_end(FrontEndSettings::network_only(), scene.camera());
  Adapter adapter(slam, front_end, scene.camera(), StellaMasking::kByExtractor);
  adapter.track_rgbd(scene.frame(kStart_s, {walker(0)}), seen(walker(0)));
  ASSERT_EQ(slam.last_mask.size(), scene.size);
  EXPECT_EQ(cv::norm(slam.last_mask, front_end.mask().static_image(), cv::NORM_INF), 0)
      << "0 = masked in the host";
  EXPECT_EQ(adapter.selection().size(), 0u);
  EXPECT_FALSE(slam.fed.back()->frm_obs_.undist_keypts_.empty());
}

TEST(StellaVslam, TakesAPoseThatIsNotFiniteForALostHost) {
  const FlatScene scene = large_scene();
  for (const double bad : {std::nan(""), HUGE_VAL}) {
    std::vector<cv::Mat> masks[2];
    for (const bool spoiled : {false, true}) {
      stella_vslam::system slam(nullptr, "");
      int frame_number = 0;
      slam.pose_of = [&](double) -> std::shared_ptr<Eigen::Matrix4d> {
        if (frame_number == 3 && !spoiled) return nullptr;
        Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
        T(0, 3) = frame_number == 3 ? bad : 0.01 * frame_number;
        return std::make_shared<Eigen::Matrix4d>(T);
      };
      FrontEnd front_end(FrontEndSettings(), scene.camera());
      Adapter adapter(slam, front_end, scene.camera());
      for (; frame_number < 10; ++frame_number) {
        adapter.track_rgbd(scene.frame(kStart_s + frame_number / 30.0, {walker(frame_number)}),
                           seen(walker(frame_number)));
        masks[spoiled].push_back(front_end.mask().image.clone());
      }
    }
    for (std::size_t i = 0; i < masks[0].size(); ++i)
      EXPECT_EQ(cv::norm(masks[0][i], masks[1][i], cv::NORM_INF), 0) << i;
  }
}

TEST(StellaVslam, HandsThePoseBackAndSurvivesALostHost) {
  const FlatScene scene = large_scene();
  stella_vslam::system slam(nullptr, "");
  int frame_number = 0;
  slam.pose_of = [&](double) -> std::shared_ptr<Eigen::Matrix4d> {
    if (frame_number == 3) return nullptr;
    Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
    T(0, 3) = 0.01 * frame_number;
    return std::make_shared<Eigen::Matrix4d>(T);
  };
  FrontEnd front_end(FrontEndSettings(), scene.camera());
  Adapter adapter(slam, front_end, scene.camera());
  for (; frame_number < 6; ++frame_number) {
    const auto pose =
        adapter.track_rgbd(scene.frame(kStart_s + frame_number / 30.0, {}), result({}));
    EXPECT_EQ(pose == nullptr, frame_number == 3);
    EXPECT_GT(slam.fed.back()->frm_obs_.undist_keypts_.size(), 500u);
  }
  RgbdFrame mono = scene.frame(kStart_s + 1, {});
  mono.depth.release();
  EXPECT_ERROR(adapter.track_rgbd(mono), "frame.depth", "found an empty one");
}

}  // namespace
