// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/camera_motion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../any_size.hpp"
#include "check_alone.hpp"
#include "small_camera.hpp"
#include "stillpoint/core/random.hpp"

namespace stillpoint {
namespace {

double hash(std::int64_t x, std::int64_t y, std::int64_t plane) {
  std::uint64_t h = static_cast<std::uint64_t>(x * 73856093 ^ y * 19349663 ^ plane * 83492791);
  h = (h ^ (h >> 31)) * 0x9e3779b97f4a7c15ull;
  return static_cast<double>((h ^ (h >> 29)) & 1023) / 1023;
}

// Smooth noise with features of `size_m`.
double texture(double x, double y, double size_m, int plane) {
  x /= size_m, y /= size_m;
  const double fx = std::floor(x), fy = std::floor(y);
  const std::int64_t ix = static_cast<std::int64_t>(fx), iy = static_cast<std::int64_t>(fy);
  const double a = x - fx, b = y - fy;
  return 30 + 190 * ((1 - b) * ((1 - a) * hash(ix, iy, plane) + a * hash(ix + 1, iy, plane)) +
                     b * ((1 - a) * hash(ix, iy + 1, plane) + a * hash(ix + 1, iy + 1, plane)));
}

/// A textured wall 3.2 m ahead, askew (a turn before a wall that is not looks as a step does) and,
/// if `box_x` is a number, a textured board 1.2 m ahead that is 0.44 m wide and as high as the
/// image: a good part of the corners, little area.
RgbdFrame render(double timestamp, const Eigen::Isometry3d& T_world_camera, double box_x = NAN,
                 double half_width_m = 0.22, const Camera& camera = small_camera()) {
  RgbdFrame frame;
  frame.timestamp = timestamp;
  frame.depth_units_per_m = 5000;
  frame.color.create(camera.height, camera.width, CV_8UC1);
  frame.depth.create(camera.height, camera.width, CV_16UC1);
  const Eigen::Vector3d o = T_world_camera.translation();
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d d = T_world_camera.linear() * camera.unproject(x, y, 1);
      double z = (3.2 + 0.6 * o.x() - o.z()) / (d.z() - 0.6 * d.x());
      Eigen::Vector3d p = o + z * d;
      double gray = texture(p.x(), p.y(), 0.12, 1);
      const double near = (1.2 - o.z()) / d.z();
      const Eigen::Vector3d q = o + near * d;
      if (std::abs(q.x() - box_x) < half_width_m) {
        z = near;
        gray = texture(q.x() - box_x, q.y(), 0.04, 2);
      }
      frame.color.at<uchar>(y, x) = static_cast<uchar>(std::lround(gray));
      frame.depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(std::lround(z * 5000));
    }
  return frame;
}

Eigen::Isometry3d pose(double x, double y, double turn_deg) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << x, y, 0;
  T.linear() =
      Eigen::AngleAxisd(turn_deg * 3.14159265358979 / 180, Eigen::Vector3d::UnitY()).matrix();
  return T;
}

std::optional<CameraMotion::Estimate> add(CameraMotion& motion, const RgbdFrame& frame,
                                          const Eigen::Isometry3d& guess,
                                          const Camera& camera = small_camera()) {
  FrameContext context;
  context.begin(frame, camera);
  return motion.add(context, guess);
}

// The outlier corners of the frame that was added last.
std::vector<OutlierCorner> outliers(CameraMotion& motion, const RgbdFrame& frame,
                                    const Eigen::Isometry3d& T,
                                    const std::optional<Eigen::Isometry3d>& another = std::nullopt,
                                    const Camera& camera = small_camera()) {
  FrameContext context;
  context.begin(frame, camera);
  return motion.outlier_clusters(context.depth, T, another, 0);
}

double turn_deg(const Eigen::Isometry3d& T) {
  return Eigen::AngleAxisd(T.linear()).angle() * 180 / 3.14159265358979;
}

