// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/fill_image.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/lens.hpp"
#include "stillpoint/segmentation/draw_warped.hpp"
#include "stillpoint/segmentation/line_predictor.hpp"
#include "stillpoint/segmentation/template_patch.hpp"

namespace stillpoint {

/// An object that SegmentationCompensator remembers from frame to frame: its mask, depth and last
/// places, carried into the current image by the camera's motion and the object's own line.
class RememberedObject {
 public:
  /// A pixel of the last frame and its depth in metres (0: not measured).
  struct Point {
    float x, y, z;
  };

  /// Given by its owner; the same as long as the object is remembered.
  int id = 0;
  std::string class_name;
  float score = 1;
  /// Timestamp of the last frame in which it was shown, and of the last one in which it
  /// counted as seen.
  double shown_s = 0, seen_s = 0;
  /// How long it would be carried along had that frame alone shown it, seconds; for an object
  /// without a class.
  double once_s = 0;
  /// How long it has been seen, seconds.
  double seen_for_s = 0;
  /// How many frames showed it.
  int times_seen = 1;
  /// How many of the segmenter's results in a row had to be mended; those of sharp images may
  /// count twice.
  int mended = 0;
  bool alive = true;

  /// Takes over what a frame shows of the object: `instance`, where `limit` (unless null or a bare
  /// box) covers it too; `depth`: the frame's or empty. Returns by how many metres it is farther
  /// than predicted (0: unknown). Copies the mask; O(box).
  float observe(const FrameContext& context, const DepthView& depth, const Instance& instance,
                const Instance* limit) {
    class_name = instance.class_name;
    score = instance.score;
    if (limit && limit->mask.empty()) limit = nullptr;
    box_ = limit ? instance.box & limit->box : instance.box;
    mask_.resize(static_cast<std::size_t>(box_.area()));
    cv::Mat mask(box_.size(), CV_8UC1, mask_.data());
    if (instance.mask.empty() || box_.empty())
      detail::fill_image(mask, uchar{255});
    else
      instance.mask(box_ - instance.box.tl()).copyTo(mask);
    if (limit && !box_.empty()) cv::bitwise_and(mask, limit->mask(box_ - limit->box.tl()), mask);
    // The image is only looked at where the depth cannot tell.
    if (depth.empty())
      patch_.sample(context.gray(), instance);
    else
      patch_.clear();
    const float expected_z = predicted_z_;
    sample_points(context.size(), depth);
    const float farther_m = z_ > 0 && expected_z > 0 ? z_ - expected_z : 0;
    if (camera_known_) depth_motion_m_ += farther_m;
    return farther_m;
  }

  /// How far it has moved by itself away from the camera, or towards it, since
  /// forget_depth_motion(), metres.
  float depth_motion_m() const { return depth_motion_m_; }
  void forget_depth_motion() { depth_motion_m_ = 0; }

  /// Adds the object's place (upper-left corner of its box, or centre of its mask) to the history
  /// of at most `length` places; a second call for one timestamp replaces the first.
  void add_place(double timestamp, bool use_corner, std::size_t length) {
    const cv::Point2d place = use_corner ? cv::Point2d(box_.x, box_.y) : center_;
    if (places_ > 0 && history_[places_ - 1].timestamp >= timestamp) --places_;
    length = std::min(length, history_.size());
    if (places_ >= length) {
      const std::size_t drop = places_ - length + 1;
      std::copy(history_.begin() + static_cast<std::ptrdiff_t>(drop),
                history_.begin() + static_cast<std::ptrdiff_t>(places_), history_.begin());
      places_ -= drop;
    }
    history_[places_++] = {place.x, place.y, timestamp};
  }

  /// Forgets where it was, and how far away.
  void forget_past() { places_ = 0, z_ = predicted_z_ = 0, measured_ = false; }

