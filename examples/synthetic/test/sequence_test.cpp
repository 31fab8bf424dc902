// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/sequence.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <thread>

namespace stillpoint {
namespace {

SyntheticSettings small(SyntheticMotion motion, int people) {
  SyntheticSettings s;
  s.motion = motion, s.people = people, s.frames = 40;
  s.width = 160, s.height = 120;
  return s;
}

const SyntheticSequence& walking() {
  static const SyntheticSequence sequence(small(SyntheticMotion::kRpy, 2));
  return sequence;
}
const SyntheticSequence& empty_room() {
  static const SyntheticSequence sequence(small(SyntheticMotion::kRpy, 0));
  return sequence;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() &&
         cv::norm(a.reshape(1), b.reshape(1), cv::NORM_INF) == 0;
}

/// FNV-1a over an image's bytes.
std::uint64_t checksum(const cv::Mat& image) {
  std::uint64_t h = 14695981039346656037ull;
  for (int y = 0; y < image.rows; ++y)
    for (std::size_t x = 0; x < image.elemSize() * static_cast<std::size_t>(image.cols); ++x)
      h = (h ^ image.ptr<uchar>(y)[x]) * 1099511628211ull;
  return h;
}

TEST(SyntheticSequence, FrameHasTheShapesItPromises) {
  const SyntheticFrame f = walking().frame(5);
  const cv::Size size(160, 120);
  EXPECT_EQ(f.color.type(), CV_8UC3);
  EXPECT_EQ(f.depth.type(), CV_16UC1);
  EXPECT_EQ(f.exact_depth.type(), CV_32FC1);
  EXPECT_EQ(f.labels.type(), CV_8UC1);
  EXPECT_EQ(f.limbs.type(), CV_8UC1);
  for (const cv::Mat* m : {&f.color, &f.depth, &f.exact_depth, &f.labels, &f.limbs})
    EXPECT_EQ(m->size(), size);
  EXPECT_NEAR(f.timestamp, 1300000000.0 + 5 / 30.0, 1e-6);
  EXPECT_NEAR(walking().camera().fx, 525.0 / 4, 1e-9);
  EXPECT_NEAR(walking().camera().cx, 79.5, 1e-9);
  ASSERT_FALSE(f.blur.empty());
  EXPECT_EQ(f.blur[0].label, 0);
  int pixels = 0;
  for (const SyntheticBlur& b : f.blur) pixels += b.pixels;
  EXPECT_EQ(pixels, 160 * 120);
  EXPECT_GT(cv::countNonZero(f.exact_depth > 0), 160 * 120 * 999 / 1000) << "holes in the room";
}

TEST(SyntheticSequence, FramesDoNotDependOnOrderObjectOrThread) {
  const SyntheticFrame first = walking().frame(7);
  const SyntheticSequence other(small(SyntheticMotion::kRpy, 2));
  SyntheticFrame second;
  std::thread thread([&] { other.frame(3), second = other.frame(7); });
  const SyntheticFrame third = other.frame(12);
  thread.join();
  EXPECT_TRUE(same(first.color, second.color));
  EXPECT_TRUE(same(first.depth, second.depth));
  EXPECT_TRUE(same(first.labels, second.labels));
  EXPECT_FALSE(same(first.color, third.color));
}

TEST(SyntheticSequence, BytesAreTheSameInEveryBuild) {
#if defined(__FMA__) || defined(__aarch64__)
  GTEST_SKIP() << "compilers may fuse multiplication and addition for this processor";
#endif
  // Checksums of one build. They change with the scene; when the scene did not change, compiler or
  // flags changed the images, which they must not.
  const SyntheticFrame f = walking().frame(11);
  EXPECT_EQ(checksum(f.color), 4296433399630068609u);
  EXPECT_EQ(checksum(f.depth), 14139829483622119123u);
  EXPECT_EQ(checksum(f.labels), 1853870441036686280u);
}

TEST(SyntheticSequence, CameraAndRoomDoNotDependOnPeople) {
  const SyntheticFrame with = walking().frame(9), without = empty_room().frame(9);
  EXPECT_EQ(with.T_world_camera.matrix(), without.T_world_camera.matrix());
  EXPECT_EQ(with.timestamp, without.timestamp);
  EXPECT_EQ(cv::countNonZero(without.labels), 0);
  int seen = 0;
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x)
      if (with.labels.at<uchar>(y, x) == 0) {
        ++seen;
        EXPECT_EQ(with.exact_depth.at<float>(y, x), without.exact_depth.at<float>(y, x));
      }
  EXPECT_GT(seen, 160 * 120 / 4);
  EXPECT_LT(seen, 160 * 120);
}

TEST(SyntheticSequence, SeedMakesAnotherRoomAndPath) {
  SyntheticSettings s = small(SyntheticMotion::kRpy, 2);
  s.seed = 2;
  const SyntheticSequence other(s);
  EXPECT_FALSE(same(walking().frame(4).color, other.frame(4).color));
  EXPECT_GT((walking().T_world_camera(1).matrix() - other.T_world_camera(1).matrix()).norm(), 1e-3);
}

TEST(SyntheticSequence, DepthAndPosesFitTogether) {
  const SyntheticFrame a = empty_room().frame(4), b = empty_room().frame(10);
  const Camera& camera = empty_room().camera();
  const Eigen::Isometry3d T_b_a = b.T_world_camera.inverse() * a.T_world_camera;
  int compared = 0, agree = 0;
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) {
      const Eigen::Vector3d p =
          T_b_a * camera.unproject(x, y, static_cast<double>(a.exact_depth.at<float>(y, x)));
      if (p.z() < 0.2) continue;
      const Eigen::Vector2d at = camera.project(p);
      const int u = static_cast<int>(std::floor(at.x() + 0.5));
      const int v = static_cast<int>(std::floor(at.y() + 0.5));
      if (u < 0 || v < 0 || u >= 160 || v >= 120) continue;
      ++compared;
      // At the surface seen there, up to the slope over half a pixel.
      const double z = static_cast<double>(b.exact_depth.at<float>(v, u));
      agree += std::abs(z - p.z()) < 0.03 * p.z();
    }
  EXPECT_GT(compared, 160 * 120 / 2);
  EXPECT_GT(agree / static_cast<double>(compared), 0.93);
}

