// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/backends/host.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <mutex>
#include <thread>

#include "stillpoint/core/rigid_motion.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/keypoints/feature_budget.hpp"
#include "stillpoint/motion/constant_velocity.hpp"

namespace stillpoint {
namespace {

using Clock = std::chrono::steady_clock;

// A host may pass timestamps through another unit; frames are never this close.
constexpr double kSameFrame_s = 1e-4;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

FrontEndSettings front_end_settings(const HostSettings& settings) {
  FrontEndSettings s = FrontEndSettings::preset(settings.preset);
  s.dynamic_classes = settings.dynamic_classes;
  s.depth.dilation_px = settings.dilation_px;
  s.blur.exposure_s = settings.exposure_s;
  s.sensor = settings.sensor;
  return s;
}

KeypointFilterSettings filter_settings(const HostSettings& settings, int min_kept) {
  KeypointFilterSettings s = front_end_settings(settings).probability;
  s.min_kept = min_kept;
  return s;
}

void check_settings(const HostSettings& settings) {
  const auto check = [](int value, const char* name) {
    detail::check(value >= 0, [&] {
      return std::string("HostSettings.") + name + ": expected at least 0, found " +
             std::to_string(value);
    });
  };
  check(settings.min_keypoints, "min_keypoints");
  check(settings.min_keypoints_at_start, "min_keypoints_at_start");
}

}  // namespace

struct HostFrontEnd::Impl {
  Impl(const Camera& camera, const HostSettings& host_settings)
      : settings(host_settings),
        front_end(front_end_settings(host_settings), camera),
        start_filter(filter_settings(host_settings, host_settings.min_keypoints_at_start)),
        filter(filter_settings(host_settings, host_settings.min_keypoints)) {}

  // The living ones, for the hook. Never destroyed: a host's thread may outlive main().
  static std::vector<std::weak_ptr<Impl>>& living() {
    static auto* const all = new std::vector<std::weak_ptr<Impl>>;
    return *all;
  }
  static std::mutex& living_mutex() {
    static auto* const mutex = new std::mutex;
    return *mutex;
  }

  const DynamicMask* find(double timestamp) const {
    for (const DynamicMask& m : masks)
      if (!m.image.empty() && std::abs(m.timestamp - timestamp) < kSameFrame_s) return &m;
    return nullptr;
  }

  int select(double timestamp, const cv::Point2f* points, int count, int* kept);

  const HostSettings settings;
  // The runner's thread only.
  FrontEnd front_end;
  ConstantVelocity velocity;
  double last_s = 0;

  // Shared with the hook.
  mutable std::mutex mutex;
  std::array<DynamicMask, kMasks> masks;
  std::size_t newest = 0;
  ProbabilisticKeypointFilter<> start_filter, filter;
  bool started = false;
  FeatureBudget budget;
  HostStats stats;
  std::thread::id fed_by;
};

HostFrontEnd::HostFrontEnd(const Camera& camera, const HostSettings& settings) {
  check_settings(settings);
  impl_ = std::make_shared<Impl>(camera, settings);
  const std::lock_guard<std::mutex> lock(Impl::living_mutex());
  Impl::living().push_back(impl_);
}

HostFrontEnd::~HostFrontEnd() {
  const std::lock_guard<std::mutex> lock(Impl::living_mutex());
  auto& all = Impl::living();
  all.erase(std::remove_if(all.begin(), all.end(),
                           [this](const std::weak_ptr<Impl>& other) {
                             return other.expired() || other.lock() == impl_;
                           }),
            all.end());
}

void HostFrontEnd::compute_mask(const RgbdFrame& frame, const Segmentation& segmentation) {
  Impl& a = *impl_;
  const Clock::time_point start = Clock::now();
  const DynamicMask& mask =
      a.front_end.compute_mask(frame, segmentation, a.velocity.predict(a.last_s, frame.timestamp));
  a.last_s = frame.timestamp;

  const std::lock_guard<std::mutex> lock(a.mutex);
  a.newest = (a.newest + 1) % kMasks;
  DynamicMask& kept = a.masks[a.newest];
  mask.image.copyTo(kept.image);
  kept.timestamp = mask.timestamp;
  kept.age_s = mask.age_s;
  a.fed_by = std::this_thread::get_id();
  const FrameStats& done = a.front_end.stats();
  a.stats.timestamp = frame.timestamp;
  a.stats.status = done.status;
  a.stats.instances = done.instances;
  a.stats.restored = done.restored;
  a.stats.mask_share = done.mask_share;
  ++a.stats.frames;
  a.stats.mask_ms = milliseconds_since(start);
}

void HostFrontEnd::correct_pose(double timestamp, const cv::Matx44d& T_world_camera) {
  Impl& a = *impl_;
  detail::check(std::isfinite(timestamp), [&] {
    return "correct_pose: timestamp: expected seconds, found " + std::to_string(timestamp);
  });
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 4; ++c) T.matrix()(r, c) = T_world_camera(r, c);
  const bool rigid = T.matrix().allFinite() &&
                     (T.linear().transpose() * T.linear()).isIdentity(1e-3) &&
                     T.linear().determinant() > 0;
  detail::check(rigid, [] {
    return std::string(
        "correct_pose: T_world_camera: expected a rotation and a translation, found another "
        "matrix; if the host is lost, call set_lost()");
  });
  // Hosts track in floats.
  detail::normalize_rotation(T);
  a.velocity.add(timestamp, T);
  if (std::abs(timestamp - a.last_s) < kSameFrame_s) a.front_end.correct_pose(T);
  const std::lock_guard<std::mutex> lock(a.mutex);
  a.started = true;
}