  /// Carries the object to `timestamp`: by the camera's motion (if known), then along its line.
  /// `max_speed_px_s` bounds the object's own motion.
  void predict(double timestamp, const Lens& lens,
               const std::optional<Eigen::Isometry3d>& T_current_last, double max_speed_px_s) {
    const Eigen::Vector2d center(center_.x, center_.y);
    predicted_z_ = z_;
    affine_.setIdentity();
    camera_known_ = T_current_last.has_value();
    if (camera_known_) {
      const Eigen::Isometry3d& T = *T_current_last;
      const double z = static_cast<double>(z_);
      if (z_ > 0) predicted_z_ = static_cast<float>((T * (z * ray_of(lens, center))).z());
      for (std::size_t i = 0; i < places_; ++i) {
        const Eigen::Vector2d p = transfer(lens, T, z, {history_[i].x, history_[i].y});
        history_[i].x = p.x(), history_[i].y = p.y();
      }
      // As an affine map around the center: exact enough over one object and one frame.
      const double step = 8;
      for (int axis = 0; axis < 2; ++axis) {
        const Eigen::Vector2d beside = step * Eigen::Vector2d::Unit(axis);
        affine_.col(axis) =
            (transfer(lens, T, z, center + beside) - transfer(lens, T, z, center - beside)) /
            (2 * step);
      }
      affine_.col(2) = transfer(lens, T, z, center) - affine_.leftCols<2>() * center;
    }
    const Eigen::Vector2d at = affine_.leftCols<2>() * center + affine_.col(2);
    displacement_px_ = (at - center).norm();
    if (places_ == 0) return;
    const TimedPoint& last = history_[places_ - 1];
    const cv::Point2d next = predict_on_line(history_.data(), places_, timestamp);
    Eigen::Vector2d shift(next.x - last.x, next.y - last.y);
    const double limit = max_speed_px_s * std::max(0.0, timestamp - last.timestamp);
    if (shift.norm() > limit) shift *= limit / shift.norm();
    affine_.col(2) += shift;
    displacement_px_ = (at + shift - center).norm();
  }

  /// Where a static point that was seen at `pixel` is seen after the camera's motion; without a
  /// depth (z_m = 0), one far away. A point that comes to lie behind the camera stays.
  static Eigen::Vector2d transfer(const Lens& lens, const Eigen::Isometry3d& T_current_last,
                                  double z_m, const Eigen::Vector2d& pixel) {
    Eigen::Vector3d p = T_current_last.linear() * ray_of(lens, pixel);
    if (z_m > 0) p += T_current_last.translation() / z_m;
    if (!(p.z() > 0.05)) return pixel;
    return lens.pixel(Eigen::Vector2f(p.hnormalized().cast<float>())).cast<double>();
  }

  /// Where it is predicted, to be put back there.
  struct Place {
    Eigen::Matrix<double, 2, 3, Eigen::DontAlign> affine;
    float z;
  };
  Place place() const { return {affine_, predicted_z_}; }
  void set_place(const Place& place) { affine_ = place.affine, predicted_z_ = place.z; }
  /// Moves the prediction away from the camera (or towards it), which makes it smaller.
  void shift_depth(float metres) {
    if (!(predicted_z_ > 0)) return;
    metres = std::max(metres, -0.5f * predicted_z_);
    const double scale = predicted_z_ / (predicted_z_ + metres);
    const Eigen::Vector2d center =
        affine_.leftCols<2>() * Eigen::Vector2d(center_.x, center_.y) + affine_.col(2);
    affine_ *= scale;
    affine_.col(2) += (1 - scale) * center;
    predicted_z_ += metres;
  }
  /// Moves the prediction by whole pixels.
  void shift_prediction(const cv::Point& shift) {
    affine_(0, 2) += shift.x, affine_(1, 2) += shift.y;
  }

  /// Where a point of the last frame is predicted, with its predicted depth (0 where unknown).
  Point predicted(const Point& p) const {
    return {static_cast<float>(affine_(0, 0) * p.x + affine_(0, 1) * p.y + affine_(0, 2)),
            static_cast<float>(affine_(1, 0) * p.x + affine_(1, 1) * p.y + affine_(1, 2)),
            p.z > 0 ? p.z + predicted_z_ - z_ : predicted_z_};
  }

  /// The predicted box, clipped to the image; empty if it has left it.
  cv::Rect predicted_box(const cv::Size& size) const {
    float x0 = 1e6f, y0 = 1e6f, x1 = -1e6f, y1 = -1e6f;
    for (const int corner : {0, 1, 2, 3}) {
      // Pixels reach half a pixel around their centres.
      const Point p =
          predicted({static_cast<float>(box_.x + (corner & 1 ? box_.width : 0)) - 0.5f,
                     static_cast<float>(box_.y + (corner & 2 ? box_.height : 0)) - 0.5f, 0});
      x0 = std::min(x0, p.x), x1 = std::max(x1, p.x);
      y0 = std::min(y0, p.y), y1 = std::max(y1, p.y);
    }
    const auto first = [](float v) {
      return static_cast<int>(std::ceil(std::min(1e6f, std::max(-1e6f, v))));
    };
    const int x = first(x0), y = first(y0);
    return cv::Rect(x, y, std::max(0, first(x1) - x), std::max(0, first(y1) - y)) &
           cv::Rect(cv::Point(), size);
  }

  /// ORs the predicted mask into `out`, which covers `area` of the image. O(area).
  void draw_predicted(const cv::Rect& area, cv::Mat& out) const {
    const cv::Rect part = predicted_box({area.x + area.width, area.y + area.height}) & area;
    if (part.empty()) return;
    detail::draw_warped(mask_.data(), box_, affine_, part, area.tl(), out);
  }

