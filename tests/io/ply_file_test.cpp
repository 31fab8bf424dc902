// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/ply_file.hpp"

#include <gtest/gtest.h>

#include "stillpoint/io/text_file.hpp"
#include "temporary_folder.hpp"

namespace {

using stillpoint::ColoredPoint;

TEST(PlyFile, WritesTheBytesOfTheFormat) {
  TemporaryFolder folder;
  ColoredPoint point;
  point.position = {1.0f, -2.0f, 0.5f};
  point.bgr = {10, 20, 255};
  stillpoint::write_ply(folder / "map.ply", {point});
  const std::string expected =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n" +
      std::string("\x00\x00\x80\x3F\x00\x00\x00\xC0\x00\x00\x00\x3F\xFF\x14\x0A", 15);
  EXPECT_EQ(stillpoint::read_file(folder / "map.ply", "map"), expected);
}

TEST(PlyFile, WritesManyPointsAndNone) {
  TemporaryFolder folder;
  std::vector<ColoredPoint> points(20000);
  for (std::size_t i = 0; i < points.size(); ++i)
    points[i].position = Eigen::Vector3f(static_cast<float>(i), 0, 0);
  stillpoint::write_ply(folder / "map.ply", points);
  const std::string bytes = stillpoint::read_file(folder / "map.ply", "map");
  const std::size_t begin = bytes.find("end_header\n") + 11;
  ASSERT_EQ(bytes.size(), begin + points.size() * 15);
  for (std::size_t i : {std::size_t{0}, std::size_t{4369}, std::size_t{19999}}) {
    float x;
    std::memcpy(&x, bytes.data() + begin + i * 15, sizeof(x));  // the test runs little-endian
    EXPECT_EQ(x, static_cast<float>(i));
  }
  stillpoint::write_ply(folder / "map.ply", {});
  EXPECT_NE(stillpoint::read_file(folder / "map.ply", "map").find("element vertex 0\n"),
            std::string::npos);
}

TEST(PlyFile, SaysWhenItCannotWrite) {
  TemporaryFolder folder;
  EXPECT_ERROR(stillpoint::write_ply(folder / "no/such/map.ply", {}), "map.ply", "folder");
}

}  // namespace
