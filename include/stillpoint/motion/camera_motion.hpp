// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/random.hpp"

namespace stillpoint {

/// The camera's motion from one frame to the next, from the frames themselves: corners are followed
/// and the rigid motion is taken that most of the world agrees with.
///
/// A corner counts by the area that it stands for in space, not in the picture: a person close by
/// may fill half of the picture, yet the walls behind are ten times as many square metres. So it
/// keeps to the world where a tracker that counts keypoints goes with the person. It drifts by
/// about a millimetre a frame: enough to doubt a host's motion, and for hosts that tell none.
class CameraMotion {
 public:
  struct Estimate {
    /// Maps points of the last frame's camera into the new one's.
    Eigen::Isometry3d T_current_last = Eigen::Isometry3d::Identity();
    /// Share of the followed area that agrees with it, 0 to 1.
    double support = 0;
  };

  /// Forgets the last frame.
  void reset() {
    last_.empty = current_.empty = true;
    last_motion_ = Eigen::Isometry3d::Identity();
    usual_support_ = 1;
  }

  /// Takes the next frame, without looking for the motion to it. O(pixels).
  void begin(const RgbdFrame& frame, const DepthView& depth) {
    flows_.clear();
    blocks_.clear();
    tolerance_ = 1;
    current_.set(frame, depth);
  }

  /// Takes the next frame and estimates the camera's motion to it. The corners of the frame before
  /// are followed from where `guess` puts them, but those where `dynamic(u, v)` says that the frame
  /// before is known to be dynamic at that pixel. Where few agree, they are followed once more from
  /// where the whole pictures fit best, and then less exact agreement will do. No value: too few
  /// corners, or no agreement among them. O(pixels), and about 3 us per corner.
  template <class Dynamic>
  std::optional<Estimate> add(const RgbdFrame& frame, const DepthView& depth,
                              const Eigen::Isometry3d& guess, Dynamic&& dynamic) {
    std::swap(last_, current_);
    begin(frame, depth);
    if (last_.empty || current_.empty || last_.size() != current_.size()) return std::nullopt;
    const int scale = current_.scale;
    const auto known_dynamic = [&](const Corner& c) { return dynamic(scale * c.x, scale * c.y); };
    last_.corners.erase(std::remove_if(last_.corners.begin(), last_.corners.end(), known_dynamic),
                        last_.corners.end());
    if (last_.corners.size() < kMinFlows) return std::nullopt;
    follow_all(depth, guess);
    const std::optional<Estimate> near_guess = search(guess);
    if (near_guess && near_guess->support > kSure) return near_guess;

    const Eigen::Isometry3d aligned = align(guess);
    if (far_px(aligned, guess) > kNearPx) {
      const double agreed = near_guess ? near_guess->support * followed_area() : 0;
      std::swap(flows_, other_flows_);
      follow_all(depth, aligned);
      const std::optional<Estimate> near_aligned = search(aligned);
      if (near_aligned && near_aligned->support * followed_area() > agreed) return near_aligned;
      if (near_guess) {
        std::swap(flows_, other_flows_);
        fill_blocks();
      }
    }
    if (near_guess) return near_guess;
    tolerance_ = kBlurredTolerance;
    return search(aligned);
  }

  /// Share of the followed area that agrees with a motion.
  double support(const Eigen::Isometry3d& T_current_last) const {
    const Mover move(T_current_last);
    Lanes agree = Lanes::Zero(), all = Lanes::Zero();
    for (const Block& b : blocks_) {
      const View seen = look(b, move, max_error_px());
      // 0 where a depth that is known speaks against it.
      const Lanes excess = (b.depth - seen.z).abs() - (0.03f + 0.012f * seen.z * seen.z);
      agree += b.area * seen.nearness * (1 - (excess * b.has_depth * kHuge).max(0.0f)).max(0.0f);
      all += b.area;
    }
    const double total = sum(all);
    return total > 0 ? sum(agree) / total : 0;
  }

  /// A corner that moves otherwise than the camera says, with others around it that do so too.
  struct Dissent {
    /// Where it is in the new frame, pixels; its depth, metres.
    float u, v, depth_m;
  };