TEST(CameraMotion, MeasuresTheMotionInAStaticWorld) {
  const Eigen::Isometry3d first = pose(0, 0, 0), second = pose(0.015, -0.005, 0.75);
  CameraMotion motion;
  EXPECT_FALSE(add(motion, render(0, first), Eigen::Isometry3d::Identity()).has_value());
  const RgbdFrame frame = render(0.03, second);
  const auto found = add(motion, frame, Eigen::Isometry3d::Identity());
  ASSERT_TRUE(found.has_value());
  const Eigen::Isometry3d error = found->T_current_last * (second.inverse() * first).inverse();
  EXPECT_LT(error.translation().norm(), 0.004);
  EXPECT_LT(turn_deg(error), 0.08);
  EXPECT_GT(found->support, 0.8);
  EXPECT_TRUE(outliers(motion, frame, found->T_current_last).empty());
}

TEST(CameraMotion, KeepsToTheWallAlthoughTheHostGoesWithAPersonCloseBy) {
  const Eigen::Isometry3d first = pose(0, 0, 0), second = pose(0.05, 0, 0);
  // The board goes 5 cm to the left: to one who holds it for the world, the camera made 10 cm.
  const Eigen::Isometry3d with_board = pose(0.1, 0, 0).inverse();
  CameraMotion motion;
  add(motion, render(0, first, 0.0), Eigen::Isometry3d::Identity());
  const RgbdFrame frame = render(0.03, second, -0.05);
  const auto found = add(motion, frame, with_board);
  ASSERT_TRUE(found.has_value());
  const Eigen::Isometry3d error = found->T_current_last * second;
  EXPECT_LT(error.translation().norm(), 0.004);
  EXPECT_LT(motion.support(with_board), found->support - 0.3);

  const auto of_board = outliers(motion, frame, found->T_current_last);
  EXPECT_GT(of_board.size(), 10u);
  for (const OutlierCorner& d : of_board) EXPECT_LT(d.depth_m, 1.5);
  // Who follows the board is believed that the board stands still.
  EXPECT_TRUE(outliers(motion, frame, found->T_current_last, with_board).empty());
}

// Nobody's hand moves a camera by a centimetre in one frame and by six in the next: then half of
// the corners are wrong, as before something that moves, or in blur.
TEST(CameraMotion, PrefersASteadyMotionUnlessMostSpeaksForASuddenOne) {
  for (const auto& [half_width_m, expected_m] : {std::pair(0.1, 0.06), std::pair(0.58, 0.01)}) {
    SCOPED_TRACE(half_width_m);
    CameraMotion motion;
    std::optional<CameraMotion::Estimate> found;
    for (int i = 0; i < 6; ++i) {
      // In the last frame the wall, less than all of the image's area, says that the camera jumps;
      // the board goes along with that.
      const double jump_m = i == 5 ? 0.05 : 0;
      found =
          add(motion, render(i / 30.0, pose(0.01 * i + jump_m, 0, 0), 0.02 + jump_m, half_width_m),
              pose(0.01, 0, 0).inverse());
    }
    ASSERT_TRUE(found.has_value());
    EXPECT_NEAR(-found->T_current_last.translation().x(), expected_m, 0.006);
  }
}

// The room lies beyond the range of the sensor, but for a floor and a ceiling without a corner; a
// person close by rotates with the camera.
TEST(CameraMotion, TellsTheRotationByWhatIsBeyondTheRange) {
  SensorModel sensor;
  sensor.max_range_m = 2.5;
  const auto render_far = [](double timestamp, double turn_deg) {
    const double board_x = 1.2 * std::tan(turn_deg * 3.14159265358979 / 180);
    RgbdFrame frame = render(timestamp, pose(0, 0, turn_deg), board_x);
    const cv::Rect beyond(0, 30, kWidth, kHeight - 60);
    cv::Mat depth = frame.depth.clone();
    depth(beyond).setTo(0, depth(beyond) > 1.5 * 5000);
    cv::Mat flat(frame.color.size(), CV_8UC1, cv::Scalar(120));
    frame.color(beyond).copyTo(flat(beyond));
    frame.depth = depth, frame.color = flat;
    return frame;
  };
  CameraMotion motion(sensor);
  add(motion, render_far(0, 0), Eigen::Isometry3d::Identity());
  const auto found = add(motion, render_far(0.03, 0.75), Eigen::Isometry3d::Identity());
  ASSERT_TRUE(found.has_value());
  const Eigen::Isometry3d error = found->T_current_last * pose(0, 0, 0.75);
  EXPECT_LT(turn_deg(error), 0.15) << "of 0.75";
  EXPECT_LT(error.translation().norm(), 0.03);
}

