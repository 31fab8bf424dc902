// SPDX-License-Identifier: BSD-2-Clause
// ProbabilisticKeypointFilter alone, per frame, with each neighbor search.
#include <benchmark/benchmark.h>

#include "scene.hpp"
#include "stillpoint/keypoints/probabilistic_keypoint_filter.hpp"
#ifdef STILLPOINT_HAS_FLANN
#include "stillpoint/backends/flann_neighbor_search.hpp"
#endif
#ifdef STILLPOINT_HAS_NANOFLANN
#include "stillpoint/backends/nanoflann_neighbor_search.hpp"
#endif

namespace stillpoint {
namespace bench {
namespace {

using Settings = KeypointFilterSettings;

// The mask of each frame of the rendered scene.
const std::vector<DynamicMask>& masks() {
  static const std::vector<DynamicMask> all = [] {
    std::vector<DynamicMask> masks;
    for (const Segmentation& segmentation : rendered_scene().segmentations) {
      DynamicMask mask;
      mask.image = cv::Mat::zeros(rendered_scene().frames[0].color.size(), CV_8UC1);
      for (const Instance& s : segmentation.instances) mask.image(s.box).setTo(255, s.mask);
      masks.push_back(mask);
    }
    return masks;
  }();
  return all;
}

template <class Search>
void run(benchmark::State& state, const Settings& settings,
         const std::vector<std::vector<cv::KeyPoint>>& keypoints) {
  ProbabilisticKeypointFilter<Search> filter(settings);
  const std::vector<DynamicMask>& mask = masks();
  std::size_t i = 0;
  for (auto _ : state) {
    const std::size_t k = i++ % mask.size();
    benchmark::DoNotOptimize(filter.filter(keypoints[k], mask[k]).kept.data());
  }
}

// ORB's own keypoints, crowded as they are.
template <class Search>
void of_orb(benchmark::State& state, const Settings& settings) {
  run<Search>(state, settings, rendered_scene().keypoints);
}

// Evenly spread over one image: with the keypoints the neighbors of each grow, too.
template <class Search>
void by_keypoints(benchmark::State& state, const Settings& settings) {
  std::vector<std::vector<cv::KeyPoint>> keypoints;
  for (std::size_t i = 0; i < masks().size(); ++i)
    keypoints.push_back(even_keypoints(static_cast<std::size_t>(state.range(0)), {640, 480}, i));
  run<Search>(state, settings, keypoints);
  state.SetComplexityN(state.range(0));
}

template <class Search>
void register_all(const std::string& search) {
  for (const bool paper : {false, true}) {
    const Settings settings = paper ? Settings::paper() : Settings();
    const std::string name =
        "BM_ProbabilisticKeypointFilter/" + search + (paper ? "/paper" : "/default");
    benchmark::RegisterBenchmark(name.c_str(), of_orb<Search>, settings)
        ->Unit(benchmark::kMicrosecond);
    auto* b = benchmark::RegisterBenchmark((name + "/by_keypoints").c_str(), by_keypoints<Search>,
                                           settings);
    for (const int n : keypoint_counts()) b->Arg(n);
    b->Unit(benchmark::kMicrosecond)->Complexity(benchmark::oN);
  }
}

const bool registered = [] {
  register_all<GridNeighborSearch>("grid");
#ifdef STILLPOINT_HAS_FLANN
  register_all<FlannNeighborSearch>("flann");
#endif
#ifdef STILLPOINT_HAS_NANOFLANN
  register_all<NanoflannNeighborSearch>("nanoflann");
#endif
  return true;
}();

}  // namespace
}  // namespace bench
}  // namespace stillpoint
