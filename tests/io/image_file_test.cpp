// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/image_file.hpp"

#include <gtest/gtest.h>

#include "temporary_folder.hpp"

namespace {

using stillpoint::read_color;
using stillpoint::read_depth;
using stillpoint::write_image;

// An image that does not pack to nothing.
cv::Mat pattern(int type) {
  cv::Mat m(48, 64, type);
  unsigned state = 1;
  for (int y = 0; y < m.rows; ++y)
    for (std::size_t x = 0; x < m.cols * m.elemSize(); ++x)
      m.ptr(y)[x] = static_cast<uchar>((state = state * 1664525u + 1013904223u) >> 24);
  return m;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  if (a.type() != b.type() || a.size() != b.size()) return false;
  for (int y = 0; y < a.rows; ++y)
    if (std::memcmp(a.ptr(y), b.ptr(y), a.cols * a.elemSize()) != 0) return false;
  return true;
}

TEST(ImageFile, ReadsPngAndJpeg) {
  TemporaryFolder folder;
  write_image(folder / "c.png", pattern(CV_8UC3));
  EXPECT_TRUE(same(read_color(folder / "c.png"), pattern(CV_8UC3)));
  write_image(folder / "d.png", pattern(CV_16UC1));
  EXPECT_TRUE(same(read_depth(folder / "d.png"), pattern(CV_16UC1)));
  write_image(folder / "c.jpg", cv::Mat(48, 64, CV_8UC3, cv::Scalar(10, 100, 200)));
  const cv::Mat jpeg = read_color(folder / "c.jpg");
  ASSERT_EQ(jpeg.size(), cv::Size(64, 48));
  EXPECT_NEAR(jpeg.at<cv::Vec3b>(20, 20)[2], 200, 6) << "BGR, as OpenCV loads it";
  // The ending does not matter, the content does.
  std::filesystem::rename(folder / "c.png", folder / "really_a_png.jpg");
  EXPECT_TRUE(same(read_color(folder / "really_a_png.jpg"), pattern(CV_8UC3)));
}

TEST(ImageFile, EveryTruncationOfAPngOrJpegIsAnError) {
  TemporaryFolder folder;
  for (const char* name : {"c.png", "c.jpg", "d.png"}) {
    write_image(folder / name, pattern(name[0] == 'd' ? CV_16UC1 : CV_8UC3));
    const std::string bytes = stillpoint::read_file(folder / name, "image");
    for (std::size_t n = 0; n < bytes.size(); n += n < 64 ? 1 : 97) {
      const auto path = folder.write("cut", bytes.substr(0, n));
      const std::string message = error_of([&] { read_color(path); });
      ASSERT_FALSE(message.empty()) << name << " cut to " << n << " bytes was read";
      ASSERT_NE(message.find("cut"), std::string::npos) << message;
    }
    EXPECT_ERROR(read_color(folder.write("cut", bytes.substr(0, bytes.size() - 2))), "truncated");
  }
}

TEST(ImageFile, RefusesOtherFiles) {
  TemporaryFolder folder;
  EXPECT_ERROR(read_color(folder / "none.png"), "none.png", "no such file");
  EXPECT_ERROR(read_color(folder.path()), "a folder");
  EXPECT_ERROR(read_color(folder.write("empty.png", "")), "an empty file");
  EXPECT_ERROR(read_color(folder.write("text.png", "hello, world")), "another kind of file");
}

TEST(ImageFile, RefusesDepthOfAnotherType) {
  TemporaryFolder folder;
  write_image(folder / "d.png", pattern(CV_8UC1));
  EXPECT_ERROR(read_depth(folder / "d.png"), "d.png", "16 bits", "CV_8UC1", "write depth as");
  write_image(folder / "d.png", pattern(CV_16UC3));
  EXPECT_ERROR(read_depth(folder / "d.png"), "CV_16UC3");
}

TEST(ImageFile, RefusesAHugeSizeInABrokenHeader) {
  TemporaryFolder folder;
  write_image(folder / "c.png", pattern(CV_8UC3));
  std::string bytes = stillpoint::read_file(folder / "c.png", "image");
  bytes[16] = 0, bytes[17] = 1;  // width 65536 and more
  EXPECT_ERROR(read_color(folder.write("wide.png", bytes)), "wide.png", "a size of");
  bytes[17] = 0, bytes[18] = 100, bytes[22] = 50;  // 25664 x 12848: over 100 million pixels
  EXPECT_ERROR(read_color(folder.write("big.png", bytes)), "a size of");
  bytes[22] = 10;  // a size that is allowed, but for which there is too little data
  EXPECT_ERROR(read_color(folder.write("short.png", bytes)), "too little data");

  write_image(folder / "c.jpg", pattern(CV_8UC3));
  bytes = stillpoint::read_file(folder / "c.jpg", "image");
  const std::size_t frame = bytes.find("\xFF\xC0");
  ASSERT_NE(frame, std::string::npos);
  bytes[frame + 5] = bytes[frame + 7] = 40;  // 10240 x 10240 and more
  EXPECT_ERROR(read_color(folder.write("big.jpg", bytes)), "big.jpg", "a size of");
  bytes[frame + 5] = bytes[frame + 7] = 20;
  EXPECT_ERROR(read_color(folder.write("short.jpg", bytes)), "too little data");
}

TEST(ImageFile, SaysWhenItCannotWrite) {
  TemporaryFolder folder;
  EXPECT_ERROR(write_image(folder / "no/such/a.png", pattern(CV_8UC1)), "a.png", "folder");
  EXPECT_ERROR(write_image(folder / "a.nonsense", pattern(CV_8UC1)), "nonsense");
  EXPECT_ERROR(write_image(folder / "a.png", cv::Mat()), "empty");
}

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
TEST(ImageFile, TheOldNameWritesTheSame) {
  TemporaryFolder folder;
  write_image(folder / "new.png", pattern(CV_8UC3));
  stillpoint::write_picture(folder / "old.png", pattern(CV_8UC3));
  EXPECT_EQ(cv::norm(read_color(folder / "new.png"), read_color(folder / "old.png")), 0);
}
#pragma GCC diagnostic pop

}  // namespace
