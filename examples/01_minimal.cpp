// SPDX-License-Identifier: BSD-2-Clause
#include <iostream>
#include <opencv2/features2d.hpp>
#include <stillpoint/io/mask_folder.hpp>
#include <stillpoint/stillpoint.hpp>
int main(int argc, char** file) try {  // three files: a color, a depth and a mask image
  if (argc != 4) return std::cerr << "expected three files\n", 2;
  stillpoint::RgbdFrame frame{stillpoint::read_color(file[1]), stillpoint::read_depth(file[2])};
  std::vector<cv::KeyPoint> keypoints;  // yours, of any kind
  cv::ORB::create(1000)->detect(frame.color, keypoints);
  stillpoint::FrontEnd front_end;
  const cv::Mat people = stillpoint::read_labels(file[3], frame.color.size());
  front_end.compute_mask(frame, {true, 0, stillpoint::instances_from_labels(people)});
  stillpoint::compact(keypoints, front_end.select(keypoints));
  std::cout << keypoints.size() << " keypoints are on the static world\n";
} catch (const std::exception& error) {  // says which file is wrong, and how
  return std::cerr << error.what() << "\n", 1;
}
