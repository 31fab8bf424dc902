// SPDX-License-Identifier: BSD-2-Clause
// DepthMaskFuser alone, per frame, dilation included.
#include <benchmark/benchmark.h>

#include "scene.hpp"
#include "stillpoint/depth/depth_mask_fuser.hpp"

namespace stillpoint {
namespace bench {
namespace {

using Settings = DepthMaskFuserSettings;

void run(benchmark::State& state, const Settings& settings, const Scene& scene) {
  cv::setNumThreads(1);
  DepthMaskFuser fuser(settings, scene.camera);
  Player player(scene);
  for (auto _ : state) {
    const RgbdFrame& frame = player.next();
    benchmark::DoNotOptimize(fuser.fuse(frame, player.segmentation()).image.data);
  }
  state.counters["mask_share"] = fuser.mask_share();
}

void BM_DepthMaskFuser(benchmark::State& state, const Settings& settings) {
  run(state, settings, rendered_scene());
}
BENCHMARK_CAPTURE(BM_DepthMaskFuser, default, Settings())->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(BM_DepthMaskFuser, paper, Settings::paper())->Unit(benchmark::kMicrosecond);

void by_pixels(benchmark::State& state, const Settings& settings) {
  const cv::Size size = image_sizes()[static_cast<std::size_t>(state.range(0))];
  run(state, settings, scaled_scene(size));
  state.SetComplexityN(size.area());
  state.counters["pixels"] = size.area();
}

void by_people(benchmark::State& state, const Settings& settings) {
  run(state, settings, crowd_scene(static_cast<int>(state.range(0))));
  state.SetComplexityN(state.range(0));
}

const bool registered = [] {
  for (const bool paper : {false, true}) {
    const std::string name = std::string("BM_DepthMaskFuser/") + (paper ? "paper" : "default");
    const Settings settings = paper ? Settings::paper() : Settings();
    auto* pixels = benchmark::RegisterBenchmark((name + "/by_pixels").c_str(), by_pixels, settings);
    for (std::size_t i = 0; i < image_sizes().size(); ++i)
      pixels->Arg(static_cast<std::int64_t>(i));
    auto* people = benchmark::RegisterBenchmark((name + "/by_people").c_str(), by_people, settings);
    for (const int n : people_counts()) people->Arg(n);
    for (auto* b : {pixels, people}) b->Unit(benchmark::kMicrosecond)->Complexity(benchmark::oN);
  }
  return true;
}();

}  // namespace
}  // namespace bench
}  // namespace stillpoint
