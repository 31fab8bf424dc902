// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <vector>

namespace stillpoint {

/// Motion blur of an image, or of one object in it.
struct Blur {
  /// Predicted displacement during the exposure, pixels; NaN: not known.
  double motion_px = std::numeric_limits<double>::quiet_NaN();
  /// How sharp the edges are, against the sharpest of the last seconds, 0 to 1; NaN: too few edges.
  /// It sinks as the width of the edges grows: 0.5 is about twice as wide.
  double sharpness = std::numeric_limits<double>::quiet_NaN();

  /// Blur to be reckoned with, pixels: the motion, unless the edges are as sharp as ever (the
  /// exposure was shorter than is thought); 0 where it is not known.
  double width_px() const { return sharpness >= kSharp || std::isnan(motion_px) ? 0 : motion_px; }

  /// Whether an object can hardly be missed for blur: it moves by less than `sharp_px` and its
  /// edges are sharp, as far as either is known; false where nothing is known.
  bool is_sharp(double sharp_px) const {
    if (std::isnan(motion_px)) return sharpness >= kSharp;
    return motion_px < sharp_px && !(sharpness < kSharp);
  }

  /// Edges of this sharpness speak against blur: those of images blurred by less than 4 pixels.
  static constexpr double kSharp = 0.8;
};

/// The blur of an image, of the whole and of any part of it, as BlurMeter measures it.
class ImageBlur {
 public:
  /// Edges in a block of kBlockWidth x kBlockHeight pixels, across (x) and down (y): sums of
  /// squared differences over a short and over a long distance, where the long one shows an edge.
  struct Edges {
    std::int64_t short_x = 0, long_x = 0, short_y = 0, long_y = 0;
    Edges& operator+=(const Edges& other) {
      short_x += other.short_x, long_x += other.long_x;
      short_y += other.short_y, long_y += other.long_y;
      return *this;
    }
  };
  static constexpr int kBlockWidth = 32, kBlockHeight = 60;

  /// Of the whole image: mean motion of the static world by the camera's motion.
  Blur whole;
  /// Exposure time over the time since the last frame; NaN: there is none.
  double exposure_share = std::numeric_limits<double>::quiet_NaN();
  /// The edges that count as sharp: the short sum over the long one.
  double reference = 0;
  /// Row by row.
  std::vector<Edges> blocks;
  int columns = 0;
  /// Of all blocks.
  Edges total;

  /// Nothing is known.
  void clear() {
    whole = Blur();
    exposure_share = std::numeric_limits<double>::quiet_NaN();
    reference = 0, columns = 0;
    blocks.clear();
    total = {};
  }

  /// Blur of what lies in `box` and moved by `displacement_px` since the last frame. Where that is
  /// NaN or the box too small, the whole image's. O(blocks of the box).
  Blur in(const cv::Rect& box,
          double displacement_px = std::numeric_limits<double>::quiet_NaN()) const {
    Blur blur = whole;
    if (!std::isnan(displacement_px * exposure_share))
      blur.motion_px = displacement_px * exposure_share;
    const int rows = columns > 0 ? static_cast<int>(blocks.size()) / columns : 0;
    Edges sum;
    for (int y = first(box.y, kBlockHeight);
         y < rows && center(y, kBlockHeight) < box.y + box.height; ++y)
      for (int x = first(box.x, kBlockWidth);
           x < columns && center(x, kBlockWidth) < box.x + box.width; ++x)
        sum += blocks[static_cast<std::size_t>(y * columns + x)];
    const double sharp = ratio(sum);
    if (!std::isnan(sharp) && reference > 0) blur.sharpness = std::min(1.0, sharp / reference);
    return blur;
  }

  /// Short over long sum, of the less sharp direction; NaN where there are too few edges.
  static double ratio(const Edges& e) {
    const auto of = [](std::int64_t fine, std::int64_t coarse) {
      return coarse < kFewestEdges ? std::numeric_limits<double>::quiet_NaN()
                                   : static_cast<double>(fine) / static_cast<double>(coarse);
    };
    // The second one where the first is NaN.
    return std::fmin(of(e.short_x, e.long_x), of(e.short_y, e.long_y));
  }

 private:
  static constexpr std::int64_t kFewestEdges = 50 * 32 * 32;  // pixels of the weakest edge

  static int center(int block, int size) { return block * size + size / 2; }
  static int first(int pixel, int size) { return std::max(0, (pixel + size / 2 - 1) / size); }
};

}  // namespace stillpoint
