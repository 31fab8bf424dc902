// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/objects_file.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "temporary_folder.hpp"

namespace stillpoint {
namespace {

DynamicObject full_object() {
  DynamicObject o;
  o.id = 3, o.class_name = "a \"cat\", large", o.score = 0.75f;
  o.box = {10, 20, 30, 40};
  o.predicted = true, o.tracked_s = 1.5, o.unseen_s = 0.25, o.depth_m = 2.5f;
  o.in_camera.emplace();
  o.in_camera->centroid_m = {0.5, -0.25, 2.5};
  o.in_camera->velocity_m_s = {1, 0, -0.5};
  o.in_camera->covariance = 0.25 * Eigen::Matrix<double, 6, 6>::Identity();
  o.in_world = o.in_camera;
  o.in_world->centroid_m.x() = 7;
  return o;
}

TEST(ObjectsFile, WhatIsWrittenIsRead) {
  const TemporaryFolder folder;
  DynamicObject bare;
  bare.class_name = "";
  bare.box = {1, 2, 3, 4};
  folder.write("objects.csv", objects_csv_header() + objects_csv(12.5, {full_object(), bare}) +
                                  objects_csv(13, {}) + objects_csv(13.5, {bare}));
  const auto frames = read_objects(folder / "objects.csv");
  ASSERT_EQ(frames.size(), 2u) << "a frame without objects has no line";
  EXPECT_EQ(frames[0].timestamp, 12.5);
  ASSERT_EQ(frames[0].objects.size(), 2u);
  const DynamicObject &o = frames[0].objects[0], &expected = full_object();
  EXPECT_EQ(o.id, 3);
  EXPECT_EQ(o.class_name, expected.class_name);
  EXPECT_EQ(o.score, 0.75f);
  EXPECT_EQ(o.box, expected.box);
  EXPECT_TRUE(o.predicted);
  EXPECT_EQ(o.tracked_s, 1.5);
  EXPECT_EQ(o.unseen_s, 0.25);
  EXPECT_EQ(o.depth_m, 2.5f);
  ASSERT_TRUE(o.in_camera && o.in_world);
  EXPECT_EQ(o.in_camera->centroid_m, expected.in_camera->centroid_m);
  EXPECT_EQ(o.in_camera->velocity_m_s, expected.in_camera->velocity_m_s);
  EXPECT_EQ(o.in_camera->covariance(5, 5), 0.25);
  EXPECT_EQ(o.in_world->centroid_m.x(), 7);
  EXPECT_FALSE(frames[0].objects[1].in_camera || frames[0].objects[1].in_world);
  EXPECT_EQ(frames[0].objects[1].depth_m, 0);
  EXPECT_EQ(frames[0].objects[1].class_name, "");
}

TEST(ObjectsFile, EachLineHasAFieldForEachColumn) {
  const auto commas = [](const std::string& s) { return std::count(s.begin(), s.end(), ','); };
  DynamicObject bare;
  EXPECT_EQ(commas(objects_csv(1, {bare})), commas(objects_csv_header()));
}

TEST(ObjectsFile, SaysWhatIsWrong) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& bytes) {
    read_objects(folder.write("objects.csv", bytes));
  };
  EXPECT_ERROR(read(""), "objects.csv", "found an empty file");
  EXPECT_ERROR(read("a,b\n"), "expected the header");
  EXPECT_ERROR(read(objects_csv_header() + "1,2\n"), "line 2: expected 30 fields, found 2");
  std::string line = objects_csv(1, {full_object()});
  line.replace(line.find("2.5000"), 6, "far");
  EXPECT_ERROR(read(objects_csv_header() + line), "field 12, found \"far\"");
  EXPECT_ERROR(read_objects(folder / "none.csv"), "no such file");
}

}  // namespace
}  // namespace stillpoint
