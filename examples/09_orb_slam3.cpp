// SPDX-License-Identifier: BSD-2-Clause
//
// A runner for ORB_SLAM3 with the front end, C++14. Add it to your copy of ORB_SLAM3 with the patch
// beside the adapter, backends/orb_slam3/orb_slam3.patch; docs/orb_slam3.md says how. For ORB_SLAM2
// write 2 for 3 in three places.
//
// Usage: stillpoint_runner VOCABULARY SETTINGS SEQUENCE MASKS TRAJECTORY
//   SEQUENCE: a TUM folder with associations.txt   MASKS: its folder of labels; `none`: the front
//   end without a network; `off`: the host alone   TRAJECTORY: to be written
// A frame that can't be read ends the run; the trajectory up to it is written all the same.

#include <System.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iostream>
#include <opencv2/core/utils/filesystem.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <stillpoint/backends/orb_slam3.hpp>
#include <thread>

struct Entry {
  double timestamp;
  std::string color, depth;
};

std::vector<Entry> read_associations(const std::string& folder) {
  std::ifstream file(folder + "/associations.txt");
  if (!file) throw stillpoint::Error(folder + "/associations.txt: no such file");
  std::vector<Entry> entries;
  std::string line, ignored;
  while (std::getline(file, line)) {
    Entry e;
    std::istringstream words(line);
    if (line[0] != '#' && words >> e.timestamp >> e.color >> ignored >> e.depth)
      entries.push_back(e);
  }
  if (entries.empty())
    throw stillpoint::Error(folder +
                            "/associations.txt: expected lines of `time color time depth`");
  return entries;
}

cv::Mat read_image(const std::string& file, int flags) {
  const cv::Mat image = cv::imread(file, flags);
  if (image.empty()) throw stillpoint::Error(file + ": missing, or no image");
  return image;
}

cv::Mat read_labels(const std::string& file) {
  const cv::Mat labels = read_image(file, cv::IMREAD_UNCHANGED);
  if (labels.type() != CV_8UC1)
    throw stillpoint::Error(file +
                            ": expected labels, one channel of 8 bits, 0 = background; found " +
                            std::to_string(labels.channels()) + " of " +
                            std::to_string(8 * labels.elemSize1()) + " bits");
  return labels;
}

// A mask is named like the color image.
std::string mask_file(const std::string& masks, const Entry& entry) {
  const std::size_t slash = entry.color.rfind('/') + 1;
  return masks + "/" + entry.color.substr(slash, entry.color.rfind('.') - slash) + ".png";
}

// Without this, a mistyped folder would be a network that has no result in any frame.
void check_masks(const std::string& masks, const std::vector<Entry>& entries) {
  if (!cv::utils::fs::isDirectory(masks))
    throw stillpoint::Error(masks + ": no such folder of masks (or `none`, or `off`)");
  std::size_t found = 0;
  for (const Entry& entry : entries)
    if (std::ifstream(mask_file(masks, entry)) && found++ == 0)
      read_labels(mask_file(masks, entry));
  if (found == 0)
    throw stillpoint::Error(masks + ": no frame has a mask there; expected names like " +
                            mask_file(masks, entries[0]));
  std::cout << found << " of " << entries.size() << " frames have a mask" << std::endl;
}

// The people in an image of labels, 0 = background, k = person k; with 0 and 255 only, each
// connected part is one. Without a file the network has no result, and the front end predicts.
stillpoint::Segmentation read_people(const std::string& masks, const Entry& entry) {
  const std::string file = mask_file(masks, entry);
  stillpoint::Segmentation people;
  if (!std::ifstream(file)) return people;
  cv::Mat labels = read_labels(file);
  people.available = true;
  people.timestamp = entry.timestamp;
  const bool parts = cv::countNonZero(labels) == cv::countNonZero(labels == 255);
  if (parts) cv::connectedComponents(labels.clone(), labels, 8, CV_16U);
  double most = 0;
  cv::minMaxLoc(labels, nullptr, &most);
  for (int k = 1; k <= static_cast<int>(most); ++k) {
    const cv::Mat person = labels == k;
    if (cv::countNonZero(person) >= (parts ? 50 : 1))
      people.instances.push_back(stillpoint::instance_from_mask(person));
  }
  return people;
}