  /// The corners that dissent from two motions (the same one twice, where there is one): off by
  /// over 1.3 pixels (of 640 in a row), four times the median by area and what blur does, with at
  /// least two others within 0.3 m that dissent alike, and more than do not. O(corners squared).
  const std::vector<Dissent>& dissents(const Eigen::Isometry3d& T_current_last,
                                       const Eigen::Isometry3d& another) {
    dissents_.clear();
    if (flows_.empty()) return dissents_;
    const float limit_another = measure_errors(another);
    other_errors_ = errors_;
    const float limit = measure_errors(T_current_last);
    for (std::size_t i = 0; i < flows_.size(); ++i) {
      const float size = told(i, errors_);
      if (size < std::max(limit, kBlurError * length_px(flows_[i])) ||
          told(i, other_errors_) < limit_another || !flows_[i].whole)
        continue;
      int with = 0, against = 0;
      for (std::size_t j = 0; j < flows_.size(); ++j) {
        if ((flows_[i].from - flows_[j].from).squaredNorm() > 0.3f * 0.3f) continue;
        if ((errors_[i] - errors_[j]).norm() > 0.5f * size)
          ++against;
        else if (told(j, errors_) >= limit && !same_patch(flows_[i], flows_[j]))
          ++with;
      }
      if (with >= 2 && with > against)
        dissents_.push_back({flows_[i].u, flows_[i].v, flows_[i].depth_m});
    }
    return dissents_;
  }

  /// Corners followed from the frame before to the one last added.
  std::size_t followed() const { return flows_.size(); }

 private:
  static constexpr std::size_t kMinFlows = 20;
  static constexpr int kHypotheses = 100;
  // In fine pixels (see Picture).
  static constexpr float kMaxError = 0.4f;
  static constexpr float kLeastDissent = 0.65f;
  static constexpr float kBlurError = 0.12f;  // of a corner's way: what is blurred is followed ill
  static constexpr float kLeastDepth = 0.2f;  // metres, before the camera
  static constexpr float kHuge = 1e30f;       // makes 1 of what is not 0
  static constexpr double kTinyStep = 1e-5;
  static constexpr double kMinSupport = 0.3, kPromising = 0.5, kUsual = 0.95;
  static constexpr double kSure = 0.5;              // no doubt that the corners were found again
  static constexpr double kNearPx = 2;              // fine ones: corners are found again from there
  static constexpr float kBlurredTolerance = 2.5f;  // times kMaxError
  static constexpr int kNear = 4, kFar = 8;         // the patch on the fine and the coarse picture
  static constexpr int kBlock = 5;                  // coarse pixels; one corner each
  static constexpr int kRadius = 4, kSide = 8;      // of the patch: -4 to +3
  static constexpr int kRim = kRadius + 2;

  // x, y: fine pixels; depth in metres.
  struct Corner {
    int x, y;
    float depth_m, score;
  };

  // A corner in space and in fine pixels before, where it is seen now (u, v in whole pixels; its
  // depth or 0).
  struct Flow {
    Eigen::Vector3f from;
    int x, y;
    float u, v, depth_m, area;
    Eigen::Matrix2f certain;  // squares an error as far as the patch can tell it: not along an edge
    bool whole;               // no edge of depth in all of the patch
  };

  // A frame in two sizes: fine, about 320 pixels in a row, so that all cameras are treated alike,
  // and coarse, half of that.
  struct Picture {
    int scale = 2;  // pixels of the frame per fine one
    cv::Mat gray, fine, coarse, score;
    cv::Mat fine_values, coarse_values;  // CV_32FC1: read many times
    std::vector<Corner> corners;
    std::vector<float> highest;  // score of the columns of a row of blocks
    float fx = 1, fy = 1, cx = 0, cy = 0;
    cv::Size frame_size;
    bool empty = true;

    cv::Size size() const { return frame_size; }
    // Where a fine pixel's centre is in the frame.
    float frame_px(int fine_px) const {
      const float s = static_cast<float>(scale);
      return s * static_cast<float>(fine_px) + 0.5f * (s - 1);
    }

    void set(const RgbdFrame& frame, const DepthView& view) {
      empty = view.empty();
      corners.clear();
      if (empty) return;
      frame_size = frame.color.size();
      scale = std::max(1, (frame_size.width + 160) / 320);
      empty = std::min(frame_size.width, frame_size.height) < 2 * kRim * scale;  // nothing in it
      if (empty) return;
      if (frame.color.channels() == 3)
        cv::extractChannel(frame.color, gray, 1);
      else
        gray = frame.color;
      shrink(gray, scale, fine);
      shrink(fine, 2, coarse);
      fine.convertTo(fine_values, CV_32F);
      coarse.convertTo(coarse_values, CV_32F);
      cv::cornerMinEigenVal(coarse, score, 3);
      fx = view.focal_px(), fy = view.focal_y_px(), cx = view.center_x(), cy = view.center_y();
      for (int y0 = kRim; y0 + kBlock + kRim <= coarse.rows; y0 += kBlock) {
        highest.resize(static_cast<std::size_t>(coarse.cols));
        std::copy_n(score.ptr<float>(y0), coarse.cols, highest.begin());
        for (int y = y0 + 1; y < y0 + kBlock; ++y)
          raise(score.ptr<float>(y), static_cast<std::size_t>(coarse.cols), highest.data());
        for (int x0 = kRim; x0 + kBlock + kRim <= coarse.cols; x0 += kBlock) {
          const float* column = highest.data() + x0;
          float most = column[0];
          for (int x = 1; x < kBlock; ++x) most = std::max(most, column[x]);
          if (!(most > kMinScore)) continue;
          Corner best = first_of_block(x0, y0, most);
          best.depth_m = whole_depth(view, scale * best.x, scale * best.y, kNear, scale);
          if (best.depth_m > 0) corners.push_back(best);
        }
      }
      if (corners.size() > kMaxCorners) {
        std::nth_element(
            corners.begin(), corners.begin() + kMaxCorners, corners.end(),
            [](const Corner& a, const Corner& b) {
              return a.score != b.score ? a.score > b.score : a.y != b.y ? a.y < b.y : a.x < b.x;
            });
        corners.resize(kMaxCorners);
      }
    }

