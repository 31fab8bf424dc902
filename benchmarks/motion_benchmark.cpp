// SPDX-License-Identifier: BSD-2-Clause
// MotionCheck alone, per frame; and the camera's motion, the greater part of it. And the blur.
#include <benchmark/benchmark.h>

#include "scene.hpp"
#include "stillpoint/motion/blur_meter.hpp"
#include "stillpoint/motion/camera_motion.hpp"
#include "stillpoint/motion/motion_check.hpp"

namespace stillpoint {
namespace bench {
namespace {

void run(benchmark::State& state, const Scene& scene) {
  cv::setNumThreads(1);
  FrameContext context;
  EgoMotion ego;
  MotionCheck check;
  Player player(scene);
  const cv::Mat nobody = cv::Mat::zeros(scene.frames[0].color.size(), CV_8UC1);
  for (auto _ : state) {
    context.begin(player.next(), scene.camera);
    ego.track(context, std::nullopt);
    benchmark::DoNotOptimize(check.find(context, ego).data());
    check.remember(nobody);
  }
}

void BM_MotionCheck_default(benchmark::State& state) { run(state, rendered_scene()); }
BENCHMARK(BM_MotionCheck_default)->Name("BM_MotionCheck/default")->Unit(benchmark::kMicrosecond);

void by_pixels(benchmark::State& state) {
  const Scene scene = scaled_scene(image_sizes()[static_cast<std::size_t>(state.range(0))]);
  run(state, scene);
  state.SetComplexityN(scene.frames[0].color.size().area());
}
BENCHMARK(by_pixels)
    ->Name("BM_MotionCheck/default/by_pixels")
    ->DenseRange(0, 3)
    ->Complexity(benchmark::oN)
    ->Unit(benchmark::kMicrosecond);

void BM_CameraMotion(benchmark::State& state) {
  cv::setNumThreads(1);
  const Scene& scene = rendered_scene();
  CameraMotion motion;
  FrameContext context;
  Player player(scene);
  Eigen::Isometry3d last = Eigen::Isometry3d::Identity();
  double followed = 0;
  for (auto _ : state) {
    context.begin(player.next(), scene.camera);
    const auto found = motion.add(context, last);
    if (found) last = found->T_current_last;
    followed += static_cast<double>(motion.followed());
  }
  state.counters["corners"] = followed / static_cast<double>(state.iterations());
}
BENCHMARK(BM_CameraMotion)->Unit(benchmark::kMicrosecond);

void BM_BlurMeter(benchmark::State& state) {
  cv::setNumThreads(1);
  const Scene& scene = rendered_scene();
  BlurMeter meter(BlurMeterSettings(), scene.camera);
  Player player(scene);
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (auto _ : state) benchmark::DoNotOptimize(meter.measure(player.next(), T).whole.sharpness);
}
BENCHMARK(BM_BlurMeter)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace bench
}  // namespace stillpoint