stillpoint::Camera read_camera(const std::string& settings) {
  const cv::FileStorage file(settings, cv::FileStorage::READ);
  const auto number = [&](const char* name) {
    const cv::FileNode node = file[std::string("Camera1.") + name];
    return node.empty() ? static_cast<double>(file[std::string("Camera.") + name])
                        : static_cast<double>(node);
  };
  stillpoint::Camera camera;
  camera.fx = number("fx"), camera.fy = number("fy");
  camera.cx = number("cx"), camera.cy = number("cy");
  camera.k1 = number("k1"), camera.k2 = number("k2");
  camera.p1 = number("p1"), camera.p2 = number("p2"), camera.k3 = number("k3");
  const cv::FileNode factor = file["RGBD.DepthMapFactor"];
  camera.depth_units_per_m = static_cast<double>(factor.empty() ? file["DepthMapFactor"] : factor);
  return camera;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

struct Run {
  int tracked = 0;
  double kept = 0, extracted = 0;  // keypoints
  std::vector<double> mask_ms, hook_ms, total_ms;
};

void print(const Run& run, std::size_t frames, const stillpoint::HostFrontEnd* front_end) {
  std::cout << run.tracked << " of " << frames << " frames tracked, " << median(run.total_ms)
            << " ms per frame (median)";
  if (front_end != nullptr && !run.total_ms.empty()) {
    const double n = static_cast<double>(run.total_ms.size());
    std::cout << ", of these mask " << median(run.mask_ms) << ", hook " << median(run.hook_ms)
              << "; " << run.kept / n << " of " << run.extracted / n
              << " keypoints kept; for 1000 static ones set nFeatures to "
              << front_end->features_for(1000);
    if (front_end->stats().filtered == 0)
      std::cout
          << "\nThe hook was never called: is its line in Frame.cc, and the library built anew?";
  }
  std::cout << "\n";
  if (run.tracked == 0) std::cout << "No trajectory is written: no frame was tracked.\n";
}

int main(int argc, char** argv) try {
  if (argc != 6) {
    std::cerr << "usage: " << argv[0] << " VOCABULARY SETTINGS SEQUENCE MASKS TRAJECTORY\n";
    return 2;
  }
  const std::string folder = argv[3], masks = argv[4];
  const bool alone = masks == "off";
  const std::vector<Entry> entries = read_associations(folder);
  if (!alone && masks != "none") check_masks(masks, entries);
  const stillpoint::Camera camera = read_camera(argv[2]);
  stillpoint::HostFrontEnd front_end(camera);
  ORB_SLAM3::System slam(argv[1], argv[2], ORB_SLAM3::System::RGBD, false);

  Run run;
  std::string failure;
  for (const Entry& entry : entries) try {
      stillpoint::RgbdFrame frame;
      frame.color = read_image(folder + "/" + entry.color, cv::IMREAD_COLOR);
      frame.depth = read_image(folder + "/" + entry.depth, cv::IMREAD_UNCHANGED);
      frame.timestamp = entry.timestamp;
      frame.depth_units_per_m = camera.depth_units_per_m;
      const stillpoint::Segmentation people =
          alone || masks == "none" ? stillpoint::Segmentation() : read_people(masks, entry);

      const auto start = std::chrono::steady_clock::now();
      if (alone) {
        slam.TrackRGBD(frame.color, frame.depth, frame.timestamp);
        run.tracked += slam.GetTrackingState() == 2;
      } else {
        run.tracked += stillpoint::orb_slam3::track_rgbd(slam, front_end, frame, people);
      }
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
      const stillpoint::HostStats stats = front_end.stats();
      run.total_ms.push_back(1000 * took.count());
      run.mask_ms.push_back(stats.mask_ms);
      run.hook_ms.push_back(stats.hook_ms);
      run.kept += stats.kept, run.extracted += stats.keypoints;
      // As fast as the camera, so that the host's other threads have their time.
      std::this_thread::sleep_for(std::chrono::duration<double>(1.0 / 30) - took);
    } catch (const std::exception& error) {
      failure = "frame " + std::to_string(run.total_ms.size() + 1) + " of " +
                std::to_string(entries.size()) + ": " + error.what();
      break;
    }
  slam.Shutdown();
  if (run.tracked > 0) slam.SaveTrajectoryTUM(argv[5]);  // the host needs a keyframe for it
  print(run, entries.size(), alone ? nullptr : &front_end);
  if (failure.empty()) return 0;
  std::cerr << failure << "\n";
  return 1;
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
