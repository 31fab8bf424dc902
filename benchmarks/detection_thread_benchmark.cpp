// SPDX-License-Identifier: BSD-2-Clause
// What the camera's thread spends on a frame (compute_mask() and select(), 640 x 480) while a
// segmenter runs beside it, the frames at 30 Hz. Counters: median and 99th percentile, the latter
// also of the thread's own CPU time, which other programs do not lengthen; and how many
// segmentations came per second.
#include <benchmark/benchmark.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <thread>
#include <vector>

#include "scene.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/segmentation/detection_thread.hpp"

namespace stillpoint {
namespace bench {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

/// Gives a frame the masks of the scene after so long: waits, as for a GPU, or keeps a core busy.
class SlowSegmenter : public Segmenter {
 public:
  SlowSegmenter(const Scene& scene, double seconds, bool busy)
      : scene_(scene), seconds_(seconds), busy_(busy) {}

  Segmentation segment(const RgbdFrame& frame) override {
    const auto start = Clock::now();
    const auto took = [&] { return Seconds(Clock::now() - start).count(); };
    if (busy_) {
      while (took() < seconds_ && !ended()) cv::blur(frame.color, blurred_, {9, 9});
    } else {
      std::unique_lock<std::mutex> guard(mutex_);
      changed_.wait_for(guard, Seconds(seconds_), [this] { return ended_; });
    }
    const std::size_t step = static_cast<std::size_t>(std::lround((frame.timestamp - 1.3e9) * 30));
    return scene_.segmentations[Player::index_at(scene_, step - 1)];
  }
  void end() {
    const std::lock_guard<std::mutex> guard(mutex_);
    ended_ = true;
    changed_.notify_all();
  }

 private:
  bool ended() {
    const std::lock_guard<std::mutex> guard(mutex_);
    return ended_;
  }

  const Scene& scene_;
  double seconds_;
  bool busy_;
  cv::Mat blurred_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool ended_ = false;
};

double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double percentile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size()))) -
                1];
}

void BM_DetectionThread(benchmark::State& state, const FrontEndSettings& settings, double seconds,
                        bool busy) {
  cv::setNumThreads(1);
  const Scene& scene = rendered_scene();
  SlowSegmenter segmenter(scene, seconds, busy);
  DetectionThread thread(segmenter);
  FrontEnd front_end(settings, scene.camera, &thread);
  Player player(scene);
  std::vector<double> ms, cpu_ms;
  int results = 0;
  const auto camera_starts = Clock::now();
  const auto one_frame = [&] {
    const RgbdFrame& frame = player.next();
    const auto start = Clock::now();
    front_end.compute_mask(frame);
    benchmark::DoNotOptimize(front_end.select(player.keypoints()).kept.data());
    const Seconds took = Clock::now() - start;
    std::this_thread::sleep_until(camera_starts + Seconds(frame.timestamp - 1.3e9));
    return took.count();
  };
  for (int i = 0; i < 16; ++i) one_frame();  // the first frames allocate
  for (auto _ : state) {
    const double cpu = thread_seconds();
    const double took = one_frame();
    cpu_ms.push_back(1e3 * (thread_seconds() - cpu));
    state.SetIterationTime(took);
    ms.push_back(1e3 * took);
    results += !(front_end.stats().status & kNoSegmentation);
  }
  segmenter.end();
  state.counters["p50_ms"] = percentile(ms, 0.5);
  state.counters["p99_ms"] = percentile(ms, 0.99);
  state.counters["p99_cpu_ms"] = percentile(cpu_ms, 0.99);
  state.counters["results_hz"] = 30.0 * results / static_cast<double>(ms.size());
}

#define STILLPOINT_CASE(name, ...)                         \
  BENCHMARK_CAPTURE(BM_DetectionThread, name, __VA_ARGS__) \
      ->UseManualTime()                                    \
      ->Iterations(240)                                    \
      ->Unit(benchmark::kMillisecond)
STILLPOINT_CASE(4_hz, FrontEndSettings(), 0.25, false);
STILLPOINT_CASE(4_hz_busy, FrontEndSettings(), 0.25, true);
STILLPOINT_CASE(30_hz, FrontEndSettings(), 0.033, false);
STILLPOINT_CASE(hangs_10_s, FrontEndSettings(), 10, false);
STILLPOINT_CASE(4_hz_network_only, FrontEndSettings::network_only(), 0.25, false);

}  // namespace
}  // namespace bench
}  // namespace stillpoint
