// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/scratch.hpp"
#include "stillpoint/motion/camera_motion.hpp"
#include "stillpoint/motion/coarse_frame.hpp"
#include "stillpoint/motion/free_space_memory.hpp"

namespace stillpoint {

/// Settings of MotionCheck.
struct MotionCheckSettings {
  /// Side of a cell, an even number. 0: about 1/80 of the picture's width.
  int block_px = 0;
  /// Least number of cells, and least area, that must stand in space that was seen to be free
  /// before a region counts as moved. 50 cells are enough however close, and so however small.
  int min_moved_cells = 6;
  double min_moved_area_m2 = 0.02;
  /// Least share of such cells in the region grown from them.
  double min_moved_share = 0.2;
  /// How far the region grows from them over connected depth.
  double growth_m = 0.35;
  /// A motion of the camera between two frames beyond these is taken for a cut, and the memory is
  /// dropped.
  double max_step_m = 0.5;
  double max_turn_deg = 30;
  /// The host's motion is not believed where the frames' own has so much more support (0 to 1).
  double max_doubt = 0.08;

  /// Throws Error if a setting makes no sense.
  void check() const {
    const auto fail = [](const char* name, const char* expected, double found) {
      throw Error(std::string("MotionCheckSettings.") + name + ": expected " + expected +
                  ", found " + std::to_string(found));
    };
    if (block_px < 0 || block_px > 64 || block_px % 2)
      fail("block_px", "an even number, 0 to 64", block_px);
    if (min_moved_cells < 1) fail("min_moved_cells", "at least 1", min_moved_cells);
    if (!(min_moved_area_m2 >= 0)) fail("min_moved_area_m2", "at least 0", min_moved_area_m2);
    if (!(min_moved_share >= 0 && min_moved_share <= 1))
      fail("min_moved_share", "0 to 1", min_moved_share);
    if (!(growth_m >= 0)) fail("growth_m", "at least 0", growth_m);
    if (!(max_step_m > 0)) fail("max_step_m", "more than 0", max_step_m);
    if (!(max_doubt >= 0)) fail("max_doubt", "at least 0", max_doubt);
    if (!(max_turn_deg > 0)) fail("max_turn_deg", "more than 0", max_turn_deg);
  }
};

/// Finds what moves against the static world, without a network: whatever stands where earlier
/// frames looked through has moved there.
///
/// It keeps the coarse depth of the last 1.7 s with the camera's poses. Each cell of the new frame
/// is carried into some of these frames, 0.1 to 1.6 s old: if free space was seen there, the cell
/// has moved; if the same surface was there, it is static; else nothing is said ("unknown" is never
/// "dynamic"). Cells on depth edges and without depth say nothing, but large holes at the end of
/// the sensor's range are free space (FarHoles). Moved cells that hang together grow over connected
/// depth, never into static cells, and become instances without a class.
/// The long base finds slow movers, the depth finds those without texture, and blur does no harm.
/// Surfaces around corners that move together otherwise than the camera have moved at once: so
/// people are found in the first frames, before there is a past to compare with.
///
/// It needs depth. The camera's motion it measures itself (CameraMotion); the host's pose of the
/// last frame (correct()) is better and taken instead, unless the frames speak against it: a
/// tracker that went with a person close by is not followed. Where the frames show too little, the
/// host's prediction serves, and without any nothing is found. Memory: about 5 MB. Cost: O(cells x
/// 6 + pixels). Not thread-safe; one object per camera.
class MotionCheck {
 public:
  using Settings = MotionCheckSettings;

  explicit MotionCheck(const Settings& settings = {}, const Camera& camera = {})
      : settings_(settings), camera_(camera) {
    settings.check();
  }

  const Settings& settings() const { return settings_; }

  /// Finds the movers of a frame. `T_current_last` maps points of the last frame's camera into this
  /// one's, as the host predicts it, if it does. The reference and the masks stay valid until the
  /// next call. Call remember() afterwards.
  const std::vector<Instance>& find(const RgbdFrame& frame,
                                    const std::optional<Eigen::Isometry3d>& T_current_last) {
    check_frame(frame);
    found_.clear();
    judged_ = remembered_ = false;
    view_.set(frame, camera_);
    if (frame.timestamp <= last_s_ || (T_current_last && is_cut(*T_current_last))) reset();
    last_s_ = frame.timestamp;
    if (view_.empty()) {
      camera_motion_.reset();
      return found_;
    }
    const bool measured = view_.any_measured();
    if (size_ != frame.color.size()) {
      reset();
      size_ = frame.color.size();
      block_ = settings_.block_px > 0 ? settings_.block_px
                                      : std::clamp(2 * ((size_.width + 80) / 160), 2, 64);
    }
    motion_ = choose_motion(frame, T_current_last);
    if (!motion_ && !memory_.empty()) reset();
    if (motion_) {
      if (is_cut(*motion_)) reset();
      T_world_camera_ = T_world_camera_ * motion_->inverse();
      normalize(T_world_camera_);
    }
    current_.set(view_, block_);
    judged_ = true;
    if (measured)
      memory_.judge(frame.timestamp, T_world_camera_, current_, evidence_);
    else
      evidence_.assign(current_.size(), CellEvidence::kUnknown);
    if (seen_motion_ && seen_motion_->support > 0.5) hear_dissents(T_current_last);
    grow();
    find_standing();
    return found_;
  }