TEST(SyntheticSequence, ColorsFitThePosesToo) {
  // Without blur and noise, a static point has nearly the same color in two frames.
  SyntheticSettings s = small(SyntheticMotion::kXyz, 0);
  s.shutter_s = 0, s.color_noise = 0;
  const SyntheticSequence sequence(s);
  const SyntheticFrame a = sequence.frame(10), b = sequence.frame(13);
  const Camera& camera = sequence.camera();
  const Eigen::Isometry3d T_b_a = b.T_world_camera.inverse() * a.T_world_camera;
  double placed = 0, unmoved = 0;
  int compared = 0;
  for (int y = 1; y < 119; ++y)
    for (int x = 1; x < 159; ++x) {
      const Eigen::Vector3d p =
          T_b_a * camera.unproject(x, y, static_cast<double>(a.exact_depth.at<float>(y, x)));
      const Eigen::Vector2d at = camera.project(p);
      const int u = static_cast<int>(std::floor(at.x())), v = static_cast<int>(std::floor(at.y()));
      if (u < 0 || v < 0 || u >= 159 || v >= 119) continue;
      const double wx = at.x() - u, wy = at.y() - v;
      const auto green = [&](int i, int j) {
        return static_cast<double>(b.color.at<cv::Vec3b>(j, i)[1]);
      };
      const double there = (green(u, v) * (1 - wx) + green(u + 1, v) * wx) * (1 - wy) +
                           (green(u, v + 1) * (1 - wx) + green(u + 1, v + 1) * wx) * wy;
      const double here = static_cast<double>(a.color.at<cv::Vec3b>(y, x)[1]);
      placed += std::abs(there - here), unmoved += std::abs(green(x, y) - here);
      ++compared;
    }
  EXPECT_GT(compared, 10000);
  EXPECT_LT(placed / compared, 9);
  EXPECT_LT(placed, 0.7 * unmoved);
}

