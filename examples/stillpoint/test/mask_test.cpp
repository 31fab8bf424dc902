// SPDX-License-Identifier: BSD-2-Clause
//
// `stillpoint mask`, as a user drives it.

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <opencv2/imgproc.hpp>

#include "cli_fixture.hpp"
#include "stillpoint/io/objects_file.hpp"

namespace stillpoint {
namespace {

class Mask : public Cli {
 protected:
  static fs::path seg_file(std::size_t i) {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(path("seg")))
      if (entry.path().extension() == ".png") files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    return files.at(i);
  }

  /// The same PNGs, byte for byte, and at least one.
  static void expect_same_images(const std::string& a, const std::string& b) {
    EXPECT_EQ(files_in(path(a), ".png"), files_in(path(b), ".png"));
    EXPECT_GT(files_in(path(a), ".png"), 0u);
    for (const auto& entry : fs::directory_iterator(path(a)))
      if (entry.path().extension() == ".png") {
        EXPECT_EQ(text_of(entry.path()), text_of(path(b) / entry.path().filename()))
            << entry.path();
      }
  }
};

TEST_F(Mask, ByTheNetworkOnlyCopiesMasksInItsFormat) {
  const Result r = run("mask walk --network-only --masks walk/masks_gt --out seg");
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(files_in(path("seg"), ".png"), 12u);
  for (const auto& entry : fs::directory_iterator(path("seg"))) {
    if (entry.path().extension() != ".png") continue;
    const cv::Mat made = cv::imread(entry.path().string(), cv::IMREAD_UNCHANGED);
    const cv::Mat truth = cv::imread((path("walk") / "masks_gt" / entry.path().filename()).string(),
                                     cv::IMREAD_UNCHANGED);
    EXPECT_EQ(cv::countNonZero((made > 0) != (truth > 0)), 0) << entry.path();
  }
  // What is there is not asked for again.
  fs::remove(seg_file(0));
  const Result again = run("mask walk --network-only --masks walk/masks_gt --out seg");
  EXPECT_NE(again.out.find("1 masks written, 11 were there"), std::string::npos) << again.out;
  // The old name does the same, and says so.
  const Result old = run("segment walk --masks walk/masks_gt --out seg_old");
  EXPECT_EQ(old.code, 0) << old.err;
  EXPECT_NE(old.err.find("mask --network-only"), std::string::npos) << old.err;
  expect_same_images("seg", "seg_old");
}

TEST_F(Mask, RunsTheFrontEndInEachFormat) {
  const std::string masks = "mask walk --masks walk/masks ";
  const Result r = run(masks + "--out m_labels --masked-depth m_depth --objects m.csv");
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_TRUE(r.err.empty()) << r.err;
  EXPECT_EQ(lines_of(r.out), 5) << r.out;
  EXPECT_NE(r.out.find("12 masks written"), std::string::npos) << r.out;
  ASSERT_EQ(run(masks + "--out m_dynamic --format dynamic").code, 0);
  ASSERT_EQ(run(masks + "--out m_static --format static").code, 0);
  ASSERT_EQ(run(masks + "--out m_colmap --format colmap").code, 0);
  bool missed = false;
  for (const auto& entry : fs::directory_iterator(path("walk") / "rgb")) {
    const std::string name = entry.path().filename().string(), stem = entry.path().stem().string();
    const auto image = [&](const std::string& folder, const std::string& file) {
      const cv::Mat m = cv::imread((path(folder) / file).string(), cv::IMREAD_UNCHANGED);
      EXPECT_FALSE(m.empty()) << folder << "/" << file;
      return m;
    };
    const cv::Mat dynamic = image("m_dynamic", stem + ".png");
    ASSERT_EQ(dynamic.type(), CV_8UC1);
    EXPECT_EQ(cv::countNonZero(dynamic), cv::countNonZero(dynamic == 255));
    EXPECT_EQ(cv::countNonZero(image("m_static", stem + ".png") != ~dynamic), 0);
    EXPECT_EQ(cv::countNonZero(image("m_colmap", name + ".png") != ~dynamic), 0);
    // Labels are not dilated, so they lie within.
    const cv::Mat labels = image("m_labels", stem + ".png");
    EXPECT_GT(cv::countNonZero(labels), 0);
    EXPECT_EQ(cv::countNonZero((labels > 0) & ~dynamic), 0);
    const cv::Mat given = image("walk/masks", stem + ".png");
    missed = missed || cv::countNonZero((labels > 0) & (given == 0)) > 0;
    cv::Mat depth = image("walk/depth", stem + ".png");
    depth.setTo(0, dynamic);
    EXPECT_EQ(cv::countNonZero(depth != image("m_depth", stem + ".png")), 0);
  }
  EXPECT_TRUE(missed) << "the front end added nothing to the given masks";
  const std::vector<ObjectsOfFrame> objects = read_objects(path("m.csv"));
  EXPECT_GT(objects.size(), 9u);  // frames with people
  EXPECT_EQ(objects.front().objects.front().class_name, "person");
  // `run` takes the labels back.
  EXPECT_EQ(run("run walk --masks m_labels --out m_run --tracker vo --frames 3").code, 0);
}

TEST_F(Mask, TakesAFolderOfImages) {
  fs::create_directories(path("data") / "images");
  Json transforms = {{"fl_x", 300}, {"frames", Json::array()}};
  for (const auto& entry : fs::directory_iterator(path("walk") / "rgb")) {
    fs::copy(entry.path(), path("data") / "images");
    transforms["frames"].push_back({{"file_path", "images/" + entry.path().filename().string()}});
  }
  // With depth and camera, the same as of the sequence.
  ASSERT_EQ(run("mask walk --masks walk/masks --out f_tum").code, 0);
  const Result same =
      run("mask data/images --masks walk/masks --depth walk/depth "
          "--camera walk/camera.yaml --out f_images");
  ASSERT_EQ(same.code, 0) << same.err;
  expect_same_images("f_tum", "f_images");

  // Without: said. In images/, as COLMAP and nerfstudio have them.
  expect_error("mask data --masks walk/masks --out data/masks --format nerfstudio", 1,
               "transforms.json");
  std::ofstream(path("data") / "transforms.json") << transforms.dump();
  const Result nerf = run("mask data --masks walk/masks --out data/masks --format nerfstudio");
  ASSERT_EQ(nerf.code, 0) << nerf.err;
  EXPECT_NE(nerf.err.find("without depth"), std::string::npos) << nerf.err;
  const Json made = json_of(path("data") / "masks" / "transforms.json");
  EXPECT_EQ(made["fl_x"], 300);
  ASSERT_EQ(made["frames"].size(), 12u);
  for (const Json& frame : made["frames"]) {
    const std::string file = frame["mask_path"];
    EXPECT_EQ(file.compare(0, 6, "masks/"), 0) << file;
    const cv::Mat mask = cv::imread((path("data") / file).string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(mask.type(), CV_8UC1) << file;
    EXPECT_EQ(cv::countNonZero(mask != 0), cv::countNonZero(mask == 255));
  }
  transforms["frames"].push_back({{"file_path", "images/one_more.png"}});
  std::ofstream(path("data") / "transforms.json") << transforms.dump();
  expect_error("mask walk/rgb --masks walk/masks --out f_more --format nerfstudio", 1,
               "transforms.json");

  // COLMAP reads the folders within, too.
  fs::create_directories(path("data") / "images" / "more");
  fs::copy(fs::directory_iterator(path("walk") / "rgb")->path(), path("data") / "images" / "more");
  const Result colmap =
      run("mask data --masks walk/masks --out data/images/masks --format colmap --fps 10");
  EXPECT_EQ(colmap.code, 0) << colmap.err;
  EXPECT_NE(colmap.err.find("1 images lie in folders within"), std::string::npos) << colmap.err;
  EXPECT_NE(colmap.err.find("--fps does not count"), std::string::npos) << colmap.err;

  expect_error("mask walk/rgb --out f", 1, "without depth only a segmenter");
  expect_error("mask data --masks walk/masks --depth walk/depth --out f", 1, "needs the camera");
  expect_error("mask walk --depth walk/depth --out f", 1, "is a sequence");
  expect_error("mask walk --out f --network-only --segmenter none", 1, "needs a segmenter");
  expect_error("mask data --masks walk/masks --masked-depth d --out f", 1, "needs depth");
  expect_error("mask walk --masks walk/masks_gt --out walk/masks", 1, "masks of something else");
  expect_error("mask nowhere --masks walk/masks --out f", 1, "no such folder");
  expect_error("mask walk --out f --format gray", 2, "colmap");
  EXPECT_FALSE(fs::exists(path("f")));
}

TEST_F(Mask, GoesOnAfterAKillWithTheSameBytes) {
  const std::string options = "mask walk --masks walk/masks --format dynamic --masked-depth ";
  ASSERT_EQ(run(options + "k_depth --out k_whole").code, 0);
  const std::string killed = "( cd '" + folder_->string() + "'; '" STILLPOINT_CLI "' " + options +
                             "k_depth2 --out k_cut >/dev/null 2>&1 & pid=$!; "
                             "while kill -0 $pid 2>/dev/null && "
                             "[ $(ls k_cut 2>/dev/null | wc -l) -lt 5 ]; do :; done; "
                             "kill -9 $pid; wait $pid 2>/dev/null )";
  EXPECT_EQ(std::system(killed.c_str()) == 0, false);
  const std::size_t there = files_in(path("k_cut"), ".png");
  EXPECT_GT(there, 1u);
  const Result r = run(options + "k_depth2 --out k_cut");
  ASSERT_EQ(r.code, 0) << r.err;
  expect_same_images("k_whole", "k_cut");
  expect_same_images("k_depth", "k_depth2");
  const Result again = run(options + "k_depth2 --out k_cut");
  EXPECT_NE(again.out.find("0 masks written, 12 were there"), std::string::npos) << again.out;
  expect_error(options + "k_depth2 --out k_cut --set dilation_px=3", 1,
               "masks with another settings");
  std::ofstream(path("other.yaml"))
      << "Camera.fx: 300\nCamera.fy: 300\nCamera.cx: 160\nCamera.cy: 120\nDepthMapFactor: 1000\n";
  expect_error(options + "k_depth2 --out k_cut --camera other.yaml", 1,
               "masks with another camera");
}

TEST_F(Mask, MaskedDepthHasAFolderOfItsOwn) {
  const std::string mask = "mask walk --masks walk/masks --frames 3 ";
  expect_error(mask + "--out o --masked-depth o", 1, "another folder than --out");
  expect_error(mask + "--out o --masked-depth walk/depth", 1, "holds the depth that is read");
  EXPECT_FALSE(fs::exists(path("o")));
  // What is there of other masks is no result of these.
  ASSERT_EQ(run(mask + "--out o1 --masked-depth od").code, 0);
  ASSERT_EQ(run(mask + "--out o2 --masked-depth od --set dilation_px=25").code, 0);
  ASSERT_EQ(run(mask + "--out o3 --masked-depth od3 --set dilation_px=25").code, 0);
  expect_same_images("od", "od3");
  expect_error(mask + "--out o1 --masked-depth od4", 1, "another masked_depth");
}

TEST_F(Mask, ImagesOfOneNameAreRefused) {
  for (const char* n : {"0", "1"}) fs::create_directories(path("same") / n);
  std::vector<fs::path> images;
  for (const auto& entry : fs::directory_iterator(path("walk") / "rgb"))
    images.push_back(entry.path());
  for (int i = 0; i < 2; ++i)
    fs::copy_file(images[static_cast<std::size_t>(i)],
                  path("same") / std::to_string(i) / "color.png");
  std::ofstream(path("same") / "rgb.txt") << "1.0 0/color.png\n1.1 1/color.png\n";
  expect_error("mask same --masks walk/masks --out same_out", 1, "have one name");
}

}  // namespace
}  // namespace stillpoint
