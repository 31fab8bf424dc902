// SPDX-License-Identifier: BSD-2-Clause
//
// You have a mask and want to know which of your keypoints to trust. Uses the keypoint filter alone
// (paper section 3.3), with a keypoint type and float descriptors that are not OpenCV's ORB.
//
// Usage: 03_filter_only COLOR MASK    (MASK: 8-bit gray, not 0 = moves)

#include <iostream>
#include <opencv2/features2d.hpp>
#include <stillpoint/io/image_file.hpp>
#include <stillpoint/io/mask_folder.hpp>
#include <stillpoint/keypoints/probabilistic_keypoint_filter.hpp>

// A keypoint as your system may have it.
struct Corner {
  double row, column;
  cv::Mat descriptor;  // 64 floats; the filter never looks at it
};

// How the library reads it.
template <>
struct stillpoint::KeypointTraits<Corner> {
  static float x(const Corner& c) { return static_cast<float>(c.column); }
  static float y(const Corner& c) { return static_cast<float>(c.row); }
};

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: " << argv[0] << " COLOR MASK\n";
    return 2;
  }
  const cv::Mat picture = stillpoint::read_color(argv[1]);
  std::vector<cv::KeyPoint> found;
  cv::Mat descriptors;
  cv::KAZE::create()->detectAndCompute(picture, cv::noArray(), found, descriptors);
  std::vector<Corner> corners;
  for (std::size_t i = 0; i < found.size(); ++i)
    corners.push_back({found[i].pt.y, found[i].pt.x, descriptors.row(static_cast<int>(i))});

  stillpoint::DynamicMask mask;
  mask.image = stillpoint::read_mask(argv[2], picture.size());  // 255 = moves

  stillpoint::KeypointFilterSettings settings;
  settings.radius_px = 25;    // how far a moving keypoint casts doubt
  settings.threshold = 0.1f;  // keep only what is surely static
  stillpoint::ProbabilisticKeypointFilter<> filter(settings);
  const stillpoint::Selection& selection = filter.filter(corners, mask);

  int in_mask = 0, near_mask = 0;
  for (const stillpoint::KeypointReason reason : selection.reason) {
    in_mask += reason == stillpoint::KeypointReason::kInMask;
    near_mask += reason == stillpoint::KeypointReason::kProbable;
  }
  std::cout << corners.size() << " keypoints: " << in_mask << " in the mask, " << near_mask
            << " near moving ones, " << selection.kept.size() << " kept\n";
  stillpoint::compact(corners, selection);  // keypoints and descriptors, kept ones only
} catch (const stillpoint::Error& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
