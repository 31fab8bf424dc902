// SPDX-License-Identifier: BSD-2-Clause
//
// The whole line on a folder in the layout of the TUM benchmark: masks from files, front end,
// tracker, trajectory, error. What `stillpoint run` does, without its options.
//
// Usage: 04_tum_folder SEQUENCE OUT.txt    (SEQUENCE has masks/, and camera.yaml or is a TUM fr3)

#include <iostream>
#include <stillpoint/backends/mask_files.hpp>
#include <stillpoint/backends/rgbd_slam/slam_system.hpp>
#include <stillpoint/evaluation/coverage.hpp>
#include <stillpoint/evaluation/trajectory_error.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/io/run_sequence.hpp>
#include <stillpoint/io/tum_sequence.hpp>

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: " << argv[0] << " SEQUENCE OUT.txt\n";
    return 2;
  }
  const stillpoint::TumSequence sequence(argv[1]);
  const stillpoint::Camera camera = sequence.camera().value_or(stillpoint::Camera::tum_fr3());
  stillpoint::MaskFilesSegmenter segmenter(sequence.folder() / "masks",
                                           stillpoint::frame_names(sequence));
  stillpoint::FrontEnd front_end(stillpoint::FrontEndSettings(), camera, &segmenter);
  stillpoint::rgbd_slam::SlamSystem tracker(camera);

  stillpoint::SequenceRun run;
  run.trajectory = argv[2];
  run.tracked = [&](const stillpoint::TrackedFrame& t) {
    if (!t.T_world_camera) std::cout << "frame " << t.index << ": lost\n";
    for (const std::string& name : stillpoint::status_names(front_end.stats().status))
      std::cout << "frame " << t.index << ": " << name << "\n";
  };
  const stillpoint::Trajectory estimate =
      stillpoint::run_sequence(sequence, front_end, tracker, run);
  if (sequence.has_groundtruth()) {
    const stillpoint::Trajectory truth = sequence.groundtruth();
    const auto covered = stillpoint::coverage(truth, estimate, sequence.timestamps());
    std::cout << "ATE RMSE " << stillpoint::ate(truth, estimate).rmse_m << " m, coverage "
              << 100 * covered.share << " %\n";
  }
} catch (const stillpoint::Error& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