  /// What the last find() returned.
  const std::vector<Instance>& found() const { return found_; }

  /// Sets `mask`, CV_8UC1 of the size of `area` (inside the frame), to 0 where the last find() saw
  /// a surface that earlier frames had seen there and not taken for dynamic. With `wide_only`, what
  /// is thinner than three cells stays: cells at an outline show both sides of it. O(pixels of
  /// area).
  void clear_static(const cv::Rect& area, cv::Mat& mask, bool wide_only) const {
    if (!judged_) return;
    const int b = block_, right = area.x + area.width, bottom = area.y + area.height;
    const int last_x = std::min((right + b - 1) / b, current_.width);
    const int last_y = std::min((bottom + b - 1) / b, current_.height);
    const std::vector<std::uint8_t>& standing = wide_only ? wide_standing_ : standing_;
    for (int y = area.y / b; y < last_y; ++y) {
      const std::uint8_t* cells = standing.data() + bordered(0, y);
      const int top = std::max(y * b, area.y), under = std::min((y + 1) * b, bottom);
      for (int x = area.x / b, end; x < last_x; x = end + 1) {
        for (end = x; end < last_x && cells[end] != 0;) ++end;
        if (end == x) continue;
        const int left = std::max(x * b, area.x), n = std::min(end * b, right) - left;
        for (int v = top; v < under; ++v)
          std::memset(mask.ptr<uchar>(v - area.y) + (left - area.x), 0,
                      static_cast<std::size_t>(n));
      }
    }
  }

  /// Whether the last find() saw at a pixel of its frame a surface, three cells wide or more, that
  /// earlier frames had seen there and not taken for dynamic. O(1).
  bool known_static(const cv::Point& pixel) const {
    const int x = pixel.x / block_, y = pixel.y / block_;
    return judged_ && x < current_.width && y < current_.height &&
           wide_standing_[bordered(x, y)] != 0;
  }

  /// The camera's motion to the last frame of find() as it was used there: the frames' own, or the
  /// host's where they show too little. Empty: neither.
  const std::optional<Eigen::Isometry3d>& motion() const { return motion_; }

  /// Tells the true motion of the last frame, once the host has tracked it: T_current_last as in
  /// find(), but measured. Call it before remember() or any time before the next find().
  void correct(const Eigen::Isometry3d& T_world_camera) {
    if (!judged_) return;
    if (host_pose_) {
      const Eigen::Isometry3d step = host_pose_->inverse() * T_world_camera;
      if (is_cut(step)) {
        reset();  // the host relocalised or closed a loop
      } else if (trusts(step.inverse())) {
        T_world_camera_ = last_pose_ * step;
        normalize(T_world_camera_);
        if (remembered_) memory_.set_newest_pose(T_world_camera_);
      }
    }
    host_pose_ = T_world_camera;
    last_pose_ = T_world_camera_;
  }

  /// Remembers the last frame of find(): `dynamic`, CV_8UC1 of the frame's size, 255 = dynamic, is
  /// what was taken for dynamic in it (before dilation); such cells never speak for "static".
  void remember(const cv::Mat& dynamic) {
    if (!judged_) return;
    detail::check(dynamic.type() == CV_8UC1 && dynamic.size() == size_, [&] {
      return "MotionCheck::remember: expected CV_8UC1 of the frame's size, found " +
             detail::type_text(dynamic) + " " + detail::size_text(dynamic);
    });
    const int b = block_;
    dynamic_.assign(current_.size(), 0);
    for (int y = 0; y < current_.height; ++y)
      for (int k = b / 4; k < b; k += b / 2) {
        const uchar* row = dynamic.ptr<uchar>(y * b + k);
        for (int x = 0; x < current_.width; ++x)
          dynamic_[current_.index(x, y)] |=
              static_cast<std::uint8_t>((row[x * b + b / 4] | row[x * b + b / 4 + b / 2]) != 0);
      }
    memory_.add(last_s_, T_world_camera_, current_, dynamic_);
    remembered_ = true;
  }