  const std::vector<Point>& inside() const { return inside_; }
  const std::vector<Point>& ring() const { return ring_; }
  const TemplatePatch& patch() const { return patch_; }
  const cv::Rect& box() const { return box_; }
  /// Centre of the pixels of inside().
  const cv::Point2d& center() const { return center_; }
  /// Median depth of its pixels when these were last measured, metres; 0: never.
  float depth_m() const { return z_; }
  /// Whether depth can tell where it is: its pixels were measured in the last frame that showed it
  /// and had depth, or once, and not so close that cameras begin to fail.
  bool measurable() const { return measured_ || z_ > DepthView::kSurelyMeasuredM; }
  float predicted_depth_m() const { return predicted_z_; }
  /// How far the last predict() carried its centre across the image, pixels.
  double displacement_px() const { return displacement_px_; }

 private:
  static constexpr std::size_t kEnoughPoints = 12, kFewestDepths = 5;

  static Eigen::Vector3d ray_of(const Lens& lens, const Eigen::Vector2d& pixel) {
    return lens.ray(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()))
        .cast<double>()
        .homogeneous();
  }

  // Pixels spread over the mask, and pixels around it that show something else: more closely where
  // a thin mask in a large box is hardly met.
  void sample_points(const cv::Size& size, const DepthView& depth) {
    const int margin = std::max(6, std::min(box_.width, box_.height) / 5);
    const cv::Rect around = cv::Rect(box_.x - margin, box_.y - margin, box_.width + 2 * margin,
                                     box_.height + 2 * margin) &
                            cv::Rect(cv::Point(), size);
    const int step = std::max(2, static_cast<int>(std::sqrt(around.area() / 300.0)));
    sample_points(around, step, depth);
    if (inside_.size() < kEnoughPoints) sample_points(around, std::max(2, step / 2), depth);
    depths_.clear();
    cv::Point2d sum;
    for (const Point& p : inside_) {
      sum += cv::Point2d(static_cast<double>(p.x), static_cast<double>(p.y));
      if (p.z > 0) depths_.push_back(p.z);
    }
    center_ = inside_.empty() ? cv::Point2d(box_.x + 0.5 * box_.width, box_.y + 0.5 * box_.height)
                              : sum / static_cast<double>(inside_.size());
    z_ = predicted_z_;  // who is without depth for a frame has not gone elsewhere
    if (!depth.empty()) measured_ = depths_.size() >= kFewestDepths;
    if (depths_.size() >= kFewestDepths) {
      const auto median = depths_.begin() + static_cast<std::ptrdiff_t>(depths_.size() / 2);
      std::nth_element(depths_.begin(), median, depths_.end());
      z_ = *median;
    }
    // Around an object only what lies at another depth tells where its outline is.
    const float z = z_;
    ring_.erase(std::remove_if(ring_.begin(), ring_.end(),
                               [z](const Point& p) { return p.z > 0 && std::abs(p.z - z) < 0.5f; }),
                ring_.end());
    predicted_z_ = z_;
  }

  // Every `step`-th pixel of every `step`-th row.
  void sample_points(const cv::Rect& around, int step, const DepthView& depth) {
    inside_.clear(), ring_.clear();
    for (int y = around.y + step / 2; y < around.y + around.height; y += step) {
      const std::uint16_t* row = depth.empty() ? nullptr : depth.row(y);
      const bool in_rows = y >= box_.y && y < box_.y + box_.height;
      const uchar* mask =
          mask_.data() + (in_rows ? static_cast<std::ptrdiff_t>(y - box_.y) * box_.width : 0);
      for (int x = around.x + step / 2; x < around.x + around.width; x += step) {
        const bool inside =
            in_rows && x >= box_.x && x < box_.x + box_.width && mask[x - box_.x] != 0;
        (inside ? inside_ : ring_)
            .push_back(
                {static_cast<float>(x), static_cast<float>(y), row ? depth.to_m(row[x]) : 0.0f});
      }
    }
  }

  cv::Rect box_;
  std::vector<uchar> mask_;
  cv::Point2d center_;
  float z_ = 0, predicted_z_ = 0, depth_motion_m_ = 0;
  bool measured_ = false, camera_known_ = false;
  double displacement_px_ = 0;
  std::vector<Point> inside_, ring_;
  std::vector<float> depths_;
  TemplatePatch patch_;
  std::array<TimedPoint, 8> history_{};
  std::size_t places_ = 0;
  Eigen::Matrix<double, 2, 3, Eigen::DontAlign> affine_ = Eigen::Matrix<double, 2, 3>::Identity();
};

}  // namespace stillpoint