// A third of the corners is static, the others are on people; what was expected is off by more than
// a corner's usual error.
TEST(FlowConsensus, FindsTheMotionNearAnExpectedOne) {
  detail::CornerImage now;
  now.fx = now.fy = 500, now.cx = 320, now.cy = 240, now.scale = 2;
  detail::FlowConsensus consensus;
  consensus.begin(now);
  RandomGenerator random(1);
  const auto below = [&](int n) { return static_cast<float>(random.below(n)); };
  for (int i = 0; i < 45; ++i) {
    detail::Flow f{};
    const float u = 20 + below(600), v = 20 + below(440), z = 2 + 0.01f * below(200);
    f.from = z * Eigen::Vector3f((u - 320) / 500, (v - 240) / 500, 1);
    const bool is_static = i % 3 == 0;
    f.flat_u = is_static ? u : u + 10 + below(40), f.flat_v = is_static ? v : v + below(40);
    f.area = 1;
    consensus.add(f);
  }
  Eigen::Isometry3d motion(Eigen::AngleAxisd(0.0026, Eigen::Vector3d::UnitY()));  // 1.3 pixels
  EXPECT_LT(consensus.support(motion), 0.05);
  EXPECT_GT(consensus.refine(motion), 0.3);
  EXPECT_TRUE(motion.isApprox(Eigen::Isometry3d::Identity(), 1e-4));
}

// Before a camera that stands still a printed carton close by goes to the right: 130 corners in six
// parts of the image. To one who holds it for the world the camera goes to the left, and the wall
// far behind hardly contradicts that; only the desk does. `on_desk`: corners there.
detail::FlowConsensus carton_before_a_wall(int on_desk) {
  detail::CornerImage now;
  now.fx = now.fy = 500, now.cx = 320, now.cy = 240, now.scale = 2;
  detail::FlowConsensus consensus;
  consensus.begin(now);
  RandomGenerator random(1);
  const auto see = [&](int corners, int parts, float z, const cv::Rect& image, float moved_m) {
    for (int i = 0; i < corners; ++i) {
      detail::Flow f{};
      const float u = static_cast<float>(image.x + static_cast<int>(random.below(image.width)));
      const float v = static_cast<float>(image.y + static_cast<int>(random.below(image.height)));
      f.from = z * Eigen::Vector3f((u - 320) / 500, (v - 240) / 500, 1);
      f.flat_u = u + 500 * moved_m / z, f.flat_v = v;
      f.area = std::min(z, 4.0f) * std::min(z, 4.0f);
      f.even_area = f.area * static_cast<float>(parts) / static_cast<float>(corners);
      consensus.add(f);
    }
  };
  see(130, 6, 0.9f, {100, 100, 360, 240}, 0.012f);
  see(14, 2, 7, {60, 10, 560, 80}, 0);
  see(on_desk, 3, 2.5f, {60, 360, 560, 100}, 0);
  return consensus;
}

// So that the carton stands still, and the wall nearly.
Eigen::Isometry3d motion_with_carton() {
  Eigen::Isometry3d T(Eigen::AngleAxisd(-0.0138 / 7, Eigen::Vector3d::UnitY()));
  T.translation().x() = 0.0138;
  return T;
}

TEST(FlowConsensus, DoesNotGoWithACartonThatHasMostOfTheCorners) {
  const detail::FlowConsensus consensus = carton_before_a_wall(13);
  const Eigen::Isometry3d with_carton = motion_with_carton();
  EXPECT_GT(consensus.support(with_carton), consensus.support(Eigen::Isometry3d::Identity()) + 0.03)
      << "most of the area goes with it";
  Eigen::Isometry3d T = with_carton;
  consensus.search(T, with_carton, 0.95);
  EXPECT_LT(T.translation().norm(), 0.001);
  EXPECT_LT(turn_deg(T), 0.02);
}