void HostFrontEnd::set_lost(bool starts_anew) {
  impl_->velocity.reset();
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  if (starts_anew) impl_->started = false;
}

cv::Mat HostFrontEnd::mask() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->masks[impl_->newest].image.clone();
}

HostStats HostFrontEnd::stats() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->stats;
}

int HostFrontEnd::features_for(int wanted, int most) const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->budget.features_for(wanted, most);
}

int HostFrontEnd::Impl::select(double timestamp, const cv::Point2f* points, int count, int* kept) {
  struct View {  // an array for the filter, without a copy
    const cv::Point2f* data;
    std::size_t n;
    std::size_t size() const { return n; }
    const cv::Point2f& operator[](std::size_t i) const { return data[i]; }
  };
  const Clock::time_point start = Clock::now();
  const std::lock_guard<std::mutex> lock(mutex);
  const DynamicMask* mask = find(timestamp);
  if (!mask) return -1;
  auto& judge = started ? filter : start_filter;
  const Selection& selection = judge.filter(View{points, static_cast<std::size_t>(count)}, *mask);
  std::copy(selection.kept.begin(), selection.kept.end(), kept);
  const int n = static_cast<int>(selection.kept.size());
  // Hosts that hand no poses back have started when they could have.
  if (n >= settings.min_keypoints_at_start) started = true;

  const int still = static_cast<int>(
      std::count(selection.reason.begin(), selection.reason.end(), KeypointReason::kStatic));
  budget.add(count, still, mask->timestamp);
  if (mask == &masks[newest]) stats.status |= judge.status();
  stats.keypoints = count;
  stats.kept = n;
  ++stats.filtered;
  stats.hook_ms = milliseconds_since(start);
  return n;
}

int HostFrontEnd::select(double timestamp, const cv::Point2f* points, int count, int* kept) {
  return impl_->select(timestamp, points, count, kept);
}

int HostFrontEnd::select_by_timestamp(double timestamp, const cv::Point2f* points, int count,
                                      int* kept) {
  std::shared_ptr<Impl> chosen;
  {
    const std::lock_guard<std::mutex> lock(Impl::living_mutex());
    for (const std::weak_ptr<Impl>& weak : Impl::living()) {
      const std::shared_ptr<Impl> one = weak.lock();
      if (!one) continue;
      const std::lock_guard<std::mutex> inner(one->mutex);
      if (!one->find(timestamp)) continue;
      chosen = one;
      if (one->fed_by == std::this_thread::get_id()) break;
    }
  }
  return chosen ? chosen->select(timestamp, points, count, kept) : -1;
}

}  // namespace stillpoint