    // By a whole factor; a rest of rows or columns is left out.
    static void shrink(const cv::Mat& from, int factor, cv::Mat& to) {
      const cv::Size size(from.cols / factor, from.rows / factor);
      if (factor == 1)
        to = from;
      else
        cv::resize(from(cv::Rect(cv::Point(), size * factor)), to, size, 0, 0, cv::INTER_AREA);
    }

    // Where a block of `score` reaches its highest value first.
    Corner first_of_block(int x0, int y0, float most) const {
      for (int y = y0; y < y0 + kBlock; ++y) {
        const float* row = score.ptr<float>(y);
        for (int x = x0; x < x0 + kBlock; ++x)
          if (row[x] == most) return {2 * x, 2 * y, 0, most};
      }
      return {0, 0, 0, 0};
    }

    static void raise(const float* STILLPOINT_RESTRICT by, std::size_t n,
                      float* STILLPOINT_RESTRICT highest) {
      for (std::size_t x = 0; x < n; ++x) highest[x] = by[x] > highest[x] ? by[x] : highest[x];
    }
  };
  static constexpr std::size_t kMaxCorners = 250;
  static constexpr float kMinScore = 2e-4f;

  // Depth around a pixel, up to `fine_reach` fine pixels away; 0 where it is not measured or torn
  // by an edge.
  static float whole_depth(const DepthView& view, int u, int v, int fine_reach, int scale) {
    const int reach = fine_reach * scale, step = 2 * scale;
    if (u < reach || v < reach || u + reach >= view.size().width || v + reach >= view.size().height)
      return 0;
    std::uint16_t lo = 65535, hi = 0;  // lo: one less, so that 0, no measurement, is the highest
    for (int y = v - reach; y <= v + reach; y += step) {
      const std::uint16_t* row = view.row(y) + u;
      for (int x = -reach; x <= reach; x += step) {
        lo = std::min(lo, static_cast<std::uint16_t>(row[x] - 1));
        hi = std::max(hi, row[x]);
      }
    }
    int sum = 0, n = 0;
    for (int y = v - step; y <= v + step; y += step)
      for (int x = u - step; x <= u + step; x += step) {
        const std::uint16_t z = view.row(y)[x];
        sum += z, n += z != 0;
      }
    if (n < 5) return 0;
    const float near = view.to_m(static_cast<std::uint16_t>(lo + 1));
    const float far = view.to_m(hi);
    return far - near < 0.05f + 0.07f * near
               ? static_cast<float>(sum) / static_cast<float>(n) * view.metres_per_unit_value()
               : 0;
  }

  // The motion that most of the followed area agrees with.
  std::optional<Estimate> search(const Eigen::Isometry3d& guess) {
    if (flows_.size() < kMinFlows) return std::nullopt;
    Eigen::Isometry3d best = guess;
    double s = improve(best);
    Eigen::Isometry3d as_before = last_motion_;
    const double before = improve(as_before);
    if (before > s) best = as_before, s = before;
    // As good as it usually gets: no need to look further.
    const bool usual = s > kUsual * usual_support_;
    RandomGenerator random(1);
    // The more agree, the sooner three that are all of the world have been drawn.
    for (int i = 0; !usual && i < kHypotheses && i * s * s * s < 40; ++i) {
      std::optional<Eigen::Isometry3d> T = from_three(random, guess);
      if (!T || support(*T) < kPromising * s) continue;
      const double improved = improve(*T);
      if (improved > s) best = *T, s = improved;
    }
    s = improve(best, 6);
    if (s < kMinSupport) return std::nullopt;
    last_motion_ = best;
    if (tolerance_ == 1) usual_support_ += (s - usual_support_) * (s > usual_support_ ? 0.5 : 0.1);
    return Estimate{best, s};
  }

