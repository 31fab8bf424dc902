// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/io/image_file.hpp"

namespace stillpoint {

/// The file of a frame's mask: FOLDER/STEM.png, with the stem of the frame's color file.
inline std::filesystem::path mask_path(const std::filesystem::path& folder,
                                       const std::string& stem) {
  return folder / (stem + ".png");
}

namespace detail {

/// Throws Error for 255 beside other labels: where JPEG or interpolation has blurred the edges of a
/// 0/255 mask, each gray level would become an instance. `seen`: which labels an image has.
inline void check_labels(const std::array<bool, 256>& seen, const std::string& name) {
  const auto others = std::count(seen.begin() + 1, seen.end() - 1, true);
  check(!seen[255] || others == 0, [&] {
    return name + ": expected 0 and 255 only, or labels up to 254, found 255 beside " +
           std::to_string(others) +
           " other labels; was it saved as JPEG, or resized with interpolation? If 255 stands for "
           "'ignore', set it to 0";
  });
}

/// The same for a label image, CV_8UC1. O(pixels).
inline void check_labels(const cv::Mat& labels, const std::string& name) {
  std::array<bool, 256> seen{};
  for (int y = 0; y < labels.rows; ++y) {
    const uchar* row = labels.ptr<uchar>(y);
    for (int x = 0; x < labels.cols; ++x) seen[row[x]] = true;
  }
  check_labels(seen, name);
}

}  // namespace detail

/// Reads a label image: CV_8UC1, 0 = background, k = instance k (up to 254), or 0 and 255 only.
/// Throws Error if it is missing, truncated, not 8 bits in one channel, not of `size`, or has 255
/// beside other labels.
inline cv::Mat read_labels(const std::filesystem::path& path, cv::Size size) {
  cv::Mat labels = detail::read_image(path, cv::IMREAD_UNCHANGED, "mask");
  detail::check(labels.type() == CV_8UC1, [&] {
    return "mask " + path.string() +
           ": expected one channel of 8 bits (CV_8UC1, 0 = background, k = instance k), found " +
           detail::type_text(labels) +
           (labels.channels() > 1 ? "; save it as a gray image, without palette, color or alpha"
                                  : "; save it with 8 bits per pixel");
  });
  detail::check(labels.size() == size, [&] {
    return "mask " + path.string() + ": expected the color image's size " +
           std::to_string(size.width) + "x" + std::to_string(size.height) + ", found " +
           detail::size_text(labels) + "; resize it without interpolation";
  });
  detail::check_labels(labels, "mask " + path.string());
  return labels;
}

/// Reads a mask as CV_8UC1, 255 where the label image is not 0. Throws Error as read_labels().
inline cv::Mat read_mask(const std::filesystem::path& path, cv::Size size) {
  return read_labels(path, size) > 0;
}

namespace detail {

/// Numbers the 8-connected parts of a mask of at least `min_area_px` pixels, from 1 in the order in
/// which rows are read, at most 255: the largest ones if there are more. CV_8UC1.
inline cv::Mat connected_labels(const cv::Mat& mask, int min_area_px) {
  cv::Mat parts, statistics, centers;
  const int count = cv::connectedComponentsWithStats(mask, parts, statistics, centers, 8, CV_32S);
  const auto area = [&](int part) { return statistics.at<int>(part, cv::CC_STAT_AREA); };
  std::vector<int> by_area;
  for (int part = 1; part < count; ++part)
    if (area(part) >= min_area_px) by_area.push_back(part);
  // OpenCV's numbers may depend on its threads, so ties are broken by place in the image.
  std::vector<std::size_t> first(static_cast<std::size_t>(count), 0);
  std::vector<char> seen(static_cast<std::size_t>(count), 0);
  for (int y = 0; y < parts.rows; ++y)
    for (int x = 0; x < parts.cols; ++x) {
      const auto part = static_cast<std::size_t>(parts.at<int>(y, x));
      if (seen[part]) continue;
      seen[part] = 1;
      first[part] = static_cast<std::size_t>(y) * static_cast<std::size_t>(parts.cols) +
                    static_cast<std::size_t>(x);
    }
  const auto earlier = [&](int a, int b) {
    return first[static_cast<std::size_t>(a)] < first[static_cast<std::size_t>(b)];
  };
  std::sort(by_area.begin(), by_area.end(),
            [&](int a, int b) { return area(a) != area(b) ? area(a) > area(b) : earlier(a, b); });
  if (by_area.size() > 255) by_area.resize(255);
  std::sort(by_area.begin(), by_area.end(), earlier);
  std::vector<uchar> label(static_cast<std::size_t>(count), 0);
  for (std::size_t i = 0; i < by_area.size(); ++i)
    label[static_cast<std::size_t>(by_area[i])] = static_cast<uchar>(i + 1);
  cv::Mat labels(mask.size(), CV_8UC1);
  for (int y = 0; y < parts.rows; ++y)
    for (int x = 0; x < parts.cols; ++x)
      labels.at<uchar>(y, x) = label[static_cast<std::size_t>(parts.at<int>(y, x))];
  return labels;
}

}  // namespace detail

/// Splits a label image into instances, in the order of their labels. An image with only 0 and
/// 255 is split into connected parts instead, and parts under `min_area_px` pixels are dropped.
///
/// `labels`: CV_8UC1, 0 = background. Throws Error for another type, and for 255 beside other
/// labels. O(pixels).
inline std::vector<Instance> instances_from_labels(const cv::Mat& labels,
                                                   const std::string& class_name = "person",
                                                   int min_area_px = 50) {
  detail::check(labels.type() == CV_8UC1, [&] {
    return "instances_from_labels: expected CV_8UC1, found " + detail::type_text(labels);
  });
  struct Bounds {
    int x0 = 1 << 30, y0 = 1 << 30, x1 = -1, y1 = -1;
  };
  std::array<Bounds, 256> bounds;
  for (int y = 0; y < labels.rows; ++y) {
    const uchar* row = labels.ptr<uchar>(y);
    for (int x = 0; x < labels.cols; ++x) {
      if (row[x] == 0) continue;
      Bounds& b = bounds[row[x]];
      b.x0 = std::min(b.x0, x), b.x1 = std::max(b.x1, x);
      b.y0 = std::min(b.y0, y), b.y1 = y;
    }
  }
  std::array<bool, 256> seen{};
  for (std::size_t k = 1; k < seen.size(); ++k) seen[k] = bounds[k].x1 >= 0;
  detail::check_labels(seen, "instances_from_labels");
  if (seen[255]) {
    const cv::Mat parts = detail::connected_labels(labels, min_area_px);
    double parts_count = 0;
    cv::minMaxLoc(parts, nullptr, &parts_count);
    std::vector<Instance> instances;
    for (int k = 1; k <= static_cast<int>(parts_count); ++k)
      instances.push_back(instance_from_mask(parts == k, class_name));
    return instances;
  }
  std::vector<Instance> instances;
  for (int k = 1; k < 256; ++k) {
    const Bounds& b = bounds[static_cast<std::size_t>(k)];
    if (b.x1 < 0) continue;
    Instance instance;
    instance.class_name = class_name;
    instance.box = cv::Rect(b.x0, b.y0, b.x1 - b.x0 + 1, b.y1 - b.y0 + 1);
    instance.mask = labels(instance.box) == k;
    instances.push_back(std::move(instance));
  }
  return instances;
}

/// Paints instances into a label image: the i-th gets label i + 1, a later one covers an earlier
/// one, one without a mask fills its box. CV_8UC1 of `size`. Throws Error for over 254 instances or
/// boxes outside the image. O(pixels).
inline cv::Mat labels_from_instances(const std::vector<Instance>& instances, cv::Size size) {
  detail::check(instances.size() <= 254, [&] {
    return "labels_from_instances: expected at most 254 instances, found " +
           std::to_string(instances.size());
  });
  Segmentation segmentation;
  segmentation.instances = instances;
  check_segmentation(segmentation, size);
  cv::Mat labels = cv::Mat::zeros(size, CV_8UC1);
  for (std::size_t i = 0; i < instances.size(); ++i) {
    cv::Mat part = labels(instances[i].box);
    const cv::Scalar label(static_cast<double>(i + 1));
    if (instances[i].mask.empty())
      part.setTo(label);
    else
      part.setTo(label, instances[i].mask);
  }
  return labels;
}

/// Writes FOLDER/STEM.png as the mask_files segmenter reads it; no instance = segmented, nobody
/// seen. The folder must exist. Throws Error as labels_from_instances(), and if writing fails.
inline void write_labels(const std::filesystem::path& folder, const std::string& stem,
                         const std::vector<Instance>& instances, cv::Size size) {
  write_image(mask_path(folder, stem), labels_from_instances(instances, size));
}

}  // namespace stillpoint
