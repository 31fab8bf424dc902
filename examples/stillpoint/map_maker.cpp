// SPDX-License-Identifier: BSD-2-Clause
#include "map_maker.hpp"

#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "files.hpp"
#include "map_view.hpp"
#include "stillpoint/evaluation/trajectory_error.hpp"
#include "stillpoint/io/mask_folder.hpp"
#include "stillpoint/io/ply_file.hpp"
#include "stillpoint/mapping/dense_map.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

const StampedPose* near(const Trajectory& poses, const std::vector<double>& times,
                        double timestamp) {
  const std::size_t n = detail::nearest(times, timestamp);
  return std::abs(times[n] - timestamp) > 0.02 ? nullptr : &poses[n];
}

}  // namespace

void MapMaker::remember(const FrameView& view) {
  end_ = view.index() + 1;
  if (view.index() < next_ || !view.is_tracked()) return;
  next_ = view.index() + kEvery;
  Kept kept;
  kept.index = view.index();
  if (!view.mask().image.empty()) cv::imencode(".png", view.mask().image, kept.mask);
  kept_.push_back(std::move(kept));
}

MapMaker::Result MapMaker::make(const TumSequence& sequence, const Trajectory& trajectory,
                                const Trajectory& truth, const fs::path& truth_dir) const {
  std::map<double, const StampedPose*> poses;
  for (const StampedPose& pose : trajectory) poses[pose.timestamp] = &pose;
  std::map<std::size_t, const Kept*> frames;
  for (const Kept& kept : kept_) frames[kept.index] = &kept;
  const std::vector<double> times = detail::timestamps_of(truth);
  const auto matches = associate(times, detail::timestamps_of(trajectory));
  const bool judge = !truth_dir.empty() && matches.size() >= 3;
  // Also frames that the map lacks: there were people too.
  if (judge)
    for (std::size_t i = 0; i < end_; i += kEvery) frames.emplace(i, nullptr);

  DenseMap map;
  GhostCounter counter;
  bool any = false;
  for (const auto& [index, kept] : frames) {
    const SequenceEntry& entry = sequence.entry(index);
    const auto pose = kept ? poses.find(entry.timestamp) : poses.end();
    const StampedPose* true_pose = judge ? near(truth, times, entry.timestamp) : nullptr;
    const fs::path people = mask_path(truth_dir, entry.stem);
    std::error_code ignored;
    if (true_pose && !fs::exists(people, ignored)) true_pose = nullptr;
    if (pose == poses.end() && !true_pose) continue;
    const RgbdFrame frame = sequence.load(index);
    if (pose != poses.end()) {
      DynamicMask mask;
      if (!kept->mask.empty()) mask.image = cv::imdecode(kept->mask, cv::IMREAD_GRAYSCALE);
      map.integrate(frame, *sequence.camera(), mask, pose->second->T_world_camera);
    }
    if (true_pose) {
      counter.add(frame, *sequence.camera(), read_mask(people, frame.color.size()),
                  true_pose->T_world_camera);
      any = true;
    }
  }
  Result result;
  result.points = map.points(kept_.size() > 2 ? 2 : 1);
  if (any) result.ghosts = counter.count(result.points, align_poses(truth, trajectory, matches));
  return result;
}

Json write_map(const MapMaker::Result& map, const RunOutputs& outputs) {
  if (!outputs.map_ply.empty()) write_ply(outputs.map_ply, map.points);
  if (!outputs.map_views_dir.empty()) {
    make_folder(outputs.map_views_dir);
    write_image(outputs.map_views_dir / "behind.jpg",
                draw_map(map.points, MapViewpoint::kBehind, {640, 480}));
    write_image(outputs.map_views_dir / "above.jpg",
                draw_map(map.points, MapViewpoint::kAbove, {640, 480}));
  }
  Json stats;
  stats["voxels"] = map.points.size();
  if (map.ghosts) {
    stats["ghosts"] = map.ghosts->ghosts;
    stats["ghost_share"] = map.ghosts->share();
  }
  return stats;
}

}  // namespace stillpoint::cli
