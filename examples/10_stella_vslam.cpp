// SPDX-License-Identifier: BSD-2-Clause
//
// A runner for stella_vslam with the front end. Nothing in stella_vslam is changed.
//
// Usage: 10_stella_vslam VOCABULARY CONFIG SEQUENCE MASKS TRAJECTORY [extractor]
//   MASKS: a folder; `none`: the front end without a network; `off`: the host alone
//   extractor: the mask goes to the host's extractor

#include <stella_vslam/config.h>
#include <stella_vslam/data/frame.h>
#include <stella_vslam/system.h>

#include <chrono>
#include <iostream>
#include <stillpoint/backends/mask_files.hpp>
#include <stillpoint/backends/stella_vslam.hpp>
#include <stillpoint/io/tum_sequence.hpp>
#include <thread>

int main(int argc, char** argv) try {
  if (argc != 6 && argc != 7) {
    std::cerr << "usage: " << argv[0]
              << " VOCABULARY CONFIG SEQUENCE MASKS TRAJECTORY [extractor]\n";
    return 2;
  }
  const stillpoint::TumSequence sequence(argv[3]);
  const stillpoint::Camera camera = sequence.camera().value_or(stillpoint::Camera::tum_fr3());
  const std::string masks = argv[4];
  const bool alone = masks == "off";
  std::unique_ptr<stillpoint::MaskFilesSegmenter> segmenter;
  if (!alone && masks != "none")
    segmenter =
        std::make_unique<stillpoint::MaskFilesSegmenter>(masks, stillpoint::frame_names(sequence));
  stillpoint::FrontEnd front_end({}, camera, segmenter.get());

  stella_vslam::system slam(std::make_shared<stella_vslam::config>(argv[2]), argv[1]);
  slam.startup();
  stillpoint::StellaVslam<stella_vslam::system> adapter(
      slam, front_end, camera,
      argc == 7 ? stillpoint::StellaMasking::kByExtractor
                : stillpoint::StellaMasking::kAfterExtraction);

  std::size_t tracked = 0;
  double total_ms = 0, mask_ms = 0, kept = 0, extracted = 0;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const stillpoint::RgbdFrame frame = sequence.load(i);
    const auto start = std::chrono::steady_clock::now();
    if (alone)
      tracked += slam.feed_RGBD_frame(frame.color, frame.depth, frame.timestamp) != nullptr;
    else
      tracked += adapter.track_rgbd(frame) != nullptr;
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    total_ms += 1000 * took.count();
    const stillpoint::FrameStats& s = front_end.stats();
    mask_ms += s.motion_ms + s.compensation_ms + s.depth_ms + s.probability_ms;
    kept += s.kept, extracted += s.keypoints;
    // As fast as the camera, so that the host's other threads have their time.
    std::this_thread::sleep_for(std::chrono::duration<double>(1.0 / 30) - took);
  }
  slam.shutdown();
  slam.save_frame_trajectory(argv[5], "TUM");
  const double n = static_cast<double>(sequence.size());
  std::cout << tracked << " of " << sequence.size() << " frames tracked, " << total_ms / n
            << " ms per frame";
  if (!alone) std::cout << ", of these front end " << mask_ms / n;
  if (extracted > 0) std::cout << "; " << kept / n << " of " << extracted / n << " keypoints kept";
  std::cout << "\n";
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
