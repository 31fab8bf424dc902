// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/random.hpp"
#include "stillpoint/depth/depth_mask_fuser_settings.hpp"
#include "stillpoint/depth/dilate.hpp"
#include "stillpoint/depth/floor_plane.hpp"

namespace stillpoint {

/// Turns one instance and the depth around it into its region of the mask: the work of
/// DepthMaskFuser per instance, on cells of cell_px with one depth sample each, then on pixels.
class InstanceRegion {
 public:
  explicit InstanceRegion(const DepthMaskFuserSettings& settings) : settings_(settings) {
    // One random place inside the cell for each of a table of cells (stratified sampling).
    RandomGenerator random(settings.seed);
    const std::size_t side = static_cast<std::size_t>(settings.cell_px);
    for (auto& place : places_) {
      place.x = static_cast<std::uint8_t>(random.below(side));
      place.y = static_cast<std::uint8_t>(random.below(side));
    }
  }

  /// Finds the floor among samples outside the instances' boxes, the last frame's floor first.
  /// O(samples).
  void begin_frame(const DepthView& depth, const std::vector<Instance>& instances) {
    if (settings_.method == DepthMaskFuserSettings::Method::kPaper) return;
    floor_samples_.clear();
    const cv::Size size = depth.size();
    const int step = std::max(8, size.width / 28);
    for (int y = step / 2; y < size.height; y += step) {
      const std::uint16_t* row = depth.row(y);
      for (int x = step / 2; x < size.width; x += step) {
        if (row[x] == 0) continue;
        const cv::Point p(x, y);
        bool outside = true;
        for (const Instance& s : instances) outside = outside && !s.box.contains(p);
        if (outside)
          floor_samples_.push_back({depth.ray_x(static_cast<float>(x)),
                                    depth.ray_y(static_cast<float>(y)), 1 / depth.to_m(row[x])});
      }
    }
    floor_ = find_floor(floor_samples_, floor_, settings_.seed);
  }

  /// Writes the instance's region: `out.box` may cover more than the instance's box, `out.mask` has
  /// its size and lies in `buffer`, which outlives it.
  void fuse(const DepthView& depth, const Instance& instance, std::vector<uchar>& buffer,
            Instance& out) {
    out.class_name = instance.class_name;
    out.score = instance.score;
    const bool paper = settings_.method == DepthMaskFuserSettings::Method::kPaper;
    const bool connected = !paper && find_range(depth, instance);
    if (connected) start_growth(depth, instance);
    out.box = connected ? area_ : instance.box;
    buffer.assign(static_cast<std::size_t>(out.box.area()), 0);
    out.mask = cv::Mat(out.box.size(), CV_8UC1, buffer.data());
    if (connected) {
      grow();
      write_pixels(depth, instance, out.mask);
    } else {
      copy_mask(instance, out.mask);  // without depth to judge by, a good mask stays as it is
      if (paper) add_box_range(depth, instance, out.mask);
    }
  }

  /// The floor of the frame, if any was found.
  const InversePlane& floor() const { return floor_; }

 private:
  static constexpr int kBins = 256;
  static constexpr float kBinM = 0.05f;
  struct Place {
    std::uint8_t x, y;
  };
  enum State : std::uint8_t { kOpen, kRegion, kFloor };

  cv::Point sample_place(int cell_x, int cell_y, const cv::Size& size) const {
    const Place& p =
        places_[(static_cast<std::size_t>(cell_y) * 61 + static_cast<std::size_t>(cell_x)) %
                places_.size()];
    return {std::min(cell_x * settings_.cell_px + p.x, size.width - 1),
            std::min(cell_y * settings_.cell_px + p.y, size.height - 1)};
  }

  cv::Rect cells_of(const cv::Rect& r) const {
    const int c = settings_.cell_px;
    const int x0 = r.x / c, y0 = r.y / c;
    return {x0, y0, (r.x + r.width - 1) / c - x0 + 1, (r.y + r.height - 1) / c - y0 + 1};
  }

  static bool in_mask(const Instance& s, const cv::Point& p) {
    return s.box.contains(p) &&
           (s.mask.empty() || s.mask.ptr<uchar>(p.y - s.box.y)[p.x - s.box.x] != 0);
  }

  static void copy_mask(const Instance& s, cv::Mat& out) {
    if (!s.mask.empty()) s.mask.copyTo(out);
  }

  // --- the paper's method -------------------------------------------------------------------