TEST(FlowConsensus, DoesNotTakeTheWordOfAFewCornersAgainstAllOthers) {
  Eigen::Isometry3d T = motion_with_carton();
  carton_before_a_wall(4).search(T, T, 0.95);
  EXPECT_NEAR(T.translation().x(), 0.0138, 0.001);
}

TEST(CameraMotion, DoubtsADepthThatChangesByMoreThanTheSensorCanErr) {
  RgbdFrame second = render(0.03, pose(0, 0, 0));
  second.depth += 500;  // 10 cm, some 3 m away
  SensorModel precise;
  precise.depth_floor_m = precise.depth_slope = precise.depth_square = 0.0005;
  const auto support = [&second](const SensorModel& sensor) {
    CameraMotion motion(sensor);
    add(motion, render(0, pose(0, 0, 0)), Eigen::Isometry3d::Identity());
    add(motion, second, Eigen::Isometry3d::Identity());
    return motion.support(Eigen::Isometry3d::Identity());
  };
  EXPECT_GT(support(SensorModel::kinect_v1()), 0.8);
  EXPECT_LT(support(precise), 0.1);
}

/// The same camera with more pixels.
Camera enlarged(double factor) {
  Camera camera = small_camera();
  camera.fx *= factor, camera.fy *= factor;
  camera.cx = (camera.cx + 0.5) * factor - 0.5, camera.cy = (camera.cy + 0.5) * factor - 0.5;
  camera.width = static_cast<int>(camera.width * factor);
  camera.height = static_cast<int>(camera.height * factor);
  return camera;
}

TEST(CameraMotion, TreatsImagesOfAllSizesAlike) {
  const Eigen::Isometry3d first = pose(0, 0, 0), second = pose(0.01, 0, 0.2);
  for (const double factor : {0.75, 1.0, 2.0, 2.65, 4.0}) {
    SCOPED_TRACE(factor);
    const Camera camera = enlarged(factor);
    CameraMotion motion;
    add(motion, render(0, first, 0.0, 0.22, camera), Eigen::Isometry3d::Identity(), camera);
    const RgbdFrame frame = render(0.03, second, -0.02, 0.22, camera);
    const auto found = add(motion, frame, Eigen::Isometry3d::Identity(), camera);
    EXPECT_GT(motion.followed(), 80u);
    ASSERT_TRUE(found.has_value());
    const Eigen::Isometry3d error = found->T_current_last * (second.inverse() * first).inverse();
    EXPECT_LT(error.translation().norm(), 0.004);
    EXPECT_LT(turn_deg(error), 0.08);
    const auto of_board = outliers(motion, frame, found->T_current_last, std::nullopt, camera);
    EXPECT_GT(of_board.size(), 10u);
    for (const OutlierCorner& d : of_board) EXPECT_LT(d.depth_m, 1.5);
  }
}

TEST(CameraMotion, BeginsAnewWhenTheSizeOfTheImageChanges) {
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  CameraMotion motion;
  add(motion, render(0, T, NAN, 0.22, enlarged(2)), T, enlarged(2));
  add(motion, render(0.03, T), T);  // as many fine pixels
  EXPECT_EQ(motion.followed(), 0u);
  add(motion, render(0.06, T), T);
  EXPECT_GT(motion.followed(), 80u);
}

TEST(CameraMotion, FindsOutlierClustersThatAreMostOfTheCorners) {
  const Eigen::Isometry3d first = pose(0, 0, 0), second = pose(0.01, 0, 0);
  CameraMotion motion;
  add(motion, render(0, first, 0.0, 0.38), Eigen::Isometry3d::Identity());
  const Eigen::Isometry3d truth = second.inverse();
  const RgbdFrame frame = render(0.03, second, -0.02, 0.38);
  const auto found = add(motion, frame, truth);
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((found->T_current_last * second).translation().norm(), 0.004);
  EXPECT_GT(2 * outliers(motion, frame, truth).size(), motion.followed());
}