double sharpness(const cv::Mat& color) {
  double sum = 0;
  for (int y = 1; y < color.rows - 1; ++y)
    for (int x = 1; x < color.cols - 1; ++x) {
      const auto g = [&](int i, int j) { return static_cast<int>(color.at<cv::Vec3b>(j, i)[1]); };
      const double l = 4 * g(x, y) - g(x - 1, y) - g(x + 1, y) - g(x, y - 1) - g(x, y + 1);
      sum += l * l;
    }
  return sum / (color.rows * color.cols);
}

TEST(SyntheticSequence, ExposureBlursAsFarAsThingsMove) {
  SyntheticSettings s = small(SyntheticMotion::kRpy, 1);
  s.width = 320, s.height = 240, s.color_noise = 0;
  double last_sharpness = 1e9, last_blur = -1;
  for (const double shutter_s : {0.0, 0.02, 0.05}) {
    s.shutter_s = shutter_s;
    const SyntheticSequence sequence(s);
    const SyntheticFrame f = sequence.frame(20);
    const double now = sharpness(f.color), blur = f.blur[0].blur_px;
    if (shutter_s == 0) {
      EXPECT_EQ(blur, 0);
    }
    EXPECT_LT(now, last_sharpness);
    EXPECT_GT(blur, last_blur);
    last_sharpness = now, last_blur = blur;
  }
  EXPECT_GT(last_blur, 2);
}

TEST(SyntheticSequence, BlurIsTheMeanOverTheExposureAndNotAFilter) {
  // The average of many short exposures inside the shutter's time is the long exposure.
  SyntheticSettings s = small(SyntheticMotion::kRpy, 2);
  s.color_noise = 0, s.shutter_s = 0.05;
  const SyntheticFrame blurred = SyntheticSequence(s).frame(15);
  SyntheticSettings fast = s;
  fast.shutter_s = 0, fast.fps = 960, fast.frames = 960;  // frame 480 is at the same time
  const SyntheticSequence sharp(fast);
  cv::Mat sum(120, 160, CV_64FC3, cv::Scalar::all(0));
  int count = 0;
  for (int i = 480 - 22; i <= 480 + 22; i += 4, ++count) {
    cv::Mat light;
    sharp.frame(i).color.convertTo(light, CV_64FC3);
    sum += light.mul(light);
  }
  cv::Mat mean, image;
  cv::sqrt(sum / count, mean);
  blurred.color.convertTo(image, CV_64FC3);
  const double difference = cv::norm(mean, image, cv::NORM_L1) / (3 * 160 * 120);
  cv::Mat middle;
  sharp.frame(480).color.convertTo(middle, CV_64FC3);
  const double unblurred = cv::norm(middle, image, cv::NORM_L1) / (3 * 160 * 120);
  EXPECT_LT(difference, 3.0);
  EXPECT_GT(unblurred, 3 * difference);
}

TEST(SyntheticSequence, BlurOfAPersonIsItsOwn) {
  SyntheticSettings s = small(SyntheticMotion::kStatic, 2);
  const SyntheticSequence sequence(s);
  const SyntheticFrame f = sequence.frame(20);
  ASSERT_GE(f.blur.size(), 2u);
  EXPECT_LT(f.blur[0].blur_px, 0.5) << "the room is still";
  EXPECT_GT(f.blur[1].blur_px, 1) << "the person walks near the camera";
  EXPECT_GT(sequence.expected_blur_px(f.blur[1].label, 20), 0.3 * f.blur[1].blur_px);
  EXPECT_LT(sequence.expected_blur_px(f.blur[1].label, 20), 2 * f.blur[1].blur_px);
  EXPECT_EQ(sequence.expected_blur_px(99, 20), 0);
}

