// SPDX-License-Identifier: BSD-2-Clause
//
// A camera without depth: what is left of the front end is the mending of missed people (3.1) and
// the keypoint filter (3.3). Prints, for each frame, how many keypoints are static, and how far the
// image of the static world moved since the last frame (KLT on the kept keypoints).
//
// Usage: 08_mono_without_depth SEQUENCE    (a TUM folder with masks/; its depth is not read)

#include <algorithm>
#include <iostream>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <stillpoint/backends/mask_files.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/io/tum_sequence.hpp>

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::cerr << "usage: " << argv[0] << " SEQUENCE\n";
    return 2;
  }
  const stillpoint::TumSequence sequence(argv[1]);
  stillpoint::MaskFilesSegmenter segmenter(sequence.folder() / "masks",
                                           stillpoint::frame_names(sequence));
  stillpoint::FrontEndSettings settings;
  settings.use_depth = false;  // without a depth image it could only say kNoDepth
  stillpoint::FrontEnd front_end(settings, stillpoint::Camera(), &segmenter);
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(800);
  cv::Mat gray, last_gray;
  std::vector<cv::Point2f> last_points;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    stillpoint::RgbdFrame frame = sequence.load(i);
    frame.depth.release();
    front_end.compute_mask(frame);
    cv::cvtColor(frame.color, gray, cv::COLOR_BGR2GRAY);
    std::vector<cv::KeyPoint> keypoints;
    orb->detect(gray, keypoints);
    stillpoint::compact(keypoints, front_end.select(keypoints));

    std::vector<float> moved_px;
    if (!last_points.empty()) {
      std::vector<cv::Point2f> points;
      std::vector<uchar> found;
      cv::calcOpticalFlowPyrLK(last_gray, gray, last_points, points, found, cv::noArray());
      for (std::size_t k = 0; k < points.size(); ++k)
        if (found[k]) moved_px.push_back(static_cast<float>(cv::norm(points[k] - last_points[k])));
    }
    const auto& stats = front_end.stats();
    std::cout << "frame " << i << ": " << stats.kept << " of " << stats.keypoints
              << " keypoints static, " << stats.restored << " people restored";
    if (!moved_px.empty()) {
      const auto middle = moved_px.begin() + static_cast<std::ptrdiff_t>(moved_px.size() / 2);
      std::nth_element(moved_px.begin(), middle, moved_px.end());
      std::cout << ", the static world moved by " << *middle << " px";
    }
    std::cout << "\n";
    cv::KeyPoint::convert(keypoints, last_points);
    cv::swap(gray, last_gray);
  }
} catch (const stillpoint::Error& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
