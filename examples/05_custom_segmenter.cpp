// SPDX-License-Identifier: BSD-2-Clause
//
// A segmenter of your own behind the seam: one function. This one needs no network: whoever is
// nearer to the camera than 2 m is taken for a person. Replace segment() by your detector.
//
// Usage: 05_custom_segmenter SEQUENCE

#include <iostream>
#include <opencv2/imgproc.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/io/tum_sequence.hpp>

class NearnessSegmenter : public stillpoint::Segmenter {
 public:
  stillpoint::Segmentation segment(const stillpoint::RgbdFrame& frame) override {
    stillpoint::Segmentation result;
    result.timestamp = frame.timestamp;
    if (frame.depth.empty()) return result;  // no result: the front end predicts from earlier ones
    result.available = true;

    cv::Mat depth_m, labels, stats, centers;
    frame.depth.convertTo(depth_m, CV_32F, stillpoint::metres_per_unit(frame));
    const cv::Mat near = (depth_m > 0) & (depth_m < kNear_m);
    const int n = cv::connectedComponentsWithStats(near, labels, stats, centers);
    for (int label = 1; label < n; ++label) {
      if (stats.at<int>(label, cv::CC_STAT_AREA) < kMinArea_px) continue;
      // A mask of the whole image becomes an instance: box, and mask of the box's size.
      result.instances.push_back(stillpoint::instance_from_mask(labels == label, "person", 0.5f));
    }
    return result;
  }

 private:
  static constexpr double kNear_m = 2;
  static constexpr int kMinArea_px = 2000;
};

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::cerr << "usage: " << argv[0] << " SEQUENCE\n";
    return 2;
  }
  const stillpoint::TumSequence sequence(argv[1]);
  NearnessSegmenter segmenter;
  stillpoint::FrontEnd front_end(stillpoint::FrontEndSettings(),
                                 sequence.camera().value_or(stillpoint::Camera()), &segmenter);
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    front_end.compute_mask(sequence.load(i));
    const stillpoint::FrameStats& stats = front_end.stats();
    std::cout << sequence.entry(i).stem << ": " << stats.instances << " instances, "
              << static_cast<int>(100 * stats.mask_share + 0.5) << " % of the image\n";
  }
} catch (const stillpoint::Error& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
