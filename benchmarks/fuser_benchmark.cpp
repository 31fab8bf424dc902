// SPDX-License-Identifier: BSD-2-Clause
// DepthMaskFuser alone, per frame, dilation included; and the dilation alone, beside OpenCV's.
#include <benchmark/benchmark.h>

#include <opencv2/imgproc.hpp>

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
  const cv::Size size = picture_sizes()[static_cast<std::size_t>(state.range(0))];
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
    for (std::size_t i = 0; i < picture_sizes().size(); ++i)
      pixels->Arg(static_cast<std::int64_t>(i));
    auto* people = benchmark::RegisterBenchmark((name + "/by_people").c_str(), by_people, settings);
    for (const int n : people_counts()) people->Arg(n);
    for (auto* b : {pixels, people}) b->Unit(benchmark::kMicrosecond)->Complexity(benchmark::oN);
  }
  return true;
}();

// --- dilation ---------------------------------------------------------------------------------

// From bits, as the fuser keeps them, to bytes.
void BM_Dilation_stillpoint(benchmark::State& state) {
  const Scene& scene = rendered_scene();
  cv::Rect all;
  detail::BitMask mask;
  cv::Mat out = cv::Mat::zeros(scene.frames[0].color.size(), CV_8UC1);
  mask.reset(out.size());
  for (const Instance& s : scene.segmentations[0].instances) {
    all |= s.box;
    mask.add(s.mask, s.box);
  }
  detail::Dilation dilation;
  for (auto _ : state) {
    dilation.run(mask, all, static_cast<int>(state.range(0)), [&](int y, const std::uint64_t* row) {
      const std::size_t x = static_cast<std::size_t>(dilation.left());
      detail::unpack(row, 0, static_cast<std::size_t>(out.cols) - x, out.ptr<uchar>(y) + x);
    });
    benchmark::DoNotOptimize(out.data);
  }
}
BENCHMARK(BM_Dilation_stillpoint)->Arg(5)->Arg(10)->Arg(20)->Unit(benchmark::kMicrosecond);

void BM_Dilation_opencv(benchmark::State& state) {
  cv::setNumThreads(1);
  const Scene& scene = rendered_scene();
  cv::Mat mask = cv::Mat::zeros(scene.frames[0].color.size(), CV_8UC1), out;
  for (const Instance& s : scene.segmentations[0].instances) s.mask.copyTo(mask(s.box), s.mask);
  const int side = 2 * static_cast<int>(state.range(0)) + 1;
  const cv::Mat kernel = cv::getStructuringElement(cv::MORPH_RECT, {side, side});
  for (auto _ : state) {
    cv::dilate(mask, out, kernel);
    benchmark::DoNotOptimize(out.data);
  }
}
BENCHMARK(BM_Dilation_opencv)->Arg(5)->Arg(10)->Arg(20)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace bench
}  // namespace stillpoint