  /// Forgets everything (a cut in the sequence).
  void reset() {
    memory_.clear();
    dynamic_.clear();
    T_world_camera_ = last_pose_ = Eigen::Isometry3d::Identity();
    host_pose_.reset();
  }

 private:
  static constexpr float kDissentReachM = 0.1f;
  static constexpr int kManyCells = 50;

  enum State : std::uint8_t { kFree, kTaken };

  static void normalize(Eigen::Isometry3d& T) {
    // Products of many rotations must stay a rotation.
    T.linear() = Eigen::Quaterniond(T.linear()).normalized().toRotationMatrix();
  }

  // The host's motion, unless the frames speak against it.
  std::optional<Eigen::Isometry3d> choose_motion(const RgbdFrame& frame,
                                                 const std::optional<Eigen::Isometry3d>& host) {
    const Eigen::Isometry3d guess = host      ? *host
                                    : motion_ ? *motion_
                                              : Eigen::Isometry3d::Identity();
    const int b = block_;
    seen_motion_ = camera_motion_.add(frame, view_, guess, [&](int u, int v) {
      const int x = u / b, y = v / b;
      return dynamic_.size() == current_.size() && x < current_.width && y < current_.height &&
             dynamic_[current_.index(x, y)] != 0;
    });
    if (!seen_motion_) return host;
    return seen_motion_->T_current_last;
  }

  // Whether a measured motion of the host's agrees with what the frames show.
  bool trusts(const Eigen::Isometry3d& T_current_last) const {
    return !seen_motion_ ||
           camera_motion_.support(T_current_last) > seen_motion_->support - settings_.max_doubt;
  }

  bool is_cut(const Eigen::Isometry3d& T) const {
    return !(T.translation().norm() < settings_.max_step_m &&
             Eigen::AngleAxisd(T.linear()).angle() * 180 / 3.14159265358979 <
                 settings_.max_turn_deg);
  }

  // Surfaces around corners that move for themselves have moved, whatever else speaks for them: a
  // slow surface lies over where it was a moment ago.
  void hear_dissents(const std::optional<Eigen::Isometry3d>& host) {
    const float per_cell = 1.0f / static_cast<float>(block_);
    const Eigen::Isometry3d& seen = seen_motion_->T_current_last;
    for (const CameraMotion::Dissent& d :
         camera_motion_.dissents(seen, host && trusts(*host) ? *host : seen)) {
      const int reach = static_cast<int>(kDissentReachM * current_.fx / d.depth_m);
      const int cx = static_cast<int>(d.u * per_cell), cy = static_cast<int>(d.v * per_cell);
      for (int y = std::max(0, cy - reach); y <= std::min(current_.height - 1, cy + reach); ++y)
        for (int x = std::max(0, cx - reach); x <= std::min(current_.width - 1, cx + reach); ++x) {
          const std::size_t i = current_.index(x, y);
          if (current_.depth_m[i] > 0 && std::abs(current_.depth_m[i] - d.depth_m) < 0.1f)
            evidence_[i] = CellEvidence::kMoved;
        }
    }
  }

  // Where a cell is in an array with a border of one cell around.
  std::size_t bordered(int x, int y) const {
    return static_cast<std::size_t>(y + 1) * static_cast<std::size_t>(current_.width + 2) +
           static_cast<std::size_t>(x + 1);
  }

  // Static cells, and these opened by a cross of five; beyond the picture all may be static.
  void find_standing() {
    const std::size_t n = bordered(current_.width, current_.height) + 1;
    detail::refill(standing_, n, std::uint8_t{1});
    detail::refill(core_, n, std::uint8_t{0});
    wide_standing_.resize(n);
    const std::size_t width = static_cast<std::size_t>(current_.width), stride = width + 2;
    for (int y = 0; y < current_.height; ++y)
      mark_static(evidence_.data() + current_.index(0, y), width, &standing_[bordered(0, y)]);
    for (int y = 0; y < current_.height; ++y)
      erode(&standing_[bordered(0, y)], width, stride, &core_[bordered(0, y)]);
    for (int y = 0; y < current_.height; ++y)
      dilate(&core_[bordered(0, y)], width, stride, &wide_standing_[bordered(0, y)]);
  }