  void follow_all(const DepthView& depth, const Eigen::Isometry3d& guess) {
    flows_.clear();
    for (const Corner& c : last_.corners) follow(c, depth, guess);
    fill_blocks();
  }

  // Fills errors_; returns from which on one is not just noise.
  float measure_errors(const Eigen::Isometry3d& T_current_last) {
    const Eigen::Matrix3f R = T_current_last.linear().cast<float>();
    const Eigen::Vector3f t = T_current_last.translation().cast<float>();
    errors_.clear();
    sorted_.clear();
    float half = 0;
    for (const Flow& f : flows_) {
      errors_.push_back(error_px(f, R * f.from + t));
      sorted_.emplace_back(errors_.back().norm(), f.area);
      half += 0.5f * f.area;
    }
    // The median by area: people close by may have most of the corners.
    std::sort(sorted_.begin(), sorted_.end());
    std::size_t middle = 0;
    while (middle + 1 < sorted_.size() && (half -= sorted_[middle].second) > 0) ++middle;
    return std::max(kLeastDissent * static_cast<float>(current_.scale), 4 * sorted_[middle].first);
  }

  // The size of a flow's error, as far as its patch can tell.
  float told(std::size_t i, const std::vector<Eigen::Vector2f>& errors) const {
    return std::sqrt(std::max(0.0f, errors[i].dot(flows_[i].certain * errors[i])));
  }

  float max_error_px() const { return tolerance_ * kMaxError * static_cast<float>(current_.scale); }

  double followed_area() const {
    double area = 0;
    for (const Flow& f : flows_) area += static_cast<double>(f.area);
    return area;
  }

  Eigen::Vector2f error_px(const Flow& f, const Eigen::Vector3f& q) const {
    if (q.z() < kLeastDepth) return {1e6f, 1e6f};
    return {current_.fx * q.x() / q.z() + current_.cx - f.u,
            current_.fy * q.y() / q.z() + current_.cy - f.v};
  }

  // Four flows side by side, as vector instructions take them; lanes without one have no area.
  using Lanes = Eigen::Array<float, 4, 1>;
  struct Block {
    Lanes x, y, z;  // in space before
    Lanes u, v, depth, has_depth, area;
  };

  void fill_blocks() {
    blocks_.clear();
    for (std::size_t i = 0; i < flows_.size(); ++i) {
      const Eigen::Index k = static_cast<Eigen::Index>(i % 4);
      if (k == 0) {
        blocks_.emplace_back();
        Block& b = blocks_.back();
        for (Lanes* lanes : {&b.x, &b.y, &b.u, &b.v, &b.depth, &b.has_depth, &b.area})
          lanes->setZero();
        b.z.setOnes();
      }
      Block& b = blocks_.back();
      const Flow& f = flows_[i];
      b.x[k] = f.from.x(), b.y[k] = f.from.y(), b.z[k] = f.from.z();
      b.u[k] = f.u, b.v[k] = f.v, b.depth[k] = f.depth_m, b.area[k] = f.area;
      b.has_depth[k] = f.depth_m > 0 ? 1.0f : 0.0f;
    }
  }

  struct Mover {
    Eigen::Matrix3f R;
    Eigen::Vector3f t;
    explicit Mover(const Eigen::Isometry3d& T)
        : R(T.linear().cast<float>()), t(T.translation().cast<float>()) {}
  };

  // How a motion explains a block: place in space over z, z, the errors in pixels, and 1 where the
  // corner is seen just there, falling to 0 at the greatest error.
  struct View {
    Lanes x, y, z, eu, ev, nearness;
  };
  View look(const Block& b, const Mover& m, float max_error_px) const {
    View s;
    // What came too close is nowhere near its corner.
    s.z = (m.R(2, 0) * b.x + m.R(2, 1) * b.y + m.R(2, 2) * b.z + m.t[2]).max(kLeastDepth);
    const Lanes inverse = 1 / s.z;
    s.x = (m.R(0, 0) * b.x + m.R(0, 1) * b.y + m.R(0, 2) * b.z + m.t[0]) * inverse;
    s.y = (m.R(1, 0) * b.x + m.R(1, 1) * b.y + m.R(1, 2) * b.z + m.t[1]) * inverse;
    s.eu = current_.fx * s.x + current_.cx - b.u;
    s.ev = current_.fy * s.y + current_.cy - b.v;
    const float per_square = 1 / (max_error_px * max_error_px);
    s.nearness = (1 - (s.eu * s.eu + s.ev * s.ev) * per_square).max(0.0f);
    return s;
  }

