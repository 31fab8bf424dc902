// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/core/fill_image.hpp"
#include "stillpoint/core/instance.hpp"

namespace stillpoint {

/// What earlier frames say of a cell of the image.
enum class CellLabel : std::uint8_t {
  kUnknown,  ///< no depth, never seen from where it could be judged, or not certain
  kStatic,   ///< the same surface was there before
  kMoved,    ///< earlier frames looked through the place where it is now
  kNear      ///< something has come too near to be measured (NearHoles)
};

/// A label for each cell, a square of pixels, of a frame. Empty: nothing is known.
class CellLabels {
 public:
  void clear() {
    width_ = height_ = 0, labels_.clear(), alone_.clear(), seen_.clear(), near_ = cv::Rect();
  }
  bool empty() const { return labels_.empty(); }

  /// All unknown.
  void reset(int block_px, int width, int height) {
    block_px_ = block_px, width_ = width, height_ = height;
    labels_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                   CellLabel::kUnknown);
    alone_.assign(labels_.size(), 0);
    seen_.assign(labels_.size(), 0);
    near_ = cv::Rect();
  }
  /// Side of a cell, pixels.
  int block_px() const { return block_px_; }
  int width() const { return width_; }
  int height() const { return height_; }
  CellLabel& operator[](std::size_t i) { return labels_[i]; }
  CellLabel operator[](std::size_t i) const { return labels_[i]; }
  std::size_t size() const { return labels_.size(); }
  /// Tells that the static surface of a cell was seen there while nothing that moves touched it.
  void set_alone(std::size_t i) { alone_[i] = 255; }
  /// Tells that an earlier frame looked at the place of a cell. What has just come into view was
  /// not.
  void set_seen(std::size_t i) { seen_[i] = 255; }
  bool seen(std::size_t i) const { return seen_[i] != 0; }
  /// Tells that what a cell shows is too near to be measured.
  void set_near(int x, int y) {
    labels_[index(x, y)] = CellLabel::kNear;
    near_ |= cv::Rect(x, y, 1, 1);
  }

  /// To be called once the labels stand: finds what known_static(), stood_alone() and
  /// clear_static() ask for. O(cells).
  void find_wide_static() {
    static_.create(height_, width_);
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x) static_(y, x) = at(x, y) == CellLabel::kStatic ? 255 : 0;
    cv::morphologyEx(static_, wide_static_, cv::MORPH_OPEN, cross());
    cv::bitwise_and(wide_static_, cv::Mat_<uchar>(height_, width_, alone_.data()), wide_alone_);
  }

  /// Whether at a pixel there is a surface, three cells wide or more, that earlier frames had seen
  /// there and not taken for dynamic. O(1).
  bool known_static(const cv::Point& pixel) const { return is_set(wide_static_, pixel); }
  /// Whether, besides, it was seen there while nothing that moves touched it: true of a table, but
  /// not of a person who moves only an arm. O(1).
  bool stood_alone(const cv::Point& pixel) const { return is_set(wide_alone_, pixel); }

  /// How many cells there are, earlier frames looked at, are static, have moved.
  struct Counts {
    int all = 0, seen = 0, of_static = 0, moved = 0;
  };
  /// Asks the cells at pixels of an instance, block_px() apart: those on its mask, or of its whole
  /// box if that is bare. O(cells of the box).
  Counts count(const Instance& instance) const {
    Counts counts;
    if (empty()) return counts;
    const cv::Rect box = instance.box & cv::Rect(0, 0, width_ * block_px_, height_ * block_px_);
    for (int y = box.y + block_px_ / 2; y < box.y + box.height; y += block_px_)
      for (int x = box.x + block_px_ / 2; x < box.x + box.width; x += block_px_) {
        const cv::Point in_box = cv::Point(x, y) - instance.box.tl();
        if (!instance.mask.empty() && instance.mask.at<uchar>(in_box) == 0) continue;
        const std::size_t i = static_cast<std::size_t>(y / block_px_ * width_ + x / block_px_);
        ++counts.all, counts.seen += seen(i);
        counts.of_static += labels_[i] == CellLabel::kStatic;
        counts.moved += labels_[i] == CellLabel::kMoved;
      }
    return counts;
  }

  /// Sets `mask`, CV_8UC1 of the frame's size, to 255 where something is too near to be measured.
  /// Whether there is anything. O(cells around it).
  bool add_near(cv::Mat& mask) const {
    const int b = block_px_;
    for (int y = near_.y; y < near_.br().y; ++y)
      for (int x = near_.x; x < near_.br().x; ++x)
        if (at(x, y) == CellLabel::kNear) detail::fill_part(mask, {x * b, y * b, b, b}, uchar{255});
    return !near_.empty();
  }

  /// Sets `mask`, CV_8UC1 of the size of `area` (inside the frame), to 0 where there is a static
  /// surface. With `wide_only`, what is thinner than three cells stays: cells at an outline show
  /// both sides of it. O(cells of area).
  void clear_static(const cv::Rect& area, cv::Mat& mask, bool wide_only) const {
    if (empty() || area.empty()) return;
    const cv::Mat_<uchar>& cells = wide_only ? wide_static_ : static_;
    const int b = block_px_, right = area.x + area.width, bottom = area.y + area.height;
    const int last_x = std::min((right + b - 1) / b, width_);
    const int last_y = std::min((bottom + b - 1) / b, height_);
    for (int y = area.y / b; y < last_y; ++y)
      for (int x = area.x / b; x < last_x; ++x) {
        const int first = x;
        while (x < last_x && cells(y, x) != 0) ++x;
        if (x > first)
          detail::fill_part(
              mask, (cv::Rect(first * b, y * b, (x - first) * b, b) & area) - area.tl(), uchar{0});
      }
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  CellLabel at(int x, int y) const { return labels_[index(x, y)]; }
  bool is_set(const cv::Mat_<uchar>& cells, const cv::Point& pixel) const {
    if (empty()) return false;
    const int x = pixel.x / block_px_, y = pixel.y / block_px_;
    return x < width_ && y < height_ && cells(y, x) != 0;
  }
  static const cv::Mat& cross() {
    static const cv::Mat element = cv::getStructuringElement(cv::MORPH_CROSS, {3, 3});
    return element;
  }

  int block_px_ = 8, width_ = 0, height_ = 0;
  std::vector<CellLabel> labels_;
  std::vector<uchar> alone_, seen_;  // 255: yes
  cv::Rect near_;                    // around the cells that are too near
  cv::Mat_<uchar> static_, wide_static_, wide_alone_;
};

}  // namespace stillpoint
