// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/sequence.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "synthetic/depth.hpp"
#include "synthetic/shading.hpp"

namespace stillpoint {

SyntheticSequence::SyntheticSequence(const SyntheticSettings& settings)
    : settings_(synthetic::checked_settings(settings)),
      path_(settings.motion, settings.seed),
      plan_(synthetic::build_room(scene_, settings.seed, settings.pillar)),
      people_(scene_, plan_, settings.people, settings.seated, settings.carried_object,
              settings.movers > 0, pans_left(), settings.seed),
      movers_(plan_, settings.movers, settings.seed) {
  camera_.fx = camera_.fy = 525.0 * settings_.width / 640.0;
  camera_.cx = (settings_.width - 1) / 2.0, camera_.cy = (settings_.height - 1) / 2.0;
  camera_.width = settings_.width, camera_.height = settings_.height;
  camera_.fps = settings_.fps, camera_.exposure_s = settings_.shutter_s;
  camera_.depth_units_per_m = 5000;
}

bool SyntheticSequence::pans_left() const {
  const auto aim = [&](double t_s) {
    const synthetic::Frame f = path_.at(t_s);
    return f.origin.x + 1.2 * f.z.x;
  };
  return aim(1.5) < aim(0.3);
}

synthetic::MovingThings SyntheticSequence::things(double t_s) const {
  synthetic::MovingThings out;
  people_.append(t_s, scene_.textures, out);
  movers_.append(t_s, scene_.textures, out);
  return out;
}

bool SyntheticSequence::project(const synthetic::Frame& frame, synthetic::Vec3 p, double& x,
                                double& y) const {
  const synthetic::Vec3 c = frame.to_local(p);
  if (c.z < 0.05) return false;
  x = camera_.fx * c.x / c.z + camera_.cx, y = camera_.fy * c.y / c.z + camera_.cy;
  return true;
}

double SyntheticSequence::displacement_px(const Instant& open, synthetic::Vec3 at_open,
                                          const Instant& close, synthetic::Vec3 at_close) const {
  double x0, y0, x1, y1;
  if (!project(open.camera, at_open, x0, y0) || !project(close.camera, at_close, x1, y1)) return 0;
  return std::sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0));
}

SyntheticFrame SyntheticSequence::frame(int index) const {
  detail::check(index >= 0 && index < settings_.frames, [&] {
    return "SyntheticSequence::frame: expected a number of 0 to " +
           std::to_string(settings_.frames - 1) + ", found " + std::to_string(index);
  });
  const double t = seconds(index), half = settings_.shutter_s / 2;
  const Instant middle = instant(t), open = instant(t - half), close = instant(t + half);
  synthetic::Rasterizer raster(camera_);
  raster.draw(scene_, middle.things, middle.camera, 0, 0);
  SyntheticFrame frame;
  frame.timestamp = timestamp(index);
  frame.T_world_camera = synthetic::to_isometry(middle.camera);
  cv::Mat hole_prone;
  const double longest_px = look(raster, middle, open, close, frame, hole_prone);
  const std::uint64_t seed =
      synthetic::hash(settings_.seed, 0xf4a3e, static_cast<std::uint64_t>(index));
  frame.depth =
      measure_depth(frame.exact_depth, hole_prone, camera_, settings_.depth_noise, seed + 1);
  expose(raster, t, longest_px, seed, frame.color);
  return frame;
}

double SyntheticSequence::exposure_displacement_px(const synthetic::Rasterizer& raster, int id,
                                                   synthetic::Vec3 p, const Instant& middle,
                                                   const Instant& open,
                                                   const Instant& close) const {
  using namespace synthetic;
  Vec3 at_open = p, at_close = p;
  const int moving = raster.moving_index(id);
  if (moving >= 0 && raster.is_part(id)) {
    const auto i = static_cast<std::size_t>(moving);
    const Vec3 local = middle.things.parts[i].frame.to_local(p);
    at_open = open.things.parts[i].frame.to_world(local);
    at_close = close.things.parts[i].frame.to_world(local);
  } else if (moving >= 0) {
    const auto i = static_cast<std::size_t>(moving);
    const Quad& q = middle.things.quads[i];
    const Vec3 d = p - q.corner;
    const double u = dot(d, q.edge_u) / dot(q.edge_u, q.edge_u);
    const double v = dot(d, q.edge_v) / dot(q.edge_v, q.edge_v);
    at_open = open.things.quads[i].point(u, v), at_close = close.things.quads[i].point(u, v);
  }
  return displacement_px(open, at_open, close, at_close);
}