  // The same in every build, whatever its vectors.
  static double sum(const Lanes& v) {
    return (static_cast<double>(v[0]) + v[1]) + (static_cast<double>(v[2]) + v[3]);
  }

  // How far apart two turns put a corner, fine pixels.
  double far_px(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) const {
    const double angle = Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle();
    return angle * static_cast<double>(current_.fx) / current_.scale;
  }

  // The rotation of the camera by the whole pictures, with the translation of `guess`: corners are
  // found again from a near guess only, but pictures made very small fit from far.
  Eigen::Isometry3d align(const Eigen::Isometry3d& guess) {
    Eigen::Isometry3d T = guess;
    Picture::shrink(last_.fine_values, 4, smaller_before_[0]);
    Picture::shrink(current_.fine_values, 4, smaller_[0]);
    for (std::size_t i = 1; i < smaller_.size(); ++i) {
      Picture::shrink(smaller_before_[i - 1], 2, smaller_before_[i]);
      Picture::shrink(smaller_[i - 1], 2, smaller_[i]);
    }
    for (std::size_t level = smaller_.size(); level-- > 0;) {
      const int fine_px = 4 << level;
      // A difference of brightness beyond this has a reason of its own; from far, most have none.
      const float unlike = 5.0f * static_cast<float>(fine_px);
      if (std::min(smaller_[level].cols, smaller_[level].rows) < 3) continue;
      cv::GaussianBlur(smaller_before_[level], small_before_, {3, 3}, 0.8);
      cv::GaussianBlur(smaller_[level], small_, {3, 3}, 0.8);
      float brighter = 0;
      for (int i = 0; i < 8; ++i) {
        const std::optional<double> size = align_step(fine_px, unlike, brighter, T);
        if (!size) return guess;
        if (*size < 1e-3) break;
      }
    }
    T.linear() = Eigen::Quaterniond(T.linear()).normalized().toRotationMatrix();
    return T;
  }

  // One step of Gauss and Newton over all pixels of the small pictures; its size, radians.
  std::optional<double> align_step(int fine_px, float unlike, float& brighter,
                                   Eigen::Isometry3d& T) {
    const double scale = fine_px * current_.scale;
    Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
    K(0, 0) = current_.fx / scale, K(0, 2) = (current_.cx + 0.5) / scale - 0.5;
    K(1, 1) = current_.fy / scale, K(1, 2) = (current_.cy + 0.5) / scale - 0.5;
    const Eigen::Matrix3d to_now = K * T.linear() * K.inverse();
    cv::Matx33d warp;
    for (int i = 0; i < 9; ++i) warp.val[i] = to_now(i / 3, i % 3);
    cv::warpPerspective(small_, warped_, warp, small_.size(),
                        cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_CONSTANT, -1);
    const float fx = static_cast<float>(K(0, 0)), cx = static_cast<float>(K(0, 2));
    const float fy = static_cast<float>(K(1, 1)), cy = static_cast<float>(K(1, 2));
    const auto four = [](const float* first) { return Eigen::Map<const Lanes>(first); };
    std::array<std::array<Lanes, 4>, 4> H;
    std::array<Lanes, 4> g;
    for (auto& row : H) row.fill(Lanes::Zero());
    g.fill(Lanes::Zero());
    for (int v = 1; v + 1 < small_.rows; ++v) {
      const float* before = small_before_.ptr<float>(v);
      const float* above = small_before_.ptr<float>(v - 1);
      const float* below = small_before_.ptr<float>(v + 1);
      const float* now = warped_.ptr<float>(v);
      const Lanes y = Lanes::Constant((static_cast<float>(v) - cy) / fy);
      for (int u = 1; u + 4 < small_.cols; u += 4) {
        const Lanes x = (static_cast<float>(u) - cx + Lanes(0, 1, 2, 3)) / fx;
        const Lanes gx = 0.5f * fx * (four(before + u + 1) - four(before + u - 1));
        const Lanes gy = 0.5f * fy * (four(below + u) - four(above + u));
        const Lanes seen = (four(now + u) * kHuge + 1).max(0.0f).min(1.0f);  // 0: out of view
        const Lanes error = four(now + u) - four(before + u) - brighter;
        const Lanes likely = 1 / (1 + error * error * (1 / (unlike * unlike)));
        const Lanes weight = seen * likely * likely;
        // Of a turn about x, y and z, and the brightness.
        const std::array<Lanes, 4> J = {-gx * x * y - gy * (1 + y * y),
                                        gx * (1 + x * x) + gy * x * y, gy * x - gx * y,
                                        Lanes::Ones()};
        for (std::size_t i = 0; i < 4; ++i) {
          const Lanes a = weight * J[i];
          for (std::size_t j = 0; j <= i; ++j) H[i][j] += a * J[j];
          g[i] += a * error;
        }
      }
    }
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right;
    for (int i = 0; i < 4; ++i) {
      const std::size_t row = static_cast<std::size_t>(i);
      for (int j = 0; j <= i; ++j) normal(i, j) = sum(H[row][static_cast<std::size_t>(j)]);
      right[i] = sum(g[row]);
    }
    const Eigen::Vector4d d = normal.ldlt().solve(right);
    const double angle = d.head<3>().norm();
    if (!(angle < 0.3)) return std::nullopt;
    // The steps are those of the picture before, so they are taken back.
    if (angle > 0)
      T.linear() = T.linear() * Eigen::AngleAxisd(-angle, d.head<3>() / angle).toRotationMatrix();
    brighter += static_cast<float>(d[3]);
    return angle;
  }

