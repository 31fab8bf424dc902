// SPDX-License-Identifier: BSD-2-Clause
// SegmentationCompensator alone, per frame: compensate() with a result that is there, and
// (`no_result`) every second frame without one, so that everything is predicted and restored.
#include <benchmark/benchmark.h>

#include "scene.hpp"
#include "stillpoint/segmentation/segmentation_compensator.hpp"

namespace stillpoint {
namespace bench {
namespace {

using Settings = SegmentationCompensatorSettings;

void run(benchmark::State& state, const Settings& settings, const Scene& scene, bool no_result) {
  cv::setNumThreads(1);
  SegmentationCompensator compensator(settings, scene.camera);
  const Segmentation nothing;
  Player player(scene);
  double restored = 0;
  bool leave_out = false;
  for (auto _ : state) {
    const RgbdFrame& frame = player.next();
    leave_out = no_result && !leave_out;
    const Segmentation& mended =
        compensator.compensate(frame, leave_out ? nothing : player.segmentation());
    benchmark::DoNotOptimize(mended.instances.data());
    restored += compensator.restored();
  }
  state.counters["restored"] = restored / static_cast<double>(state.iterations());
}

void BM_SegmentationCompensator(benchmark::State& state, const Settings& settings, bool no_result) {
  run(state, settings, rendered_scene(), no_result);
}
BENCHMARK_CAPTURE(BM_SegmentationCompensator, default, Settings(), false)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(BM_SegmentationCompensator, paper, Settings::paper(), false)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(BM_SegmentationCompensator, default / no_result, Settings(), true)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(BM_SegmentationCompensator, paper / no_result, Settings::paper(), true)
    ->Unit(benchmark::kMicrosecond);

void by_pixels(benchmark::State& state, const Settings& settings) {
  const cv::Size size = image_sizes()[static_cast<std::size_t>(state.range(0))];
  run(state, settings, scaled_scene(size), true);
  state.SetComplexityN(size.area());
  state.counters["pixels"] = size.area();
}

void by_people(benchmark::State& state, const Settings& settings) {
  run(state, settings, crowd_scene(static_cast<int>(state.range(0))), true);
  state.SetComplexityN(state.range(0));
}

const bool registered = [] {
  for (const bool paper : {false, true}) {
    const std::string name =
        std::string("BM_SegmentationCompensator/") + (paper ? "paper" : "default");
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