  void add_box_range(const DepthView& depth, const Instance& instance, cv::Mat& out) {
    const cv::Rect cells = cells_of(instance.box);
    values_.clear();
    for (int cy = cells.y; cy < cells.y + cells.height; ++cy)
      for (int cx = cells.x; cx < cells.x + cells.width; ++cx) {
        const cv::Point p = sample_place(cx, cy, depth.size());
        if (!instance.box.contains(p)) continue;
        if (const std::uint16_t z = depth.row(p.y)[p.x]) values_.push_back(depth.to_m(z));
      }
    if (values_.empty()) return;
    // Values within three standard deviations of the distribution in the box are retained.
    double mean = 0, square = 0;
    for (float v : values_) mean += v, square += static_cast<double>(v) * v;
    const double n = static_cast<double>(values_.size());
    mean /= n;
    const double limit = 3 * std::sqrt(std::max(0.0, square / n - mean * mean));
    double sum = 0, count = 0;
    for (float v : values_)
      if (std::abs(v - mean) <= limit) sum += v, ++count;
    if (count > 0) mean = sum / count;
    const int lo = std::max(1, depth.to_units(static_cast<float>(mean) - settings_.range_m));
    const int hi = depth.to_units(static_cast<float>(mean) + settings_.range_m);
    for (int y = 0; y < instance.box.height; ++y) {
      const std::uint16_t* z = depth.row(instance.box.y + y) + instance.box.x;
      uchar* to = out.ptr<uchar>(y);
      for (int x = 0; x < instance.box.width; ++x) to[x] |= z[x] >= lo && z[x] <= hi ? 255 : 0;
    }
  }

  // --- the default method -------------------------------------------------------------------

  void start_growth(const DepthView& depth, const Instance& instance) {
    const float px_per_m = depth.focal_px() / middle_m_;
    const int cell = settings_.cell_px;
    reach_ = std::max(1, static_cast<int>(settings_.growth_m * px_per_m / cell + 0.5f));
    const int margin = instance.mask.empty() ? cell : reach_ * cell;
    cells_ = cells_of(grow_rect(instance.box, margin, depth.size()));
    area_ = cv::Rect(cells_.x * cell, cells_.y * cell, cells_.width * cell, cells_.height * cell) &
            cv::Rect(cv::Point(), depth.size());
    sample_cells(depth, instance);
  }

  // The depths that the instance's own samples take: the main mode of their histogram and what
  // hangs together with it. False if too few samples have depth.
  bool find_range(const DepthView& depth, const Instance& instance) {
    histogram_.fill(0);
    const cv::Rect cells = cells_of(instance.box);
    const float to_bin = depth.metres_per_unit_value() / kBinM;
    int on_mask = 0, measured = 0, total = 0;
    for (int cy = cells.y; cy < cells.y + cells.height; ++cy)
      for (int cx = cells.x; cx < cells.x + cells.width; ++cx) {
        const cv::Point p = sample_place(cx, cy, depth.size());
        if (!in_mask(instance, p)) continue;
        ++on_mask;
        const std::uint16_t z = depth.row(p.y)[p.x];
        if (z == 0) continue;
        ++measured;
        int weight = 1;
        if (instance.mask.empty()) {
          // In a bare box the person is in the middle columns.
          const int off = std::abs(2 * (p.x - instance.box.x) - instance.box.width);
          weight = 8 * off < 3 * instance.box.width ? 4 : 1;
        }
        total += weight;
        histogram_[static_cast<std::size_t>(std::min(kBins - 1, static_cast<int>(z * to_bin)))] +=
            weight;
      }
    if (measured < 6 || measured * 5 < on_mask) return false;
    const auto smooth = [this](int b) {
      int sum = 2 * histogram_[static_cast<std::size_t>(b)];
      if (b > 0) sum += histogram_[static_cast<std::size_t>(b) - 1];
      if (b + 1 < kBins) sum += histogram_[static_cast<std::size_t>(b) + 1];
      return sum;
    };
    const int peak = main_mode(instance.depth_m, total, smooth);
    const int enough = std::max(1, smooth(peak) / 25);
    int lo = peak, hi = peak;
    const int reach = static_cast<int>(0.7f / kBinM);
    while (lo > 0 && peak - lo < reach && smooth(lo - 1) > enough) --lo;
    while (hi + 1 < kBins && hi - peak < reach && smooth(hi + 1) > enough) ++hi;
    lo_m_ = static_cast<float>(lo) * kBinM;
    hi_m_ = static_cast<float>(hi + 1) * kBinM;
    middle_m_ = (static_cast<float>(peak) + 0.5f) * kBinM;
    return true;
  }