// Whether the depth image is even around its middle, 1.2 m there, `z(dx)` a column dx beside it.
template <class Depth>
bool is_even(Depth&& z) {
  RgbdFrame frame = render(0, pose(0, 0, 0));
  for (int x = 0; x < kWidth; ++x)
    frame.depth.col(x).setTo(std::lround(z(x - kWidth / 2) * frame.depth_units_per_m));
  FrameContext context;
  context.begin(frame, small_camera());
  detail::CornerImage image;
  image.set(context);
  return image.is_even(context.depth, {kWidth / 2, kHeight / 2}, 1.2f);
}

TEST(CornerImage, TellsASlantFromAnEdge) {
  EXPECT_TRUE(is_even([](int dx) { return 1.2 + 0.012 * dx; })) << "0.19 m over the patch";
  EXPECT_TRUE(is_even([](int dx) { return dx < 2 ? 1.2 + 0.012 * dx : 0; })) << "a hole";
  EXPECT_TRUE(is_even([](int dx) { return dx < 10 ? 1.2 : 1.6; })) << "an edge farther away";
  EXPECT_FALSE(is_even([](int dx) { return dx < 7 ? 1.2 : 1.6; }));
  EXPECT_FALSE(is_even([](int dx) { return dx < -6 ? 0.8 : 1.2; }));
  EXPECT_FALSE(is_even([](int dx) { return dx < 2 ? 1.2 : dx < 7 ? 0 : 1.6; })) << "its shadow";
}

// A turn of the camera moves the image by 14 pixels, and a board by 1.2: in an image as sharp as
// this one corners are followed well enough to tell.
TEST(CameraMotion, FindsInASharpTurnWhatMovesByATwelfthOfIt) {
  for (const double moved_m : {0.0056, -0.0056}) {
    const Eigen::Isometry3d second = pose(0, 0, 3);
    CameraMotion motion;
    add(motion, render(0, pose(0, 0, 0), 0.0), Eigen::Isometry3d::Identity());
    const RgbdFrame frame = render(0.03, second, moved_m);
    add(motion, frame, second.inverse());
    const std::vector<OutlierCorner> of_board = outliers(motion, frame, second.inverse());
    EXPECT_GT(of_board.size(), 10u) << moved_m;
    for (const OutlierCorner& corner : of_board) EXPECT_LT(corner.depth_m, 1.5);
  }
}

// A motion that is off by a displacement and the rotation that makes up for it on the wall shows
// the wall where it is, and a board close by a pixel beside its place, which is less than 4 mm.
TEST(CameraMotion, DoesNotTakeItsOwnErrorForAMoverCloseBy) {
  for (const double off_m : {0.005, -0.005}) {
    CameraMotion motion;
    add(motion, render(0, pose(0, 0, 0), 0.0), Eigen::Isometry3d::Identity());
    const Eigen::Isometry3d truth = pose(0.01, 0, 0.5).inverse();
    const RgbdFrame frame = render(0.03, truth.inverse(), 0.0);
    add(motion, frame, truth);
    const double wall_m = 3.2, turn_deg = -off_m / wall_m * 180 / 3.14159265358979;
    const Eigen::Isometry3d off = pose(off_m, 0, turn_deg) * truth;
    const double board_m = 1.2, error_m = std::abs(off_m) * (1 - board_m / wall_m);
    ASSERT_GT(error_m / board_m * small_camera().fx, 0.65) << "pixels from which on it shows";
    EXPECT_TRUE(outliers(motion, frame, off).empty()) << off_m;
    EXPECT_TRUE(outliers(motion, frame, truth).empty());
  }
}

// A person has the strongest corners, and most of them.
TEST(CameraMotion, FollowsOtherCornersInThePlaceOfThoseOnPeople) {
  const RgbdFrame first = render(0, pose(0, 0, 0), 0.0, 0.5);
  CameraMotion motion;
  add(motion, first, Eigen::Isometry3d::Identity());
  motion.remember_dynamic(first.depth < 2 * 5000);
  add(motion, render(0.03, pose(0.01, 0, 0), -0.02, 0.5), Eigen::Isometry3d::Identity());
  EXPECT_GT(motion.followed(), 150u) << "45 if the strongest are chosen before it is known";
}