double SyntheticSequence::look(const synthetic::Rasterizer& raster, const Instant& middle,
                               const Instant& open, const Instant& close, SyntheticFrame& frame,
                               cv::Mat& hole_prone) const {
  using namespace synthetic;
  const cv::Size size(camera_.width, camera_.height);
  frame.exact_depth.create(size, CV_32FC1), frame.labels.create(size, CV_8UC1);
  frame.limbs.create(size, CV_8UC1), hole_prone.create(size, CV_8UC1);
  struct Sum {
    int pixels = 0, measured = 0;
    double way = 0;
  };
  std::vector<Sum> sums(256);
  std::vector<double> ways;
  const int step = std::max(1, camera_.width / 160);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const int id = raster.surface_at(x, y);
      const float z = raster.depth_at(x, y);
      frame.exact_depth.at<float>(y, x) = z;
      const bool part = raster.is_part(id), there = id != Rasterizer::kNothing;
      const int label = !there ? 0 : part ? raster.part(id).label : raster.quad(id).label;
      frame.labels.at<uchar>(y, x) = static_cast<uchar>(label);
      frame.limbs.at<uchar>(y, x) =
          static_cast<uchar>(part                                    ? raster.part(id).limb
                             : label > 0 && label < kFirstMoverLabel ? kCarried
                                                                     : kNoLimb);
      const bool dark = there && (part ? raster.part(id).hole_prone : raster.quad(id).hole_prone);
      hole_prone.at<uchar>(y, x) = dark ? 255 : 0;
      Sum& sum = sums[static_cast<std::size_t>(label)];
      ++sum.pixels;
      if (!there || x % step || y % step) continue;
      const double depth = static_cast<double>(z);
      const Vec3 p = middle.camera.to_world(
          {(x - camera_.cx) / camera_.fx * depth, (y - camera_.cy) / camera_.fy * depth, depth});
      const double way = exposure_displacement_px(raster, id, p, middle, open, close);
      sum.way += way, ++sum.measured;
      ways.push_back(way);
    }
  for (int label = 0; label < 256; ++label) {
    const Sum& sum = sums[static_cast<std::size_t>(label)];
    if (sum.pixels == 0) continue;
    frame.blur.push_back({label, sum.pixels, sum.measured ? sum.way / sum.measured : 0});
  }
  if (ways.empty()) return 0;
  // Nearly the longest: a single fingertip must not cost time.
  const std::size_t rank = ways.size() * 995 / 1000;
  std::nth_element(ways.begin(), ways.begin() + static_cast<std::ptrdiff_t>(rank), ways.end());
  return ways[rank];
}

void SyntheticSequence::expose(synthetic::Rasterizer& raster, double t_s, double longest_px,
                               std::uint64_t seed, cv::Mat& color) const {
  using namespace synthetic;
  const int count = std::clamp(static_cast<int>(longest_px / 1.3) + 1, 8, 40);
  const auto number = [](int i) { return static_cast<std::uint64_t>(i); };
  std::vector<float> sum(static_cast<std::size_t>(3 * camera_.width * camera_.height), 0.0f);
  const Shader shader;
  const double turn_x = uniform(hash(seed, 1)), turn_y = uniform(hash(seed, 2));
  const double turn_level = uniform(hash(seed, 3));
  const auto part = [](double x) { return x - std::floor(x); };
  for (int i = 0; i < count; ++i) {
    // Stratified in time; spread over the pixel and the texture levels by irrational steps.
    const double time = (i + uniform(hash(seed, 4, number(i)))) / count - 0.5;
    const double x = part(turn_x + i * 0.7548776662466927) - 0.5;
    const double y = part(turn_y + i * 0.5698402909980532) - 0.5;
    const double level = part(turn_level + i * 0.6180339887498949);
    const Instant now = instant(t_s + settings_.shutter_s * time);
    raster.draw(scene_, now.things, now.camera, x, y);
    shader.add(raster, 1.0f / static_cast<float>(count), static_cast<float>(level), sum);
  }
  color.create(camera_.height, camera_.width, CV_8UC3);
  const auto noise = static_cast<float>(settings_.color_noise);
  for (int y = 0; y < camera_.height; ++y) {
    const float* light = sum.data() + static_cast<std::size_t>(3 * camera_.width * y);
    uchar* out = color.ptr<uchar>(y);
    const std::uint64_t row = hash(seed, 5, number(y));
    for (int x = 0; x < camera_.width; ++x) {
      const std::uint64_t bits = scramble(row + number(x) * 0x9e3779b97f4a7c15ull);
      for (int c = 0; c < 3; ++c) {
        // Four summed bytes of 64 bits per channel and two channels sharing some: near normal.
        const auto one =
            static_cast<float>((bits >> (20 * c) & 1023) + (bits >> (20 * c + 10) & 1023));
        const float value = 255 * std::sqrt(light[3 * x + c]);
        const float noisy = value + noise * (one - 1023.0f) * (1.0f / 417.7f);
        out[3 * x + c] = static_cast<uchar>(std::clamp(static_cast<int>(noisy + 0.5f), 0, 255));
      }
    }
  }
}

double SyntheticSequence::expected_blur_px(int label, int index) const {
  const double t = seconds(index), half = settings_.shutter_s / 2;
  const Instant open = instant(t - half), close = instant(t + half);
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < open.things.parts.size(); ++i)
    if (open.things.parts[i].label == label) {
      const synthetic::Vec3 middle{0, 0, open.things.parts[i].length / 2};
      sum += displacement_px(open, open.things.parts[i].frame.to_world(middle), close,
                             close.things.parts[i].frame.to_world(middle));
      ++count;
    }
  for (std::size_t i = 0; i < open.things.quads.size(); ++i)
    if (open.things.quads[i].label == label) {
      sum += displacement_px(open, open.things.quads[i].point(0.5, 0.5), close,
                             close.things.quads[i].point(0.5, 0.5));
      ++count;
    }
  return count ? sum / count : 0;
}

Eigen::Vector3d SyntheticSequence::center_m(int label, double t_s) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weight = 0;
  for (const synthetic::RoundPart& part : things(t_s).parts) {
    if (part.label != label) continue;
    const double area = (part.length + part.radius0 + part.radius1) * (part.radius0 + part.radius1);
    const synthetic::Vec3 middle = part.frame.to_world({0, 0, part.length / 2});
    sum += area * Eigen::Vector3d(middle.x, middle.y, middle.z);
    weight += area;
  }
  return sum / weight;
}

cv::Mat degraded_masks(const SyntheticSequence& sequence, const SyntheticFrame& frame, int index,
                       const MaskDamage& damage) {
  return degrade_masks(
      frame.labels, frame.limbs, index,
      [&](int label, int k) { return sequence.expected_blur_px(label, k); },
      synthetic::hash(sequence.settings().seed, 0xda3a9e), damage);
}

}  // namespace stillpoint