  static void mark_static(const CellEvidence* STILLPOINT_RESTRICT cells, std::size_t n,
                          std::uint8_t* STILLPOINT_RESTRICT out) {
    for (std::size_t i = 0; i < n; ++i) out[i] = cells[i] == CellEvidence::kStatic;
  }
  static void erode(const std::uint8_t* in, std::size_t n, std::size_t stride,
                    std::uint8_t* STILLPOINT_RESTRICT out) {
    const std::uint8_t *left = in - 1, *right = in + 1, *above = in - stride, *below = in + stride;
    for (std::size_t i = 0; i < n; ++i)
      out[i] = static_cast<std::uint8_t>(in[i] & left[i] & right[i] & above[i] & below[i]);
  }
  static void dilate(const std::uint8_t* in, std::size_t n, std::size_t stride,
                     std::uint8_t* STILLPOINT_RESTRICT out) {
    const std::uint8_t *left = in - 1, *right = in + 1, *above = in - stride, *below = in + stride;
    for (std::size_t i = 0; i < n; ++i)
      out[i] = static_cast<std::uint8_t>(in[i] | left[i] | right[i] | above[i] | below[i]);
  }

  // Moved cells that hang together, and the connected cells around them.
  void grow() {
    state_.assign(current_.size(), kFree);
    for (int y = 0; y < current_.height; ++y)
      for (int x = 0; x < current_.width; ++x) {
        const std::size_t i = current_.index(x, y);
        if (evidence_[i] != CellEvidence::kMoved || state_[i] != kFree) continue;
        collect(x, y);
      }
  }

  struct Visit {
    int x, y, distance;
  };

  void collect(int x0, int y0) {
    queue_.clear();
    state_[current_.index(x0, y0)] = kTaken;
    queue_.push_back({x0, y0, 0});
    int moved = 0;
    double area = 0;
    cv::Rect box(x0, y0, 1, 1);
    for (std::size_t k = 0; k < queue_.size(); ++k) {
      const Visit visit = queue_[k];
      const std::size_t i = current_.index(visit.x, visit.y);
      const float z = current_.depth_m[i];
      if (evidence_[i] == CellEvidence::kMoved) {
        ++moved;
        area += static_cast<double>(z) * z / (current_.fx * current_.fy);
      }
      box |= cv::Rect(visit.x, visit.y, 1, 1);
      const int reach = static_cast<int>(settings_.growth_m * current_.fx / z);
      static constexpr int kNext[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
      for (const auto& next : kNext) {
        const int x = visit.x + next[0], y = visit.y + next[1];
        if (x < 0 || y < 0 || x >= current_.width || y >= current_.height) continue;
        const std::size_t j = current_.index(x, y);
        const float zj = current_.depth_m[j];
        if (state_[j] != kFree || zj <= 0 || evidence_[j] == CellEvidence::kStatic) continue;
        if (std::abs(zj - z) > 0.03f + 0.025f * z) continue;
        const int distance = evidence_[j] == CellEvidence::kMoved ? 0 : visit.distance + 1;
        if (distance > reach) continue;
        state_[j] = kTaken;
        queue_.push_back({x, y, distance});
      }
    }
    if (moved < settings_.min_moved_cells ||
        (area < settings_.min_moved_area_m2 && moved < kManyCells) ||
        moved < settings_.min_moved_share * static_cast<double>(queue_.size()))
      return;
    add_instance(box);
  }

  void add_instance(const cv::Rect& cells) {
    const int b = block_;
    if (buffers_.size() <= found_.size()) buffers_.resize(found_.size() + 1);
    std::vector<uchar>& buffer = buffers_[found_.size()];
    found_.emplace_back();
    Instance& instance = found_.back();
    instance.class_name.clear();
    instance.box = cv::Rect(cells.x * b, cells.y * b, cells.width * b, cells.height * b);
    buffer.assign(static_cast<std::size_t>(instance.box.area()), 0);
    instance.mask = cv::Mat(instance.box.size(), CV_8UC1, buffer.data());
    for (const Visit& v : queue_)
      for (int y = 0; y < b; ++y)
        std::fill_n(instance.mask.ptr<uchar>((v.y - cells.y) * b + y) + (v.x - cells.x) * b, b,
                    uchar{255});
  }

  Settings settings_;
  Camera camera_;
  DepthView view_;
  cv::Size size_;
  int block_ = 8;  // side of a cell, pixels
  CoarseFrame current_;
  CameraMotion camera_motion_;
  std::optional<CameraMotion::Estimate> seen_motion_;
  std::optional<Eigen::Isometry3d> motion_;
  FreeSpaceMemory memory_;
  std::vector<CellEvidence> evidence_;
  std::vector<std::uint8_t> standing_, core_, wide_standing_;  // at bordered()
  Eigen::Isometry3d T_world_camera_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d last_pose_ = Eigen::Isometry3d::Identity();  // at the host's last pose
  std::optional<Eigen::Isometry3d> host_pose_;
  double last_s_ = -1e300;
  bool judged_ = false, remembered_ = false;  // the last frame
  std::vector<State> state_;
  std::vector<Visit> queue_;
  std::vector<std::uint8_t> dynamic_;
  std::vector<Instance> found_;
  std::vector<std::vector<uchar>> buffers_;
};

}  // namespace stillpoint