/// A static board with nothing on it but a slanted edge, in a noisy image before a textured wall.
RgbdFrame board_with_an_edge(double timestamp, const Eigen::Isometry3d& T_world_camera) {
  const Camera camera = small_camera();
  RgbdFrame frame = render(timestamp, T_world_camera, 0.0, 0.38);
  RandomGenerator random(static_cast<std::uint64_t>(timestamp * 1000) + 7);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const double z = frame.depth.at<std::uint16_t>(y, x) / 5000.0;
      double gray = frame.color.at<uchar>(y, x);
      if (z < 2) {
        const Eigen::Vector3d p = T_world_camera * camera.unproject(x, y, z);
        gray = 90 + 80 * std::clamp(0.5 + (p.y() - 0.3 * p.x()) / 0.01, 0.0, 1.0);
      }
      frame.color.at<uchar>(y, x) = static_cast<uchar>(std::lround(gray + 20 * random.uniform()));
    }
  return frame;
}

TEST(CameraMotion, DoesNotBelieveWhatSlidesAlongAnEdge) {
  int alone = 0;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Isometry3d first = pose(0, 0, 0), second = pose(0.004 + 0.001 * i, 0, 0.1);
    CameraMotion motion;
    add(motion, board_with_an_edge(0.01 * i, first), Eigen::Isometry3d::Identity());
    const RgbdFrame frame = board_with_an_edge(0.01 * i + 0.5, second);
    add(motion, frame, Eigen::Isometry3d::Identity());
    const Eigen::Isometry3d truth = second.inverse() * first;
    alone += static_cast<int>(outliers(motion, frame, truth).size());
  }
  EXPECT_LT(alone, 12) << "25 if every error counts in full";
}

/// The same with a coarse pattern over all of the wall, as real walls have one.
RgbdFrame render_coarse(double timestamp, const Eigen::Isometry3d& T_world_camera,
                        double box_x = NAN) {
  RgbdFrame frame = render(timestamp, T_world_camera, box_x);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const double z = frame.depth.at<std::uint16_t>(y, x) / 5000.0;
      const Eigen::Vector3d p = T_world_camera * small_camera().unproject(x, y, z);
      uchar& gray = frame.color.at<uchar>(y, x);
      if (z > 2)
        gray = static_cast<uchar>(std::lround(0.5 * gray + 0.5 * texture(p.x(), p.y(), 0.9, 3)));
    }
  return frame;
}

TEST(CameraMotion, FindsATurnThatNobodyForetold) {
  for (const double turn : {-6.0, -4.0, 4.0, 6.0}) {
    SCOPED_TRACE(turn);
    const Eigen::Isometry3d first = pose(0, 0, 0), second = pose(0.01, 0, turn);
    CameraMotion motion;
    add(motion, render_coarse(0, first, 0.0), Eigen::Isometry3d::Identity());
    const auto found =
        add(motion, render_coarse(0.07, second, -0.02), Eigen::Isometry3d::Identity());
    ASSERT_TRUE(found.has_value());
    const Eigen::Isometry3d error = found->T_current_last * (second.inverse() * first).inverse();
    // A little turn and a little step look alike.
    EXPECT_LT(error.translation().norm(), 0.04);
    EXPECT_LT(turn_deg(error), 0.5);
    EXPECT_GT(found->support, 0.5);
  }
}

TEST(CameraMotion, TakesLessExactAgreementWhereOneOfTwoImagesIsBlurred) {
  const Eigen::Isometry3d first = pose(0, 0, 0), second = pose(0.01, 0, 1.5);
  CameraMotion motion;
  add(motion, render_coarse(0, first), Eigen::Isometry3d::Identity());
  RgbdFrame blurred = render_coarse(0.03, second);
  cv::blur(blurred.color, blurred.color, {9, 1});
  const auto found = add(motion, blurred, Eigen::Isometry3d::Identity());
  ASSERT_TRUE(found.has_value());
  const Eigen::Isometry3d error = found->T_current_last * (second.inverse() * first).inverse();
  EXPECT_LT(error.translation().norm(), 0.03);
  EXPECT_LT(turn_deg(error), 0.5);
}

