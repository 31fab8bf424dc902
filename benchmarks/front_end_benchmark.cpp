// SPDX-License-Identifier: BSD-2-Clause
// All stages together, per frame: compute_mask() with a segmentation that is there, and select().
// Counter `of_orb`: CPU time as a share of the extraction of 3000 ORB keypoints, measured in
// between.
#include <benchmark/benchmark.h>

#include <ctime>

#include "scene.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/objects/object_tracker.hpp"

namespace stillpoint {
namespace bench {
namespace {

constexpr int kWarmUp = 16;  // the first frames allocate

constexpr int kFramesPerOrb = 16;

// Returns the CPU seconds of a frame. The yardstick, if there is one, is laid on in between.
double run(benchmark::State& state, const FrontEndSettings& settings, const Scene& scene,
           OrbYardstick* orb = nullptr) {
  cv::setNumThreads(1);
  FrontEnd front_end(settings, scene.camera);
  Player player(scene);
  double keypoints = 0, kept = 0, share = 0;
  int frames = 0;
  for (int i = 0; i < kWarmUp; ++i) {
    front_end.compute_mask(player.next(), player.segmentation());
    front_end.select(player.keypoints());
  }
  std::clock_t taken = 0;
  for (auto _ : state) {
    const std::clock_t start = std::clock();
    front_end.compute_mask(player.next(), player.segmentation());
    benchmark::DoNotOptimize(front_end.select(player.keypoints()).kept.data());
    taken += std::clock() - start;
    keypoints += front_end.stats().keypoints;
    kept += front_end.stats().kept;
    share += front_end.stats().mask_share;
    if (!orb || ++frames % kFramesPerOrb != 1) continue;
    state.PauseTiming();
    orb->extract();
    state.ResumeTiming();
  }
  const double iterations = static_cast<double>(state.iterations());
  state.counters["keypoints"] = keypoints / iterations;
  state.counters["kept"] = kept / iterations;
  state.counters["mask_share"] = share / iterations;
  return static_cast<double>(taken) / CLOCKS_PER_SEC / iterations;
}

void BM_FrontEnd(benchmark::State& state, const FrontEndSettings& settings,
                 const Scene& scene = rendered_scene()) {
  OrbYardstick orb;
  const double seconds = run(state, settings, scene, &orb);
  state.counters["of_orb"] = seconds / orb.seconds();
}
BENCHMARK_CAPTURE(BM_FrontEnd, default, FrontEndSettings())->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(BM_FrontEnd, paper, FrontEndSettings::paper())->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(BM_FrontEnd, network_only, FrontEndSettings::network_only())
    ->Unit(benchmark::kMicrosecond);

// The default without the host's grey image.
void BM_FrontEndColorOnly(benchmark::State& state) {
  Scene scene = rendered_scene();
  for (RgbdFrame& frame : scene.frames) frame.gray = cv::Mat();
  BM_FrontEnd(state, {}, scene);
}
BENCHMARK(BM_FrontEndColorOnly)->Name("BM_FrontEnd/color_only")->Unit(benchmark::kMicrosecond);

// What objects() takes of a frame beyond compute_mask(): following them in compute_mask(), and the
// call itself, together against the extraction of ORB keypoints.
void BM_Objects(benchmark::State& state) {
  cv::setNumThreads(1);
  const Scene& scene = rendered_scene();
  FrontEnd front_end({}, scene.camera);
  ObjectTracker tracker;
  Player player(scene);
  const CameraPlace place;
  const std::vector<int> nobody;
  OrbYardstick orb;
  double seconds = 0, objects = 0;
  int frames = 0;
  for (auto _ : state) {
    if (frames++ % kFramesPerOrb == 0) orb.extract();
    const RgbdFrame& frame = player.next();
    front_end.compute_mask(frame, player.segmentation());
    FrameContext context;
    context.begin(frame, scene.camera);
    const std::clock_t start = std::clock();
    tracker.finish(place);
    tracker.observe(context, front_end.instances(), nobody);
    objects += static_cast<double>(tracker.objects(front_end.instances(), place).size());
    const double took = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    seconds += took;
    state.SetIterationTime(took);
  }
  const double n = static_cast<double>(state.iterations());
  state.counters["objects"] = objects / n;
  state.counters["of_orb"] = seconds / n / orb.seconds();
}
BENCHMARK(BM_Objects)->UseManualTime()->Iterations(300)->Unit(benchmark::kMicrosecond);

// --- how cost grows ---------------------------------------------------------------------------

void by_pixels(benchmark::State& state, const FrontEndSettings& settings) {
  const Scene scene = scaled_scene(image_sizes()[static_cast<std::size_t>(state.range(0))]);
  run(state, settings, scene);
  state.SetComplexityN(scene.frames[0].color.size().area());
  state.counters["pixels"] = scene.frames[0].color.size().area();
}

void by_keypoints(benchmark::State& state, const FrontEndSettings& settings) {
  Scene scene = rendered_scene();
  for (std::size_t i = 0; i < scene.keypoints.size(); ++i)
    scene.keypoints[i] =
        even_keypoints(static_cast<std::size_t>(state.range(0)), scene.frames[0].color.size(), i);
  run(state, settings, scene);
  state.SetComplexityN(state.range(0));
}

void by_people(benchmark::State& state, const FrontEndSettings& settings) {
  run(state, settings, crowd_scene(static_cast<int>(state.range(0))));
  state.SetComplexityN(state.range(0));
}

const bool registered = [] {
  for (const bool paper : {false, true}) {
    const std::string name = std::string("BM_FrontEnd/") + (paper ? "paper" : "default");
    const FrontEndSettings settings = paper ? FrontEndSettings::paper() : FrontEndSettings();
    auto* pixels = benchmark::RegisterBenchmark((name + "/by_pixels").c_str(), by_pixels, settings);
    for (std::size_t i = 0; i < image_sizes().size(); ++i)
      pixels->Arg(static_cast<std::int64_t>(i));
    auto* keypoints =
        benchmark::RegisterBenchmark((name + "/by_keypoints").c_str(), by_keypoints, settings);
    for (const int n : keypoint_counts()) keypoints->Arg(n);
    auto* people = benchmark::RegisterBenchmark((name + "/by_people").c_str(), by_people, settings);
    for (const int n : people_counts()) people->Arg(n);
    for (auto* b : {pixels, keypoints, people})
      b->Unit(benchmark::kMicrosecond)->Complexity(benchmark::oN);
  }
  return true;
}();

}  // namespace
}  // namespace bench
}  // namespace stillpoint