  // The bin of the histogram where the object is: where it was expected, if it is there, else the
  // nearest mode that matters, for a careless mask takes in the wall behind.
  template <class Smooth>
  int main_mode(float expected_m, int total, const Smooth& smooth) const {
    const auto highest = [&](int from, int to) {
      int best = from;
      for (int b = from + 1; b <= to; ++b)
        if (smooth(b) > smooth(best)) best = b;
      return best;
    };
    const int largest = highest(0, kBins - 1);
    if (expected_m > 0) {
      const int at = std::min(kBins - 1, static_cast<int>(expected_m / kBinM));
      const int reach = static_cast<int>(0.35f / kBinM);
      const int from = std::max(0, at - reach), to = std::min(kBins - 1, at + reach);
      int mass = 0;
      for (int b = from; b <= to; ++b) mass += histogram_[static_cast<std::size_t>(b)];
      if (mass * 8 > total) return highest(from, to);
    }
    for (int b = 1, mode = 0, mass = 0; b < largest; ++b) {
      mass += histogram_[static_cast<std::size_t>(b)];
      if (smooth(b) > smooth(mode)) mode = b;
      if (4 * smooth(b) >= smooth(mode)) continue;
      if (5 * mass > total && smooth(mode) > 0) return mode;  // it has ended before the largest
      mode = b, mass = 0;
    }
    return largest;
  }

  void sample_cells(const DepthView& depth, const Instance& instance) {
    const std::size_t n = static_cast<std::size_t>(cells_.area());
    z_.resize(n);
    state_.assign(n, kOpen);
    queue_.clear();
    const float slack = 0.05f;
    std::size_t i = 0;
    for (int cy = cells_.y; cy < cells_.y + cells_.height; ++cy)
      for (int cx = cells_.x; cx < cells_.x + cells_.width; ++cx, ++i) {
        const cv::Point p = sample_place(cx, cy, depth.size());
        const std::uint16_t raw = depth.row(p.y)[p.x];
        const float z = depth.to_m(raw);
        z_[i] = z;
        if (raw == 0) continue;
        if (is_floor(depth, p, z)) {
          state_[i] = kFloor;
        } else if (z >= lo_m_ - slack && z <= hi_m_ + slack && in_mask(instance, p)) {
          state_[i] = kRegion;
          queue_.push_back({static_cast<int>(i), 0});
        }
      }
  }

  bool is_floor(const DepthView& depth, const cv::Point& p, float z) const {
    if (!floor_.found) return false;
    const float floor =
        floor_.depth_m(depth.ray_x(static_cast<float>(p.x)), depth.ray_y(static_cast<float>(p.y)));
    return floor > 0 && z > floor * 0.985f - 0.02f;
  }

  // Breadth first over cells whose depth goes on without a step.
  void grow() {
    const float lo = lo_m_ - settings_.range_m, hi = hi_m_ + settings_.range_m;
    for (std::size_t k = 0; k < queue_.size(); ++k) {
      const Visit visit = queue_[k];
      if (visit.distance >= reach_) continue;
      const int x = visit.cell % cells_.width, y = visit.cell / cells_.width;
      const float z = z_[static_cast<std::size_t>(visit.cell)];
      const float step = std::max(0.03f, 0.02f * z);
      const int next[4] = {x > 0 ? visit.cell - 1 : -1, x + 1 < cells_.width ? visit.cell + 1 : -1,
                           y > 0 ? visit.cell - cells_.width : -1,
                           y + 1 < cells_.height ? visit.cell + cells_.width : -1};
      for (const int c : next) {
        if (c < 0) continue;
        const std::size_t j = static_cast<std::size_t>(c);
        if (state_[j] != kOpen || z_[j] == 0 || z_[j] < lo || z_[j] > hi) continue;
        if (std::abs(z_[j] - z) > step) continue;
        state_[j] = kRegion;
        queue_.push_back({c, visit.distance + 1});
      }
    }
  }

  void write_pixels(const DepthView& depth, const Instance& instance, cv::Mat& out) {
    const int cell = settings_.cell_px;
    const std::size_t w = static_cast<std::size_t>(area_.width);
    lo_.resize(w), span_.resize(w), use_.resize(w);
    for (int cy = 0; cy < cells_.height; ++cy) {
      bool any = false;
      for (int cx = 0; cx < cells_.width; ++cx) any |= set_cell_range(depth, cx, cy);
      const int y_end = std::min((cy + 1) * cell, area_.height);
      for (int y = cy * cell; y < y_end; ++y) write_row(depth, instance, y, any, out.ptr<uchar>(y));
    }
    claim_unmeasured_rim(depth, out);
  }