TEST(CameraMotion, LeavesCornersThatGoToWhereTheLensHasNoRay) {
  Camera camera;
  camera.fx = camera.fy = 230, camera.cx = 159.5, camera.cy = 119.5, camera.k1 = -0.4;
  const cv::Size size(320, 240);
  Lens lens;
  lens.set(camera, size);
  cv::Mat paper(1500, 1500, CV_8UC1);
  cv::RNG(1).fill(paper, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(paper, paper, {0, 0}, 1.5);
  cv::normalize(paper, paper, 0, 255, cv::NORM_MINMAX);
  // A papered wall 2 m away. Where the lens has no ray there is an image, too.
  const auto look = [&](int i) {
    const Eigen::Matrix3d R = pose(0, 0, 1.15 * i).linear();
    cv::Mat on_paper(size, CV_32FC2);
    RgbdFrame frame;
    frame.timestamp = 1 + i / 30.0;
    frame.depth.create(size, CV_32FC1);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x) {
        Eigen::Vector2f ray = lens.ray(static_cast<float>(x), static_cast<float>(y));
        if (!ray.allFinite())
          ray = {static_cast<float>(1.5 * (x - camera.cx) / camera.fx),
                 static_cast<float>(1.5 * (y - camera.cy) / camera.fy)};
        const Eigen::Vector3d d = R * ray.homogeneous().cast<double>();
        const Eigen::Vector3d at = 2 / d.z() * d;
        frame.depth.at<float>(y, x) = static_cast<float>(2 / d.z());
        on_paper.at<cv::Vec2f>(y, x) = {static_cast<float>(at.x() * 100 + 750),
                                        static_cast<float>(at.y() * 100 + 750)};
      }
    cv::remap(paper, frame.color, on_paper, cv::noArray(), cv::INTER_LINEAR);
    return frame;
  };
  CameraMotion motion;
  for (int i = 0; i < 12; ++i) {
    const auto found = add(motion, look(i), Eigen::Isometry3d::Identity(), camera);
    EXPECT_EQ(found.has_value(), i > 0) << i;
  }
}

TEST(CameraMotion, TakesImagesOfAnySize) {
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(640, 1), std::pair(2, 480),
                                      std::pair(640, 3), std::pair(17, 13), std::pair(640, 30)}) {
    SCOPED_TRACE(std::to_string(width) + " x " + std::to_string(height));
    RgbdFrame frame;
    frame.depth_units_per_m = 5000;
    frame.color = cv::Mat(height, width, CV_8UC1, cv::Scalar(90));
    frame.depth = cv::Mat(height, width, CV_16UC1, cv::Scalar(5000));
    CameraMotion motion;
    const Camera camera = of_any_size(small_camera());
    CheckAlone check(camera);
    for (const double t : {0.0, 0.03}) {
      frame.timestamp = t;
      EXPECT_FALSE(add(motion, frame, T, camera).has_value());
      EXPECT_TRUE(check.find(frame, T).empty());
      check.remember(cv::Mat::zeros(height, width, CV_8UC1));
    }
  }
}

TEST(CameraMotion, SaysNothingWhereThereIsNothingToFollow) {
  CameraMotion motion;
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  RgbdFrame blank = render(0, T);
  blank.color.setTo(90);
  add(motion, blank, T);
  EXPECT_FALSE(add(motion, blank, T).has_value());
  EXPECT_FALSE(add(motion, render(0.1, T), T).has_value());
  motion.reset();
  EXPECT_FALSE(add(motion, render(0.2, T), T).has_value());
  RgbdFrame without = render(0.3, T);
  without.depth.release();
  EXPECT_FALSE(add(motion, without, T).has_value());
  EXPECT_EQ(motion.support(T), 0);
  EXPECT_TRUE(outliers(motion, without, T).empty());
}