  void follow(const Corner& c, const DepthView& depth, const Eigen::Isometry3d& guess) {
    const int scale = current_.scale;
    const float u0 = current_.frame_px(c.x), v0 = current_.frame_px(c.y);
    Flow f;
    f.x = c.x, f.y = c.y;
    f.from = {(u0 - last_.cx) / last_.fx * c.depth_m, (v0 - last_.cy) / last_.fy * c.depth_m,
              c.depth_m};
    const Eigen::Vector3f q = (guess * f.from.cast<double>()).cast<float>();
    if (q.z() < kLeastDepth) return;
    float du = current_.fx * q.x() / q.z() + current_.cx - u0;
    float dv = current_.fy * q.y() / q.z() + current_.cy - v0;
    if (!shift(last_.coarse_values, current_.coarse_values, c.x / 2, c.y / 2, 2 * scale, 0.1f, du,
               dv, f.certain) ||
        !shift(last_.fine_values, current_.fine_values, c.x, c.y, scale, 0.02f, du, dv, f.certain))
      return;
    f.u = u0 + du, f.v = v0 + dv;
    f.area = std::min(c.depth_m, 4.0f) * std::min(c.depth_m, 4.0f);
    const int u = static_cast<int>(f.u + 0.5f), v = static_cast<int>(f.v + 0.5f);
    f.depth_m = whole_depth(depth, u, v, kFar, scale);
    f.whole = f.depth_m > 0;
    if (!f.whole) f.depth_m = whole_depth(depth, u, v, kNear, scale);
    flows_.push_back(f);
  }

  // How far it went in the picture.
  float length_px(const Flow& f) const {
    const float du = f.u - current_.frame_px(f.x), dv = f.v - current_.frame_px(f.y);
    return std::sqrt(du * du + dv * dv);
  }

  static bool same_patch(const Flow& a, const Flow& b) {
    return std::abs(a.x - b.x) <= kRadius && std::abs(a.y - b.y) <= kRadius;
  }

  // A template of Lucas and Kanade, row by row. Sums are kept per column until the end.
  struct Patch {
    using Row = Eigen::Array<float, kSide, 1>;
    std::array<Row, kSide> gx, gy, value;

    static Row row(const float* first) { return Eigen::Map<const Row>(first); }

    void set(const float* first, std::size_t stride) {
      for (std::size_t v = 0; v < kSide; ++v, first += stride) {
        gx[v] = 0.5f * (row(first + 1) - row(first - 1));
        gy[v] = 0.5f * (row(first + stride) - row(first - stride));
        value[v] = row(first);
      }
    }

    // Of the shift in x and y and the brightness.
    Eigen::Matrix3f information() const {
      Row xx = Row::Zero(), xy = xx, yy = xx, x = xx, y = xx;
      for (std::size_t v = 0; v < kSide; ++v) {
        xx += gx[v] * gx[v], xy += gx[v] * gy[v], yy += gy[v] * gy[v];
        x += gx[v], y += gy[v];
      }
      Eigen::Matrix3f H;
      H << xx.sum(), xy.sum(), x.sum(), xy.sum(), yy.sum(), y.sum(), x.sum(), y.sum(),
          kSide * kSide;
      return H;
    }

    // Sums of the residuals times the slopes in x and y, of the residuals and of their squares,
    // where the patch begins at `first` and a part (a, b) of a pixel.
    Eigen::Vector4f compare(const float* first, std::size_t stride, float a, float b,
                            float bias) const {
      const float w00 = (1 - a) * (1 - b), w01 = a * (1 - b), w10 = (1 - a) * b, w11 = a * b;
      Row x = Row::Zero(), y = x, one = x, squares = x;
      for (std::size_t v = 0; v < kSide; ++v, first += stride) {
        const Row r = w00 * row(first) + w01 * row(first + 1) + w10 * row(first + stride) +
                      w11 * row(first + stride + 1) - value[v] - bias;
        x += r * gx[v], y += r * gy[v], one += r, squares += r * r;
      }
      return {x.sum(), y.sum(), one.sum(), squares.sum()};
    }
  };

