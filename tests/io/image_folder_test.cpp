// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/image_folder.hpp"

#include <gtest/gtest.h>

#include "temporary_folder.hpp"

namespace {

using namespace stillpoint;

void image(const TemporaryFolder& folder, const std::string& name, int type = CV_8UC3) {
  std::filesystem::create_directories((folder / name).parent_path());
  write_image(folder / name, cv::Mat(6, 8, type, cv::Scalar::all(70)));
}

TEST(ImageFolder, SortsNumbersInNamesAsNumbers) {
  TemporaryFolder folder;
  for (const char* name : {"img10.png", "img9.jpg", "img2.PNG", "img010b.png"}) {
    image(folder, std::string(name) == "img2.PNG" ? "img2.png" : name);
    if (std::string(name) == "img2.PNG")
      std::filesystem::rename(folder / "img2.png", folder / "img2.PNG");
  }
  folder.write("notes.txt", "no image");
  ImageFolderSettings settings;
  settings.fps = 10;
  const TumSequence images = image_folder(folder.path(), settings);
  ASSERT_EQ(images.size(), 4u);
  EXPECT_EQ(images.entry(0).stem, "img2");
  EXPECT_EQ(images.entry(1).stem, "img9");
  EXPECT_EQ(images.entry(2).stem, "img10");
  EXPECT_EQ(images.entry(3).stem, "img010b");
  EXPECT_EQ(images.timestamps(), (std::vector<double>{0, 0.1, 0.2, 0.3}));
  EXPECT_EQ(images.load(1).color.size(), cv::Size(8, 6));
  EXPECT_TRUE(images.load(1).depth.empty());
  EXPECT_FALSE(images.camera());
}

TEST(ImageFolder, TakesTimestampsAndDepthByTheirNames) {
  TemporaryFolder folder;
  for (const char* name : {"rgb/12.5.jpg", "rgb/12.75.jpg", "rgb/13.0.jpg"}) image(folder, name);
  image(folder, "depth/12.75.png", CV_16UC1);
  ImageFolderSettings settings;
  settings.depth = folder / "depth";
  settings.camera = Camera::tum_fr3();
  settings.camera->width = settings.camera->height = 0;
  settings.camera->depth_units_per_m = 1000;
  const TumSequence images = image_folder(folder / "rgb", settings);
  EXPECT_EQ(images.timestamps(), (std::vector<double>{12.5, 12.75, 13}));
  EXPECT_TRUE(images.entry(0).depth_path.empty());
  EXPECT_FLOAT_EQ(depth_m_at(images.load(1), 3, 3), 0.07f);
}

TEST(ImageFolder, SortsTimestampsThoughTrailingZerosAreMissing) {
  TemporaryFolder folder;
  for (const char* name : {"1548266469.98.png", "1548266469.8817.png", "1548266469.81544.png"})
    image(folder, name);
  const TumSequence images = image_folder(folder.path());
  EXPECT_EQ(images.timestamps(),
            (std::vector<double>{1548266469.81544, 1548266469.8817, 1548266469.98}));
  EXPECT_EQ(images.entry(0).stem, "1548266469.81544");
}

TEST(ImageFolder, RefusesWhatIsNone) {
  TemporaryFolder folder;
  EXPECT_ERROR(image_folder(folder / "absent"), "no such folder");
  EXPECT_ERROR(image_folder(folder.path()), "expected PNG or JPEG images, found none");
  image(folder, "a.png");
  image(folder, "a.jpg");
  EXPECT_ERROR(image_folder(folder.path()), "one image called a");
  ImageFolderSettings settings;
  settings.fps = 0;
  EXPECT_ERROR(image_folder(folder.path(), settings), "fps");
}

}  // namespace