// Mask of what the check found in the last of some frames, where a board goes to the left and a
// host tells what `told` makes of the camera's true x.
cv::Mat found_mask(double (*told)(double)) {
  CheckAlone check(small_camera());
  const cv::Mat none = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
  cv::Mat mask;
  for (int i = 0; i < 12; ++i) {
    const double x = 0.05 * i;
    const std::optional<Eigen::Isometry3d> step =
        i ? std::optional<Eigen::Isometry3d>(pose(told(0.05), 0, 0).inverse()) : std::nullopt;
    mask = none.clone();
    for (const Instance& s : check.find(render(0.033 * i, pose(x, 0, 0), 0.3 - 0.05 * i), step))
      mask(s.box).setTo(255, s.mask);
    check.correct(pose(told(x), 0, 0));
    check.remember(none);
  }
  return mask;
}

TEST(MotionCheck, DoubtsAHostThatFollowsThePerson) {
  const RgbdFrame last = render(0, pose(0.55, 0, 0), -0.25);
  const cv::Mat board = last.depth < 2 * 5000;
  for (auto told : {+[](double x) { return x; }, +[](double x) { return 2 * x; }}) {
    const cv::Mat mask = found_mask(told);
    EXPECT_GT(cv::countNonZero(mask & board), 0.6 * cv::countNonZero(board)) << told(1);
    EXPECT_LT(cv::countNonZero(mask & ~board), 0.06 * kWidth * kHeight) << told(1);
  }
}

TEST(MotionCheck, NeedsNoHostThatTellsItsMotion) {
  CheckAlone check(small_camera());
  const cv::Mat none = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
  int frames = 0;
  for (int i = 0; i < 12; ++i) {
    frames +=
        !check.find(render(0.033 * i, pose(0.05 * i, 0, 0), 0.3 - 0.05 * i), std::nullopt).empty();
    EXPECT_EQ(check.ego.motion().has_value(), i > 0);
    check.remember(none);
  }
  EXPECT_GT(frames, 5);
}

// At the start of a sequence clusters of outlier corners count at once. Where the camera's motion
// was lost while it rotates, they must show twice.
TEST(MotionCheck, WantsToSeeOutliersTwiceAfterTheCamerasMotionWasLost) {
  const cv::Mat none = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
  CheckAlone check(small_camera());
  std::vector<int> frames;  // with a mover
  for (int i = 0; i < 13; ++i) {
    RgbdFrame frame = render(0.1 * i, pose(0, 0, -i), 0.2 - 0.02 * i);
    if (i == 8) frame.color.setTo(90);  // nothing to follow, into this frame and out of it
    if (!check.find(frame, std::nullopt).empty()) frames.push_back(i);
    check.remember(none);
  }
  ASSERT_FALSE(frames.empty());
  EXPECT_EQ(frames.front(), 1);
  EXPECT_EQ(*std::upper_bound(frames.begin(), frames.end() - 1, 8), 11) << "10 if once is enough";
}

// Its depth is the same wherever it was a moment ago, but its pattern goes along.
TEST(MotionCheck, FindsABoardThatSlidesInItsOwnPlane) {
  CheckAlone check(small_camera());
  const cv::Mat none = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
  double least = 1;
  for (int i = 0; i < 40; ++i) {
    const RgbdFrame frame = render(0.033 * i, pose(0, 0, 0), 0.2 - 0.01 * i, 0.3);
    const cv::Mat board = frame.depth < 2 * 5000;
    cv::Mat mask = none.clone();
    for (const Instance& s : check.find(frame, std::nullopt)) mask(s.box).setTo(255, s.mask);
    check.remember(mask);
    if (i < 32) continue;  // its leading edge has gone far enough
    least = std::min(least, cv::countNonZero(mask & board) / double(cv::countNonZero(board)));
    EXPECT_LT(cv::countNonZero(mask & ~board), 0.01 * kWidth * kHeight) << i;
  }
  EXPECT_GT(least, 0.85)
      << "0.5 if its inside is taken for static, or its corners are not followed; "
         "0.77 if these have a say on the camera's motion";
}

}  // namespace
}  // namespace stillpoint
