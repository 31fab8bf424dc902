// SPDX-License-Identifier: BSD-2-Clause
// The yardstick: what a SLAM system spends on its keypoints anyway.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <ctime>

#include "scene.hpp"

namespace stillpoint {
namespace bench {

#ifndef NDEBUG
const bool kSaidSo = std::fputs(
                         "***WARNING*** Built with assertions, as the tests are: slower than "
                         "a build of type Release.\n",
                         stderr) >= 0;
#endif

OrbYardstick::OrbYardstick() : orb_(cv::ORB::create(3000)) {}

void OrbYardstick::extract() {
  const std::vector<RgbdFrame>& frames = rendered_scene().frames;
  const std::clock_t start = std::clock();
  orb_->detectAndCompute(frames[times_++ % frames.size()].gray, cv::noArray(), keypoints_,
                         descriptors_);
  taken_ += std::clock() - start;
}

double OrbYardstick::seconds() const {
  return static_cast<double>(taken_) / CLOCKS_PER_SEC / static_cast<double>(times_);
}

namespace {

void BM_OrbExtraction(benchmark::State& state) {
  const Scene& scene = rendered_scene();
  cv::setNumThreads(1);
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(static_cast<int>(state.range(0)));
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  std::size_t i = 0, found = 0;
  for (auto _ : state) {
    orb->detectAndCompute(scene.frames[i++ % scene.frames.size()].gray, cv::noArray(), keypoints,
                          descriptors);
    found += keypoints.size();
  }
  state.counters["keypoints"] =
      static_cast<double>(found) / static_cast<double>(state.iterations());
}
BENCHMARK(BM_OrbExtraction)->Arg(1000)->Arg(3000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace bench
}  // namespace stillpoint