TEST(SyntheticSequence, PeopleCoverMuchOfThePictureAtTimes) {
  for (const SyntheticMotion motion : {SyntheticMotion::kXyz, SyntheticMotion::kRpy}) {
    SyntheticSettings s = small(motion, 2);
    s.frames = 150, s.shutter_s = 0;
    const SyntheticSequence sequence(s);
    double most = 0, mean = 0;
    for (int i = 0; i < 150; i += 15) {
      const cv::Mat labels = sequence.frame(i).labels;
      const double cover = cv::countNonZero(labels) / static_cast<double>(labels.total());
      most = std::max(most, cover), mean += cover / 10;
    }
    EXPECT_GT(most, 0.25);
    EXPECT_LT(most, 0.65);
    EXPECT_GT(mean, 0.08);
  }
}

TEST(SyntheticSequence, ManyCornersEverywhere) {
  SyntheticSettings s = small(SyntheticMotion::kXyz, 1);
  s.width = 640, s.height = 480;
  const SyntheticSequence sequence(s);
  for (const int i : {0, 30}) {
    cv::Mat gray;
    cv::cvtColor(sequence.frame(i).color, gray, cv::COLOR_BGR2GRAY);
    std::vector<cv::Point2f> corners;
    cv::goodFeaturesToTrack(gray, corners, 3000, 0.01, 4);
    EXPECT_GT(corners.size(), 1000u) << i;
    std::vector<int> cells(16, 0);
    for (const cv::Point2f& c : corners)
      ++cells[static_cast<std::size_t>(static_cast<int>(c.y / 120) * 4 +
                                       static_cast<int>(c.x / 160))];
    for (const int n : cells) EXPECT_GT(n, 3);
  }
}

TEST(SyntheticSequence, MoversHaveLabelsOfTheirOwn) {
  SyntheticSettings s = small(SyntheticMotion::kStatic, 1);
  s.movers = 2, s.frames = 300, s.shutter_s = 0;
  const SyntheticSequence sequence(s);
  double most = 0;
  bool carton = false, door = false;
  for (int i = 0; i < 300; i += 15) {
    const cv::Mat labels = sequence.frame(i).labels;
    const cv::Mat movers = labels >= synthetic::kFirstMoverLabel;
    most = std::max(most, cv::countNonZero(movers) / static_cast<double>(labels.total()));
    carton |= cv::countNonZero(labels == synthetic::kFirstMoverLabel) > 0;
    door |= cv::countNonZero(labels == synthetic::kFirstMoverLabel + 1) > 0;
  }
  EXPECT_TRUE(carton);
  EXPECT_TRUE(door);
  EXPECT_GT(most, 0.25);
  EXPECT_LT(most, 0.6);
}

TEST(SyntheticSequence, SettingsOutOfRangeAreNamed) {
  const auto message = [](const std::function<void(SyntheticSettings&)>& change) {
    SyntheticSettings s;
    change(s);
    try {
      const SyntheticSequence sequence(s);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const auto names = [](const std::string& text, const char* part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_TRUE(names(message([](auto& s) { s.people = -1; }), "people"));
  EXPECT_TRUE(names(message([](auto& s) { s.people = 21; }), "people"));
  EXPECT_TRUE(names(message([](auto& s) { s.movers = 3; }), "movers"));
  EXPECT_TRUE(names(message([](auto& s) { s.shutter_s = -0.01; }), "shutter_s"));
  EXPECT_TRUE(names(message([](auto& s) { s.shutter_s = std::nan(""); }), "shutter_s"));
  EXPECT_TRUE(names(message([](auto& s) { s.width = 0; }), "width"));
  EXPECT_TRUE(names(message([](auto& s) { s.height = 100000; }), "height"));
  EXPECT_TRUE(names(message([](auto& s) { s.fps = 0; }), "fps"));
  EXPECT_TRUE(names(message([](auto& s) { s.frames = -3; }), "frames"));
  EXPECT_THROW(walking().frame(-1), Error);
  EXPECT_THROW(walking().frame(40), Error);
}

}  // namespace
}  // namespace stillpoint
