// SPDX-License-Identifier: BSD-2-Clause
// Small valid files with bytes changed, cut out, doubled or cut off: every loader returns or throws
// stillpoint::Error, and nothing else. The generator is seeded, so a failure can be repeated.
#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "../io/temporary_folder.hpp"
#include "stillpoint/evaluation/coverage.hpp"
#include "stillpoint/evaluation/trajectory_error.hpp"
#include "stillpoint/io/mask_folder.hpp"
#include "stillpoint/io/tum_sequence.hpp"

namespace {

// STILLPOINT_FUZZ_ROUNDS makes it as long as one likes.
int rounds() {
  const char* given = std::getenv("STILLPOINT_FUZZ_ROUNDS");
  return given ? std::atoi(given) : 300;
}

std::string mutated(std::string bytes, std::mt19937& random) {
  const auto place = [&] { return bytes.empty() ? 0 : random() % bytes.size(); };
  for (unsigned changes = 1 + random() % 4; changes > 0 && !bytes.empty(); --changes) {
    static const char interesting[] = {'\0', '\n', ' ', '-', '9', '#', ':', '\x7F', '\xFF'};
    switch (random() % 7) {
      case 0:
        bytes[place()] = static_cast<char>(random());
        break;
      case 1:
        bytes[place()] ^= static_cast<char>(1u << random() % 8);
        break;
      case 2:
        bytes[place()] = interesting[random() % sizeof(interesting)];
        break;
      case 3:
        bytes.erase(place(), 1 + random() % 8);
        break;
      case 4:
        bytes.insert(place(), bytes.substr(place(), 1 + random() % 16));
        break;
      case 5:
        bytes.insert(place(), random() % 2 ? "nan" : "1e999");
        break;
      default:
        if (random() % 4 == 0) bytes.resize(place());
    }
  }
  return bytes;
}

/// Runs `load` on mutations of `bytes` under `name`; returns how many of them it accepted.
template <class Load>
int fuzz(const TemporaryFolder& folder, const std::string& name, const std::string& bytes,
         Load&& load) {
  folder.write(name, bytes);
  EXPECT_NO_THROW(load()) << name << " as it is";
  std::mt19937 random(20250613);
  int accepted = 0;
  for (int round = 0; round < rounds(); ++round) {
    folder.write(name, mutated(bytes, random));
    try {
      load();
      ++accepted;
    } catch (const stillpoint::Error& e) {
      EXPECT_NE(std::string(e.what()).size(), 0u);
    } catch (const std::exception& e) {
      ADD_FAILURE() << name << ", round " << round << ": not stillpoint::Error but: " << e.what();
      break;
    }
  }
  folder.write(name, bytes);
  EXPECT_LT(accepted, rounds()) << name << ": no mutation was refused; does it read the file?";
  return accepted;
}

cv::Mat pattern(int type) {
  cv::Mat m(12, 16, type);
  unsigned state = 1;
  for (int y = 0; y < m.rows; ++y)
    for (std::size_t x = 0; x < static_cast<std::size_t>(m.cols) * m.elemSize(); ++x)
      m.ptr(y)[x] = static_cast<uchar>((state = state * 1664525u + 1013904223u) >> 24);
  return m;
}

struct FuzzLoaders : testing::Test {
  void SetUp() override {
    folder.write("rgb.txt", "# color\n1.000000 rgb/1.000000.png\n2.000000 rgb/2.000000.jpg\n");
    folder.write("depth.txt", "# depth\n1.010 depth/1.01.png\n2.010 depth/2.01.png\n");
    folder.write("groundtruth.txt", kTrajectory);
    folder.write("camera.yaml", kCamera);
    std::filesystem::create_directories(folder / "rgb");
    std::filesystem::create_directories(folder / "depth");
    stillpoint::write_image(folder / "rgb/1.000000.png", pattern(CV_8UC3));
    stillpoint::write_image(folder / "rgb/2.000000.jpg", pattern(CV_8UC3));
    stillpoint::write_image(folder / "depth/1.01.png", pattern(CV_16UC1));
    stillpoint::write_image(folder / "depth/2.01.png", pattern(CV_16UC1));
    stillpoint::write_image(folder / "mask.png", pattern(CV_8UC1) / 8);
    // libpng and libjpeg tell stderr about each broken image.
    testing::internal::CaptureStderr();
  }
  void TearDown() override { testing::internal::GetCapturedStderr(); }

  std::string bytes_of(const std::string& name) const {
    return stillpoint::read_file(folder / name, "file");
  }
  void open_and_load_all() const {
    const stillpoint::TumSequence sequence(folder.path());
    for (std::size_t i = 0; i < sequence.size(); ++i) check_frame(sequence.load(i));
  }

  static constexpr const char* kTrajectory =
      "# timestamp tx ty tz qx qy qz qw\n1.0 0.5 0 0 0 0 0 1\n1.1 0.6 0.1 0 0 0 0.1 1\n"
      "1.2 0.7 0.3 -1e-3 0.5 0.5 0.5 0.5\n1.3 0.9 0.2 0 0 0 0 -1\n";
  static constexpr const char* kCamera =
      "%YAML:1.0\nCamera.fx: 50.5 # pixels\nCamera.fy: 50\nCamera.cx: 8\nCamera.cy: 6\n"
      "Camera.width: 16\nCamera.height: 12\nCamera.RGB: 1\nDepthMapFactor: 5000.0\n";
  TemporaryFolder folder;
};

TEST_F(FuzzLoaders, Lists) {
  for (const char* name : {"rgb.txt", "depth.txt"})
    fuzz(folder, name, bytes_of(name), [&] { open_and_load_all(); });
  fuzz(folder, "a.txt", "1.0 rgb/1.000000.png 1.01 depth/1.01.png\n", [&] {
    stillpoint::TumSequence::Settings settings;
    settings.associations = folder / "a.txt";
    stillpoint::TumSequence(folder.path(), settings).load(0);
  });
}

TEST_F(FuzzLoaders, Trajectories) {
  const stillpoint::Trajectory truth = stillpoint::read_trajectory(folder / "groundtruth.txt");
  fuzz(folder, "estimate.txt", kTrajectory, [&] {
    const auto estimate = stillpoint::read_trajectory(folder / "estimate.txt");
    stillpoint::coverage(truth, estimate);
    stillpoint::coverage(estimate, truth);
    stillpoint::rpe(truth, estimate);
    stillpoint::rpe(truth, estimate, stillpoint::RpeSettings::tum());
    stillpoint::ate(truth, estimate);
    stillpoint::trajectory_text(estimate);
  });
}

TEST_F(FuzzLoaders, Cameras) {
  fuzz(folder, "camera.yaml", kCamera,
       [&] { EXPECT_TRUE(stillpoint::load_camera(folder / "camera.yaml").valid()); });
}

TEST_F(FuzzLoaders, Pictures) {
  for (const char* name : {"rgb/1.000000.png", "rgb/2.000000.jpg", "depth/1.01.png"})
    fuzz(folder, name, bytes_of(name), [&] { open_and_load_all(); });
  fuzz(folder, "mask.png", bytes_of("mask.png"), [&] {
    const cv::Mat labels = stillpoint::read_labels(folder / "mask.png", cv::Size(16, 12));
    stillpoint::labels_from_instances(stillpoint::instances_from_labels(labels, "person", 1),
                                      labels.size());
  });
}

}  // namespace
