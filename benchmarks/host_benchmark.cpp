// SPDX-License-Identifier: BSD-2-Clause
// What the hook costs a host per frame, masks ready: judging the keypoints and compacting them and
// their descriptors.
#ifdef STILLPOINT_HAS_HOST
#include <benchmark/benchmark.h>

#include "scene.hpp"
#include "stillpoint/backends/host.hpp"

namespace stillpoint {
namespace bench {
namespace {

void BM_HostHook(benchmark::State& state) {
  const Scene& scene = rendered_scene();
  HostFrontEnd front_end(scene.camera);
  front_end.compute_mask(scene.frames[0], scene.segmentations[0]);
  const double timestamp = scene.frames[0].timestamp;
  // ORB's own keypoints, crowded as they are, the strongest of 3000 first.
  std::vector<cv::KeyPoint> all = scene.keypoints[0];
  cv::KeyPointsFilter::retainBest(all, static_cast<int>(state.range(0)));
  all.resize(std::min(all.size(), static_cast<std::size_t>(state.range(0))));
  const cv::Mat rows(static_cast<int>(all.size()), 32, CV_8UC1, cv::Scalar(1));
  std::vector<cv::KeyPoint> keypoints;
  for (auto _ : state) {
    keypoints = all;  // a few microseconds, counted with the rest
    cv::Mat descriptors = rows;
    keep_static(timestamp, keypoints, descriptors);
    benchmark::DoNotOptimize(descriptors.data);
  }
  state.counters["keypoints"] = static_cast<double>(all.size());
  state.counters["kept"] = static_cast<double>(keypoints.size());
}
BENCHMARK(BM_HostHook)->Arg(1000)->Arg(2000)->Arg(3000)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace bench
}  // namespace stillpoint
#endif
