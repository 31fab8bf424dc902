// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/camera_file.hpp"

#include <gtest/gtest.h>

#include "temporary_folder.hpp"

namespace {

using stillpoint::Camera;
using stillpoint::load_camera;

const char kSmall[] = "Camera.fx: 500\nCamera.fy: 501\nCamera.cx: 320\nCamera.cy: 240\n";

TEST(CameraFile, ReadsOrbSlam2) {
  TemporaryFolder folder;
  const Camera c = load_camera(folder.write("c.yaml",
                                            "%YAML:1.0\n\n#-----\n# Camera Parameters\n"
                                            "Camera.fx: 517.306408 # focal length\n"
                                            "Camera.fy: 516.469215\nCamera.cx: 318.643040\n"
                                            "Camera.cy: 255.313989\n\nCamera.k1: 0.262383\n"
                                            "Camera.k2: -0.953104\nCamera.p1: -0.005358\n"
                                            "Camera.p2: 0.002628\nCamera.k3: 1.163314\n\n"
                                            "Camera.width: 640\nCamera.height: 480\n"
                                            "Camera.fps: 25.0\nCamera.RGB: 0\n"
                                            "# Deptmap values factor\nDepthMapFactor: 1000.0\n"
                                            "exposure_ms: 12.5\nORBextractor.nFeatures: 1000\n"));
  const Camera fr1 = Camera::tum_fr1();
  EXPECT_DOUBLE_EQ(c.fx, fr1.fx);
  EXPECT_DOUBLE_EQ(c.fy, fr1.fy);
  EXPECT_DOUBLE_EQ(c.cx, fr1.cx);
  EXPECT_DOUBLE_EQ(c.cy, fr1.cy);
  EXPECT_EQ(c.distortion(), fr1.distortion());
  EXPECT_EQ(c.width, 640);
  EXPECT_EQ(c.height, 480);
  EXPECT_DOUBLE_EQ(c.fps, 25);
  EXPECT_DOUBLE_EQ(c.depth_units_per_m, 1000);
  EXPECT_DOUBLE_EQ(c.exposure_s, 0.0125);
}

TEST(CameraFile, ReadsOrbSlam3AndAFileWithoutHeader) {
  TemporaryFolder folder;
  const Camera c = load_camera(folder.write(
      "c.yaml",
      "File.version: \"1.0\"\r\nCamera.type: \"PinHole\"\r\nCamera1.fx: 535.4\r\n"
      "Camera1.fy: 539.2\r\nCamera1.cx: 320.1\r\nCamera1.cy: 247.6\r\nCamera1.k1: 0.25\r\n"
      "RGBD.DepthMapFactor: 5000.0 # 1.0 for ROS_bag\r\n"
      "Tlr: !!opencv-matrix\r\n  rows: 3\r\n  cols: 4\r\n  dt: f\r\n"
      "  data: [1.0, 0.0, 0.0, 0.1,\r\n   0, 1]\r\n"));
  EXPECT_DOUBLE_EQ(c.fx, 535.4);
  EXPECT_DOUBLE_EQ(c.cy, 247.6);
  EXPECT_DOUBLE_EQ(c.k1, 0.25);
  EXPECT_DOUBLE_EQ(c.k3, 0);
  EXPECT_DOUBLE_EQ(c.depth_units_per_m, 5000);
  EXPECT_EQ(c.width, 0) << "a size that is not given stays unknown";
}

TEST(CameraFile, ReadsNestedNames) {
  TemporaryFolder folder;
  const Camera c = load_camera(folder.write(
      "c.yaml",
      "# stella\nCamera:\n  name: \"TUM\"\n  model: \"perspective\"\n  fx: 1\n  fy: 2\n  cx: 3\n"
      "  cy: 4\n  cols: 640\n  rows: 480\n  color_order: \"BGR\"\n  depthmap_factor: 1000\n"
      "Other:\n  fx: 9\n"));
  EXPECT_DOUBLE_EQ(c.fx, 1);
  EXPECT_DOUBLE_EQ(c.cy, 4);
  EXPECT_EQ(c.width, 640);
  EXPECT_DOUBLE_EQ(c.depth_units_per_m, 1000);
}

TEST(CameraFile, SaysWhatIsWrong) {
  TemporaryFolder folder;
  const auto load = [&](const std::string& text) { load_camera(folder.write("c.yaml", text)); };
  EXPECT_ERROR(load_camera(folder / "none.yaml"), "none.yaml", "no such file");
  EXPECT_ERROR(load(""), "c.yaml", "Camera.fx", "no such line");
  EXPECT_ERROR(load(kSmall), "DepthMapFactor", "5000", "1000");
  EXPECT_ERROR(load(std::string(kSmall) + "DepthMapFactor: 0\n"), "positive DepthMapFactor");
  EXPECT_ERROR(load(std::string(kSmall) + "DepthMapFactor: nan\n"), "line 5", "nan");
  EXPECT_ERROR(load("Camera.fx: many\n"), "line 1", "a number for Camera.fx", "\"many\"");
  EXPECT_ERROR(load("Camera.fx: -3\n"), "positive Camera.fx");
  const std::string whole = std::string(kSmall) + "DepthMapFactor: 1000\n";
  EXPECT_NO_THROW(load(whole));
  EXPECT_ERROR(load(whole + "Camera.width: -640\n"), "Camera.width");
  EXPECT_ERROR(load(whole + "Camera.width: 1e300\n"), "Camera.width");
  EXPECT_ERROR(load(whole + "Camera.fps: 0\n"), "Camera.fps");
  EXPECT_ERROR(load(whole + "exposure_ms: -1\n"), "exposure_ms");
  EXPECT_ERROR(load(whole + "Camera.type: \"KannalaBrandt8\"\n"), "line 6", "pinhole",
               "KannalaBrandt8");
}

TEST(CameraFile, RefusesARationalLens) {
  TemporaryFolder folder;
  const std::string small = std::string(kSmall) + "DepthMapFactor: 1000\nCamera.k1: 0.4\n";
  EXPECT_NO_THROW(load_camera(folder.write("c.yaml", small + "Camera.k4: 0\nCamera.k6: 0.0\n")));
  for (const char* name : {"Camera.k4", "Camera.k5", "Camera.k6"})
    EXPECT_ERROR(load_camera(folder.write("c.yaml", small + name + ": 0.5\n")), "c.yaml", name,
                 "rational");
}

TEST(CameraFile, BuiltInCamerasByName) {
  EXPECT_DOUBLE_EQ(stillpoint::camera_by_name("fr1").fx, 517.306408);
  EXPECT_DOUBLE_EQ(stillpoint::camera_by_name("fr2").fx, 520.908620);
  EXPECT_DOUBLE_EQ(stillpoint::camera_by_name("fr3").fx, 535.4);
  EXPECT_DOUBLE_EQ(stillpoint::camera_by_name("bonn").fx, 542.822841);
  EXPECT_ERROR(stillpoint::camera_by_name("kinect"), "fr1, fr2, fr3, bonn", "kinect");
  TemporaryFolder folder;
  const auto path = folder.write("c.yaml", std::string(kSmall) + "DepthMapFactor: 1000\n");
  EXPECT_DOUBLE_EQ(stillpoint::camera_from(path.string()).fx, 500);
  EXPECT_DOUBLE_EQ(stillpoint::camera_from("bonn").fx, 542.822841);
  EXPECT_ERROR(stillpoint::camera_from("kinect"), "fr1, fr2, fr3, bonn", "YAML", "kinect");
}

}  // namespace
