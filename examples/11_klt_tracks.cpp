// SPDX-License-Identifier: BSD-2-Clause
//
// A front end that tracks corners from image to image (KLT), as OpenVINS, maplab or cuVSLAM do, and
// three ways to keep its tracks off people: none, select(), select_tracked(). A corner of the wall
// that a person comes to hide is dragged along by his outline before it is in the mask; for each
// way the program prints how many tracks end on people, and how many end more than 2 pixels from
// the corner that they began at.
//
// Usage: 11_klt_tracks SEQUENCE    (a TUM folder with masks/, masks_gt/ and groundtruth.txt, as
//   `stillpoint synth` makes it)

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <stillpoint/backends/mask_files.hpp>
#include <stillpoint/core/mask_functions.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/io/mask_folder.hpp>
#include <stillpoint/io/tum_sequence.hpp>
#include <utility>
#include <vector>

namespace {

enum class Way { kPlain, kSelect, kSelectTracked };

struct Track {
  cv::Point2f now, before;
  Eigen::Vector3d world;  // the corner where it began; NaN without depth
};

struct Counts {
  int ended = 0, on_people = 0, judged = 0, dragged = 0;
};

// All of a sequence that the ways share.
struct Frame {
  stillpoint::RgbdFrame rgbd;
  cv::Mat gray, people;  // people: exact, 255
  Eigen::Isometry3d T_world_camera;
};

void end(const Track& track, const Frame& last, const stillpoint::Camera& camera, Counts& counts) {
  ++counts.ended;
  const cv::Point p(cvRound(track.now.x), cvRound(track.now.y));
  const cv::Rect image(cv::Point(), last.people.size());
  counts.on_people += image.contains(p) && last.people.at<uchar>(p) != 0;
  const Eigen::Vector3d corner = last.T_world_camera.inverse() * track.world;
  if (!(corner.z() > 0.1)) return;
  const Eigen::Vector2d seen = camera.project(corner);
  ++counts.judged;
  counts.dragged += std::hypot(seen.x() - static_cast<double>(track.now.x),
                               seen.y() - static_cast<double>(track.now.y)) > 2;
}

Counts run(const std::vector<Frame>& frames, const stillpoint::Camera& camera,
           stillpoint::Segmenter& segmenter, Way way) {
  constexpr std::size_t kTracks = 300;
  constexpr int kMarginPx = 11;  // half of the window that KLT compares, and one
  stillpoint::FrontEnd front_end({}, camera, &segmenter);
  std::vector<Track> tracks;
  Counts counts;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Frame& frame = frames[i];
    const cv::Mat mask = front_end.compute_mask(frame.rgbd).image;
    if (!tracks.empty()) {
      std::vector<cv::Point2f> from, to, back;
      for (const Track& t : tracks) from.push_back(t.now);
      std::vector<uchar> found, found_back;
      cv::calcOpticalFlowPyrLK(frames[i - 1].gray, frame.gray, from, to, found, cv::noArray());
      cv::calcOpticalFlowPyrLK(frame.gray, frames[i - 1].gray, to, back, found_back, cv::noArray());
      // Lost are those that don't come back, as in every such front end.
      std::vector<Track> tracked;
      for (std::size_t k = 0; k < tracks.size(); ++k) {
        const bool lost = !found[k] || !found_back[k] || cv::norm(back[k] - from[k]) > 1;
        if (lost)
          end(tracks[k], frames[i - 1], camera, counts);
        else
          tracked.push_back({to[k], from[k], tracks[k].world});
      }
      std::vector<cv::Point2f> now, before;
      for (const Track& t : tracked) now.push_back(t.now), before.push_back(t.before);
      const stillpoint::Selection* selection = way == Way::kPlain ? nullptr
                                               : way == Way::kSelect
                                                   ? &front_end.select(now)
                                                   : &front_end.select_tracked(now, before);
      tracks.clear();
      for (std::size_t k = 0; k < tracked.size(); ++k) {
        if (!selection || selection->is_kept(k))
          tracks.push_back(tracked[k]);
        else  // it was last used in the frame before
          end({before[k], before[k], tracked[k].world}, frames[i - 1], camera, counts);
      }
    }
    // New corners, away from those that there are.
    cv::Mat allowed = way == Way::kPlain ? cv::Mat(frame.gray.size(), CV_8UC1, cv::Scalar(255))
                                         : stillpoint::feature_mask(mask, kMarginPx);
    for (const Track& t : tracks) cv::circle(allowed, t.now, 10, cv::Scalar(0), cv::FILLED);
    std::vector<cv::Point2f> corners;
    if (tracks.size() < kTracks)
      cv::goodFeaturesToTrack(frame.gray, corners, static_cast<int>(kTracks - tracks.size()), 0.01,
                              10, allowed);
    for (const cv::Point2f& p : corners) {
      const double z = static_cast<double>(
          stillpoint::depth_m_at(frame.rgbd, static_cast<int>(p.x), static_cast<int>(p.y)));
      const double known = z > 0 ? z : std::numeric_limits<double>::quiet_NaN();
      tracks.push_back({p, p,
                        frame.T_world_camera * camera.unproject(static_cast<double>(p.x),
                                                                static_cast<double>(p.y), known)});
    }
    front_end.correct_pose(frame.T_world_camera);
  }
  for (const Track& t : tracks) end(t, frames.back(), camera, counts);
  return counts;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::cerr << "usage: " << argv[0] << " SEQUENCE\n";
    return 2;
  }
  const stillpoint::TumSequence sequence(argv[1]);
  const stillpoint::Camera camera = sequence.camera().value();
  const stillpoint::Trajectory truth = sequence.groundtruth();
  std::vector<Frame> frames;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    Frame frame;
    frame.rgbd = sequence.load(i);
    cv::cvtColor(frame.rgbd.color, frame.gray, cv::COLOR_BGR2GRAY);
    frame.people = stillpoint::read_mask(
        stillpoint::mask_path(sequence.folder() / "masks_gt", sequence.entry(i).stem),
        frame.gray.size());
    const auto later = std::lower_bound(
        truth.begin(), truth.end() - 1, frame.rgbd.timestamp - 1e-4,
        [](const stillpoint::StampedPose& pose, double t) { return pose.timestamp < t; });
    frame.T_world_camera = later->T_world_camera;  // `synth` writes one at each frame
    frames.push_back(frame);
  }
  for (const auto& [way, name] :
       {std::make_pair(Way::kPlain, "plain"), std::make_pair(Way::kSelect, "select()"),
        std::make_pair(Way::kSelectTracked, "select_tracked()")}) {
    stillpoint::MaskFilesSegmenter segmenter(sequence.folder() / "masks",
                                             stillpoint::frame_names(sequence));
    const Counts c = run(frames, camera, segmenter, way);
    std::printf("%-17s %5d tracks, %5.2f %% end on people, %5.2f %% end off their corner\n", name,
                c.ended, 100.0 * c.on_people / c.ended, 100.0 * c.dragged / std::max(1, c.judged));
  }
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