  // Follows a patch from (x, y) of `from` into `to`, smaller by `scale` than the whole picture: du
  // and dv, in pixels of the whole one, are the guess and become what is found (Lucas and Kanade
  // with the slopes of the template, and free brightness). Ends at steps under `enough` pixels.
  static bool shift(const cv::Mat& from, const cv::Mat& to, int x, int y, int scale, float enough,
                    float& du, float& dv, Eigen::Matrix2f& certain) {
    if (x < kRadius + 1 || y < kRadius + 1 || x + kRadius + 1 >= from.cols ||
        y + kRadius + 1 >= from.rows)
      return false;
    Patch patch;
    patch.set(from.ptr<float>(y - kRadius) + x - kRadius, from.step1());
    const Eigen::Matrix3f H = patch.information();
    const float half = 0.5f * (H(0, 0) + H(1, 1)), turn = 0.5f * (H(0, 0) - H(1, 1));
    certain = H.topLeftCorner<2, 2>() / (half + std::sqrt(turn * turn + H(0, 1) * H(0, 1)));
    Eigen::Matrix3f inverse;
    bool invertible = false;
    H.computeInverseWithCheck(inverse, invertible, 1.0f);
    if (!invertible) return false;
    const float per_pixel = 1.0f / static_cast<float>(scale);
    float px = static_cast<float>(x - kRadius) + du * per_pixel;
    float py = static_cast<float>(y - kRadius) + dv * per_pixel;
    const float start_x = px, start_y = py;
    float bias = 0;
    for (int iteration = 0; iteration < 8; ++iteration) {
      if (!(px >= 0 && py >= 0 && px < static_cast<float>(to.cols - kSide - 1) &&
            py < static_cast<float>(to.rows - kSide - 1)))
        return false;
      const int ix = static_cast<int>(px), iy = static_cast<int>(py);
      const Eigen::Vector4f sums =
          patch.compare(to.ptr<float>(iy) + ix, to.step1(), px - static_cast<float>(ix),
                        py - static_cast<float>(iy), bias);
      const Eigen::Vector3f d = inverse * sums.head<3>();
      px -= d.x(), py -= d.y(), bias += d.z();
      if (std::abs(px - start_x) > kMaxShift || std::abs(py - start_y) > kMaxShift) return false;
      if (d.x() * d.x() + d.y() * d.y() > enough * enough) continue;
      if (sums[3] > kMaxResidual * kMaxResidual * kSide * kSide) return false;
      break;
    }
    du = (px - static_cast<float>(x - kRadius)) * static_cast<float>(scale);
    dv = (py - static_cast<float>(y - kRadius)) * static_cast<float>(scale);
    return true;
  }

  // The motion that three corners agree with: exact, by steps from the guess.
  std::optional<Eigen::Isometry3d> from_three(RandomGenerator& random, Eigen::Isometry3d T) const {
    std::array<const Flow*, 3> three;
    for (const Flow*& f : three) f = &flows_[random.below(flows_.size())];
    for (int i = 0; i < 3; ++i) {
      Normal normal;
      for (const Flow* f : three) add_to(normal, *f, T);
      if (normal.count < 3 || !step(normal, T)) return std::nullopt;
    }
    return T;
  }

  // Up to `steps` steps towards those that agree; the support then.
  double improve(Eigen::Isometry3d& T, int steps = 2) const {
    for (int i = 0; i < steps; ++i) {
      Normal normal;
      add_agreeing(normal, T);
      if (normal.count < kMinFlows / 2) return 0;
      const std::optional<double> size = step(normal, T);
      if (!size) return 0;
      if (*size < kTinyStep) break;
    }
    return support(T);
  }

  struct Normal {
    Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();  // lower half
    Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
    std::size_t count = 0;
  };

