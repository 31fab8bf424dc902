// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace stillpoint {

/// How a network wants its image: 1 x 3 x H x W floats.
struct NetworkInput {
  enum class Fit {
    kStretch,    ///< resized to the input's size, whatever its proportions
    kLetterbox,  ///< proportions kept, in the middle of the input
    kTopLeft     ///< proportions kept, in the upper left corner of the input
  };
  Fit fit = Fit::kStretch;
  bool rgb = false;  ///< channel order: RGB, else BGR
  float scale = 1;   ///< factor on values of 0 to 255
  /// Value (0 to 255, in the network's channel order) around the image.
  std::array<float, 3> padding{{0, 0, 0}};
};

/// Where an image lies in a network's input: input = scale * image + offset, for pixel edges.
struct ImagePlacement {
  cv::Size image, input;
  double scale_x = 1, scale_y = 1;
  double offset_x = 0, offset_y = 0;
  /// The part of the input that the image fills, pixels.
  cv::Rect filled;

  /// A box in input pixels (edges) as pixels of the image: all that it touches. Empty where it
  /// lies outside, or a coordinate is NaN.
  cv::Rect to_image(float x0, float y0, float x1, float y1) const {
    const auto clamp = [](double v, int limit) {
      return std::min(static_cast<double>(limit), std::max(0.0, v));
    };
    if (!(x1 > x0 && y1 > y0)) return {};
    // An edge a thousandth of a pixel beyond a border is rounding.
    const double slack = 1e-3;
    const int left =
        static_cast<int>(std::floor(clamp((x0 - offset_x) / scale_x + slack, image.width)));
    const int top =
        static_cast<int>(std::floor(clamp((y0 - offset_y) / scale_y + slack, image.height)));
    const int right =
        static_cast<int>(std::ceil(clamp((x1 - offset_x) / scale_x - slack, image.width)));
    const int bottom =
        static_cast<int>(std::ceil(clamp((y1 - offset_y) / scale_y - slack, image.height)));
    if (right <= left || bottom <= top) return {};
    return {left, top, right - left, bottom - top};
  }
};

/// The input size for an image: `fixed`, with the lengths that are open in it (0) chosen so that
/// the image's proportions are kept. Both open: the image's size, but at most 640 on the longer
/// side. One: by the fixed one, at most four times as long. What is chosen is rounded up to a
/// multiple of 32, the largest stride of the networks that have a decoder. O(1).
inline cv::Size complete_input_size(const cv::Size& fixed, const cv::Size& image) {
  static constexpr int kStride = 32;
  static constexpr double kLongest = 640, kMostStretched = 4;
  const auto round_up = [](double length) {
    const double strides = std::ceil(static_cast<double>(std::lround(length)) / kStride);
    return kStride * std::max(1, static_cast<int>(strides));
  };
  const auto open_length = [&](int known, int image_open, int image_known) {
    const double ratio = static_cast<double>(image_open) / image_known;
    return round_up(known * std::min(ratio, kMostStretched));
  };
  if (fixed.width > 0 && fixed.height > 0) return fixed;
  if (fixed.width > 0) return {fixed.width, open_length(fixed.width, image.height, image.width)};
  if (fixed.height > 0) return {open_length(fixed.height, image.width, image.height), fixed.height};
  const double r = std::min(1.0, kLongest / std::max(image.width, image.height));
  return {round_up(image.width * r), round_up(image.height * r)};
}

using PicturePlacement [[deprecated("ImagePlacement")]] = ImagePlacement;

/// Where an image goes in an input of that size. O(1).
inline ImagePlacement place_image(const cv::Size& image, const cv::Size& input,
                                  NetworkInput::Fit fit) {
  ImagePlacement place;
  place.image = image, place.input = input;
  place.filled = cv::Rect(cv::Point(), input);
  if (fit != NetworkInput::Fit::kStretch) {
    const double r = std::min(static_cast<double>(input.width) / image.width,
                              static_cast<double>(input.height) / image.height);
    const auto fitted = [r](int length, int limit) {
      return std::min(limit, std::max(1, static_cast<int>(std::lround(length * r))));
    };
    place.filled.width = fitted(image.width, input.width);
    place.filled.height = fitted(image.height, input.height);
    if (fit == NetworkInput::Fit::kLetterbox) {
      place.filled.x = (input.width - place.filled.width) / 2;
      place.filled.y = (input.height - place.filled.height) / 2;
    }
  }
  place.scale_x = static_cast<double>(place.filled.width) / image.width;
  place.scale_y = static_cast<double>(place.filled.height) / image.height;
  place.offset_x = place.filled.x, place.offset_y = place.filled.y;
  return place;
}

/// Makes a network's input of an image (CV_8UC3 BGR or CV_8UC1 grey). O(pixels of both).
class InputPreparer {
 public:
  /// Returns 3 x H x W floats, valid until the next call.
  const std::vector<float>& prepare(const cv::Mat& color, const NetworkInput& spec,
                                    const ImagePlacement& place) {
    const cv::Mat* image = &color;
    if (place.filled.size() != color.size()) {
      // Shrinking by more than two skips pixels unless they are averaged.
      const bool shrink = place.scale_x < 0.5 && place.scale_y < 0.5;
      cv::resize(color, resized_, place.filled.size(), 0, 0,
                 shrink ? cv::INTER_AREA : cv::INTER_LINEAR);
      image = &resized_;
    }
    const std::size_t plane = static_cast<std::size_t>(place.input.area());
    values_.resize(3 * plane);
    for (std::size_t c = 0; c < 3; ++c) {
      float* out = values_.data() + c * plane;
      if (place.filled.size() != place.input)
        std::fill(out, out + plane, spec.padding[c] * spec.scale);
      const int from = spec.rgb ? 2 - static_cast<int>(c) : static_cast<int>(c);
      copy_channel(*image, from, spec.scale, place, out);
    }
    return values_;
  }

 private:
  static void copy_channel(const cv::Mat& image, int channel, float scale,
                           const ImagePlacement& place, float* out) {
    const int channels = image.channels();
    for (int y = 0; y < image.rows; ++y) {
      const uchar* in = image.ptr<uchar>(y) + (channels == 3 ? channel : 0);
      float* to = out + static_cast<std::ptrdiff_t>(place.filled.y + y) * place.input.width +
                  place.filled.x;
      for (int x = 0; x < image.cols; ++x) to[x] = static_cast<float>(in[channels * x]) * scale;
    }
  }

  cv::Mat resized_;
  std::vector<float> values_;
};

}  // namespace stillpoint