  // The camera measures nothing right at an object's outline: such a pixel beside the object is
  // its.
  void claim_unmeasured_rim(const DepthView& depth, cv::Mat& out) {
    const std::size_t w = static_cast<std::size_t>(out.cols);
    for (auto& row : rim_rows_) row.assign(w, 0);
    const auto widen = [&](int y, std::vector<uchar>& row) {
      if (y >= out.rows) {
        std::fill(row.begin(), row.end(), uchar{0});
        return;
      }
      const uchar* in = out.ptr<uchar>(y);
      row[0] = static_cast<uchar>(in[0] | (w > 1 ? in[1] : 0));
      for (std::size_t x = 1; x + 1 < w; ++x)
        row[x] = static_cast<uchar>(in[x - 1] | in[x] | in[x + 1]);
      if (w > 1) row[w - 1] = static_cast<uchar>(in[w - 2] | in[w - 1]);
    };
    // Rows are widened before they are written: the rim does not grow on itself.
    widen(0, rim_rows_[1]);
    for (int y = 0; y < out.rows; ++y) {
      widen(y + 1, rim_rows_[2]);
      const uchar *a = rim_rows_[0].data(), *b = rim_rows_[1].data(), *c = rim_rows_[2].data();
      const std::uint16_t* z = depth.row(area_.y + y) + area_.x;
      uchar* to = out.ptr<uchar>(y);
      for (std::size_t x = 0; x < w; ++x)
        to[x] = static_cast<uchar>(to[x] | (z[x] == 0 ? a[x] | b[x] | c[x] : 0));
      std::swap(rim_rows_[0], rim_rows_[1]);
      std::swap(rim_rows_[1], rim_rows_[2]);
    }
  }

  // The range of depths of a cell's pixels: what its own and its neighbors' samples took.
  bool set_cell_range(const DepthView& depth, int cx, int cy) {
    float lo = 1e9f, hi = 0;
    for (int y = std::max(0, cy - 1); y <= std::min(cells_.height - 1, cy + 1); ++y)
      for (int x = std::max(0, cx - 1); x <= std::min(cells_.width - 1, cx + 1); ++x) {
        const std::size_t j = static_cast<std::size_t>(y) * static_cast<std::size_t>(cells_.width) +
                              static_cast<std::size_t>(x);
        if (state_[j] == kRegion) lo = std::min(lo, z_[j]), hi = std::max(hi, z_[j]);
      }
    const bool any = hi > 0;
    std::uint16_t lo_units = 0, span = 0;
    if (any) {
      const float slack = 0.03f + 0.01f * lo;
      const int a = std::max(1, depth.to_units(lo - slack)), b = depth.to_units(hi + slack);
      lo_units = static_cast<std::uint16_t>(a), span = static_cast<std::uint16_t>(b - a);
    }
    const int x0 = cx * settings_.cell_px, x1 = std::min(x0 + settings_.cell_px, area_.width);
    for (int x = x0; x < x1; ++x) {
      lo_[static_cast<std::size_t>(x)] = lo_units;
      span_[static_cast<std::size_t>(x)] = span;
      use_[static_cast<std::size_t>(x)] = any ? 255 : 0;
    }
    return any;
  }

  void write_row(const DepthView& depth, const Instance& instance, int y, bool any, uchar* to) {
    const std::uint16_t* z = depth.row(area_.y + y) + area_.x;
    if (any) {
      const std::size_t w = static_cast<std::size_t>(area_.width);
      const std::uint16_t *lo = lo_.data(), *span = span_.data();
      const uchar* use = use_.data();
      for (std::size_t x = 0; x < w; ++x)
        to[x] = static_cast<std::uint16_t>(z[x] - lo[x]) <= span[x] ? use[x] : uchar{0};
    }
    // What has no depth stays as the segmenter said.
    const int in_box = area_.y + y - instance.box.y;
    if (instance.mask.empty() || in_box < 0 || in_box >= instance.box.height) return;
    const uchar* mask = instance.mask.ptr<uchar>(in_box);
    const int at = instance.box.x - area_.x;
    for (int x = 0; x < instance.box.width; ++x)
      to[at + x] = z[at + x] == 0 && mask[x] != 0 ? uchar{255} : to[at + x];
  }

  struct Visit {
    int cell, distance;
  };

  DepthMaskFuserSettings settings_;
  std::array<Place, 4096> places_;
  InversePlane floor_;
  std::vector<InverseSample> floor_samples_;
  std::vector<float> values_;
  std::array<int, kBins> histogram_{};
  float lo_m_ = 0, hi_m_ = 0, middle_m_ = 1;
  int reach_ = 1;
  cv::Rect cells_, area_;
  std::vector<float> z_;
  std::vector<State> state_;
  std::vector<Visit> queue_;
  std::vector<std::uint16_t> lo_, span_;
  std::vector<uchar> use_;
  std::array<std::vector<uchar>, 3> rim_rows_;
};

}  // namespace stillpoint