  // All flows within the greatest error of a motion, the nearer the more.
  void add_agreeing(Normal& normal, const Eigen::Isometry3d& T) const {
    const Mover move(T);
    const float fx = current_.fx, fy = current_.fy;
    std::array<std::array<Lanes, 6>, 6> H;
    std::array<Lanes, 6> g;
    for (auto& row : H) row.fill(Lanes::Zero());
    g.fill(Lanes::Zero());
    Lanes count = Lanes::Zero();
    for (const Block& b : blocks_) {
      const View s = look(b, move, max_error_px());
      const Lanes weight = b.area * s.nearness * s.nearness, inverse = 1 / s.z;
      count += (weight * kHuge).min(1.0f);
      // Rows of the Jacobian; the first has no second entry and the second no first.
      const std::array<Lanes, 6> ju = {fx * inverse,    Lanes::Zero(),        -fx * inverse * s.x,
                                       -fx * s.x * s.y, fx * (1 + s.x * s.x), -fx * s.y};
      const std::array<Lanes, 6> jv = {Lanes::Zero(),         fy * inverse,   -fy * inverse * s.y,
                                       -fy * (1 + s.y * s.y), fy * s.x * s.y, fy * s.x};
      const Lanes a0 = weight * ju[0], b1 = weight * jv[1];
      H[0][0] += a0 * ju[0], H[1][1] += b1 * jv[1];
      g[0] += a0 * s.eu, g[1] += b1 * s.ev;
      for (std::size_t i = 2; i < 6; ++i) {
        const Lanes a = weight * ju[i], c = weight * jv[i];
        H[i][0] += a * ju[0], H[i][1] += c * jv[1];
        for (std::size_t j = 2; j <= i; ++j) H[i][j] += a * ju[j] + c * jv[j];
        g[i] += a * s.eu + c * s.ev;
      }
    }
    for (int i = 0; i < 6; ++i) {
      const std::size_t row = static_cast<std::size_t>(i);
      for (int j = 0; j <= i; ++j) normal.H(i, j) = sum(H[row][static_cast<std::size_t>(j)]);
      normal.g(i) = sum(g[row]);
    }
    normal.count = static_cast<std::size_t>(sum(count) + 0.5);
  }

  // One flow, however far off.
  void add_to(Normal& normal, const Flow& f, const Eigen::Isometry3d& T) const {
    const Eigen::Vector3d q = T * f.from.cast<double>();
    if (q.z() < kLeastDepth) return;
    const double z = q.z(), x = q.x() / z, y = q.y() / z;
    const double fx = current_.fx, fy = current_.fy;
    const Eigen::Vector2d e(fx * x + current_.cx - f.u, fy * y + current_.cy - f.v);
    const double ju[6] = {fx / z, 0, -fx * x / z, -fx * x * y, fx * (1 + x * x), -fx * y};
    const double jv[6] = {0, fy / z, -fy * y / z, -fy * (1 + y * y), fy * x * y, fy * x};
    const double weight = f.area;
    const double a0 = weight * ju[0], b1 = weight * jv[1];
    normal.H(0, 0) += a0 * ju[0], normal.g(0) += a0 * e.x();
    normal.H(1, 1) += b1 * jv[1], normal.g(1) += b1 * e.y();
    for (int i = 2; i < 6; ++i) {
      const double a = weight * ju[i], b = weight * jv[i];
      normal.H(i, 0) += a * ju[0], normal.H(i, 1) += b * jv[1];
      for (int j = 2; j <= i; ++j) normal.H(i, j) += a * ju[j] + b * jv[j];
      normal.g(i) += a * e.x() + b * e.y();
    }
    ++normal.count;
  }

  // Its size, metres and radians; none if there is no solution.
  static std::optional<double> step(const Normal& normal, Eigen::Isometry3d& T) {
    const Eigen::Matrix<double, 6, 1> d = normal.H.ldlt().solve(-normal.g);
    if (!d.allFinite() || d.norm() > 1) return std::nullopt;
    Eigen::Isometry3d by = Eigen::Isometry3d::Identity();
    const double angle = d.tail<3>().norm();
    if (angle > 1e-12)
      by.linear() = Eigen::AngleAxisd(angle, d.tail<3>() / angle).toRotationMatrix();
    by.translation() = d.head<3>();
    T = by * T;
    T.linear() = Eigen::Quaterniond(T.linear()).normalized().toRotationMatrix();
    return d.norm();
  }

  static constexpr float kMaxShift = 5, kMaxResidual = 14;

  Picture last_, current_;
  Eigen::Isometry3d last_motion_ = Eigen::Isometry3d::Identity();
  double usual_support_ = 1;
  float tolerance_ = 1;  // of the last estimate, times kMaxError
  // Of align().
  std::array<cv::Mat, 3> smaller_before_, smaller_;
  cv::Mat small_before_, small_, warped_;
  std::vector<Flow> flows_, other_flows_;
  std::vector<Block> blocks_;  // the same, four side by side
  std::vector<Eigen::Vector2f> errors_, other_errors_;
  std::vector<std::pair<float, float>> sorted_;  // error and area
  std::vector<Dissent> dissents_;
};

}  // namespace stillpoint
