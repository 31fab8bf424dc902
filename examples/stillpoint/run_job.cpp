// SPDX-License-Identifier: BSD-2-Clause
//
// What stats.json holds:
//   sequence          path, frames in it, first and last timestamp
//   frames, tracked   frames that ran through, and those that got a pose
//   coverage          0 to 1: of the frames with ground truth those with a pose; without ground
//                     truth tracked / frames ("coverage_of" says which)
//   evaluation        the keys of `evaluate --json`, of the final trajectory; only with
//                     groundtruth.txt; evaluation_online: of the poses that track() returned
//   groundtruth_of    what the ground truth's poses are of: camera, or body
//   lost              stretches of frames without a pose: from_s, to_s (after the first frame),
//                     frames, found_again (a pose in the same frame of reference came after it)
//   tracker           loops_closed, keyframes, map_points (of the tracker slam)
//   map               voxels; with ground truth and masks_gt ghosts: those where people were and
//                     nothing static is, and ghost_share
//   real_time         only with --real-time-rate: dropped_frames (not in frames), their share
//   blur              means over the frames: sharpness (of the edges, about 1: perfect steps),
//                     motion_px (of the picture, predicted, during the exposure)
//   masks             against masks_gt, undilated; before = the segmenter's own, after = final;
//                     means over the frames; _blurred: over the least sharp third
//   keypoints         extracted, kept: per frame; with masks_gt kept_on_people (share of the kept),
//                     precision, recall, f1, static_kept
//                     (the latter on keypoints of the whole picture)
//   times_ms          per stage: median, p95, max
//   status            how many frames had which status bit
//   settings          what was asked for; all: each setting of the front end by its path
//   camera, versions, machine, peak_memory_mb
//   notes             what the user should know (wrong depth factor, frames left out)
#include "run_job.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <opencv2/core/version.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <thread>

#include "accuracy.hpp"
#include "bench_results.hpp"
#include "front_end_options.hpp"
#include "map_view.hpp"
#include "run_recorder.hpp"
#include "statistics.hpp"
#include "stillpoint/evaluation/ghost_metrics.hpp"
#include "stillpoint/io/depth_check.hpp"
#include "stillpoint/io/mask_folder.hpp"
#include "stillpoint/io/ply_file.hpp"
#include "stillpoint/mapping/dense_map.hpp"
#include "stillpoint/version.hpp"
#include "systems.hpp"
#include "terminal.hpp"
#include "thinned_tracker.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Peak memory since reset_peak_memory(), MB; NaN where the system does not say.
double peak_memory_mb() {
  std::ifstream in("/proc/self/status");
  for (std::string line; std::getline(in, line);)
    if (line.compare(0, 6, "VmHWM:") == 0) return std::stod(line.substr(6)) / 1024;
  return std::numeric_limits<double>::quiet_NaN();
}

void reset_peak_memory() { std::ofstream("/proc/self/clear_refs") << "5"; }

Json settings_json(const RunSettings& s, const FrontEndSettings& f) {
  Json classes;
  for (const DynamicClass& c : f.dynamic_classes) classes[c.name] = c.prior;
  return {{"front_end", s.front_end ? "on" : "off"},
          {"preset", s.preset},
          {"without", s.without},
          {"segmenter", s.segmenter},
          {"masks", s.masks.string()},
          {"model", s.model.string()},
          {"async", s.async},
          {"real_time_rate", s.real_time_rate},
          {"latency_ms", s.latency_ms < 0 ? Json() : Json(s.latency_ms)},
          {"tracker", s.tracker},
          {"features", s.features},
          {"seed", s.seed},
          {"dynamic_classes", classes},
          {"sensor", s.sensor.empty() ? "preset" : s.sensor},
          {"changed", s.changed},
          {"all", all_settings(f)}};
}

Json camera_json(const Camera& c) {
  return {{"fx", c.fx},
          {"fy", c.fy},
          {"cx", c.cx},
          {"cy", c.cy},
          {"k1", c.k1},
          {"k2", c.k2},
          {"p1", c.p1},
          {"p2", c.p2},
          {"k3", c.k3},
          {"depth_units_per_m", c.depth_units_per_m},
          {"exposure_s", c.exposure_s}};
}

/// How far the room and the people move during a frame's exposure, from a synthetic sequence's
/// blur.csv (lines TIMESTAMP,LABEL,PIXELS,BLUR_PX; label 0: the room, 1 to 100: people).
void add_true_blur(Json& series, const fs::path& file, const std::vector<double>& frames) {
  std::ifstream in(file);
  if (!in) return;
  struct Blur {
    double room = std::numeric_limits<double>::quiet_NaN(), way = 0, pixels = 0;
  };
  std::map<std::int64_t, Blur> blur;
  const auto key = [](double timestamp) { return std::llround(timestamp * 1e6); };
  for (std::string line; std::getline(in, line);) {
    double timestamp = 0, pixels = 0, px = 0;
    int label = 0;
    if (std::sscanf(line.c_str(), "%lf,%d,%lf,%lf", &timestamp, &label, &pixels, &px) != 4)
      continue;
    Blur& frame = blur[key(timestamp)];
    if (label == 0) frame.room = px;
    if (label >= 1 && label <= 100) frame.way += px * pixels, frame.pixels += pixels;
  }
  for (double timestamp : frames) {
    const auto found = blur.find(key(timestamp));
    const Blur b = found == blur.end() ? Blur() : found->second;
    series["room_motion_px"].push_back(b.room);
    series["people_motion_px"].push_back(b.pixels > 0 ? Json(b.way / b.pixels) : Json());
  }
}

/// Makes the dense map when all poses are final: a SLAM system corrects old ones at the end.
class MapMaker {
 public:
  /// Keeps the mask of about every fifth frame, packed: whole frames are read again.
  void remember(std::size_t index, const Pipeline& pipeline) {
    end_ = index + 1;
    if (index < next_ || !pipeline.pose()) return;
    next_ = index + kEvery;
    Kept kept;
    kept.index = index;
    if (!pipeline.mask().image.empty()) cv::imencode(".png", pipeline.mask().image, kept.mask);
    kept_.push_back(std::move(kept));
  }

  struct Result {
    std::vector<ColoredPoint> points;
    /// Ghosts among them; nothing where there is no truth to judge them by.
    std::optional<GhostCounts> ghosts;
  };

  /// `truth_dir`: masks_gt of a sequence with ground truth, to count ghosts by; empty: not at all.
  Result make(const TumSequence& sequence, const Trajectory& trajectory, const Trajectory& truth,
              const fs::path& truth_dir) const {
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

 private:
  static constexpr std::size_t kEvery = 5;
  struct Kept {
    std::size_t index = 0;
    std::vector<uchar> mask;
  };

  static const StampedPose* near(const Trajectory& poses, const std::vector<double>& times,
                                 double timestamp) {
    const std::size_t n = detail::nearest(times, timestamp);
    return std::abs(times[n] - timestamp) > 0.02 ? nullptr : &poses[n];
  }

  std::vector<Kept> kept_;
  std::size_t next_ = 0, end_ = 0;
};

/// The recording's time since its first frame, for runs that keep its pace. It may be stopped while
/// files are read and results judged, which a robot does not do.
class RecordingClock {
 public:
  void start() { start_ = Clock::now(); }
  void stop() { stopped_ = Clock::now(), running_ = false; }
  void go_on() {
    if (!running_) start_ += Clock::now() - stopped_;
    running_ = true;
  }
  bool is_past(double time_s) const { return (running_ ? Clock::now() : stopped_) >= at(time_s); }
  void wait_for(double time_s) const { std::this_thread::sleep_until(at(time_s)); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point at(double time_s) const {
    return start_ +
           std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(time_s));
  }
  Clock::time_point start_, stopped_;
  bool running_ = true;
};

/// The lists rgb.txt and depth.txt go before associations.txt; one that could not be read anyway is
/// worth a word.
std::optional<std::string> unread_associations(const TumSequence& sequence) {
  const fs::path file = sequence.folder() / "associations.txt";
  if (!fs::exists(file)) return std::nullopt;
  try {
    read_associations(file, sequence.folder());
    return std::nullopt;
  } catch (const Error& e) {
    return file.string() + " is broken, and was not read: rgb.txt and depth.txt are there (" +
           e.what() + ")";
  }
}

/// After a failure: writes the poses there are. That this fails too is not worth another message.
void keep_tracked(Tracker& tracker, const fs::path& file) {
  try {
    tracker.finish();
    if (const Trajectory poses = tracker.trajectory(); !poses.empty())
      write_trajectory(file, poses);
  } catch (const std::exception&) {
  }
}

}  // namespace

Json run_job(const RunSettings& wanted, const RunOutputs& outputs,
             const std::function<void(std::size_t, std::size_t)>& progress,
             const std::function<void(const std::string&)>& note) {
  RunSettings settings = wanted;
  const TumSequence sequence = open_sequence(settings.sequence, settings.camera);
  // Read before the run: a broken file must not be found after hours.
  const Trajectory groundtruth =
      sequence.has_groundtruth()
          ? camera_groundtruth(sequence.groundtruth(), settings.groundtruth_of)
          : Trajectory();
  choose_segmenter(settings);
  const std::unique_ptr<Segmenter> segmenter =
      make_late(settings, make_segmenter(settings, sequence));
  const std::unique_ptr<Tracker> tracker = make_tracker(settings, *sequence.camera());
  std::optional<ThinnedTracker> thinned;
  if (settings.seed != 0) thinned.emplace(*tracker, settings.seed);
  Tracker& fed = thinned ? *thinned : *tracker;
  const FrontEndSettings front_end = front_end_settings(settings);
  const std::size_t count =
      settings.frames > 0 ? std::min(settings.frames, sequence.size()) : sequence.size();
  Json notes = Json::array();
  const auto say = [&](const std::string& text) {
    notes.push_back(text);
    note(text);
  };
  if (sequence.missing_pictures() > 0)
    say(std::to_string(sequence.missing_pictures()) +
        " listed pictures are not on the disk; their frames are left out");

  if (const auto problem = unread_associations(sequence)) say(*problem);

  reset_peak_memory();
  Pipeline pipeline(front_end, settings.front_end, *sequence.camera(), segmenter.get(), fed);
  const fs::path truth_dir = settings.sequence / "masks_gt";
  RunRecorder recorder(fs::is_directory(truth_dir) ? truth_dir : fs::path());
  WholePictureJudge judge(front_end, settings.features);
  MapMaker map;
  const bool judge_map = fs::is_directory(truth_dir) && sequence.has_groundtruth();
  const bool with_map = judge_map || !outputs.map_ply.empty() || !outputs.map_views_dir.empty();
  FrameWriter writer(outputs);
  WorstFrames worst(outputs);
  bool depth_checked = false;
  const auto time_of = [&](std::size_t i) {
    return sequence.entry(i).timestamp - sequence.entry(0).timestamp;
  };
  RecordingClock clock;
  std::size_t dropped = 0;
  Trajectory online;
  const auto run_frame = [&](std::size_t& i) {
    if (settings.real_time_rate && i > 0)
      for (; i + 1 < count && clock.is_past(time_of(i + 1)); ++i)
        ++dropped;  // a newer one is there
    const RgbdFrame frame = sequence.load(i);
    if (!depth_checked && median_depth_m(frame)) {
      depth_checked = true;
      if (const auto problem = check_depth_scale(frame)) say(*problem);
    }
    const std::string& stem = sequence.entry(i).stem;
    clock.go_on();
    if (i > 0 && (settings.async || settings.real_time_rate)) clock.wait_for(time_of(i));
    pipeline.process(frame);
    if (i == 0) clock.start();
    // A segmenter beside the camera works all the time, so the camera must not stop.
    if (!settings.async) clock.stop();
    if (pipeline.pose()) online.push_back({frame.timestamp, *pipeline.pose()});
    recorder.add(pipeline, frame, stem, judge);
    writer.write(pipeline, frame, stem, i, judge);
    worst.add(pipeline, frame, stem, recorder.truth(), recorder.mask_counts());
    if (with_map) map.remember(i, pipeline);
    progress(i + 1, count);
  };
  try {
    for (std::size_t i = 0; i < count; ++i) run_frame(i);
    writer.finish();
    worst.finish();
    if (recorder.frames() > 0 && recorder.segmenter_errors() == recorder.frames())
      throw Error("the segmenter failed in all " + std::to_string(recorder.frames()) +
                  " frames: " + recorder.segmenter_error());
  } catch (const std::exception&) {
    if (outputs.keep_unfinished) keep_tracked(*tracker, outputs.trajectory);
    throw;
  }
  tracker->finish();
  const Trajectory trajectory = tracker->trajectory();
  if (!outputs.trajectory.empty()) write_trajectory(outputs.trajectory, trajectory);
  if (!outputs.trajectory_online.empty()) write_trajectory(outputs.trajectory_online, online);
  if (!outputs.groundtruth.empty() && settings.groundtruth_of != "camera")
    write_trajectory(outputs.groundtruth, groundtruth);
  Json map_stats;
  if (with_map) {
    const auto [points, ghosts] =
        map.make(sequence, trajectory, groundtruth, judge_map ? truth_dir : fs::path());
    map_stats["voxels"] = points.size();
    if (ghosts) {
      map_stats["ghosts"] = ghosts->ghosts;
      map_stats["ghost_share"] = ghosts->share();
    }
    if (!outputs.map_ply.empty()) write_ply(outputs.map_ply, points);
    if (!outputs.map_views_dir.empty()) {
      make_folder(outputs.map_views_dir);
      write_picture(outputs.map_views_dir / "behind.jpg",
                    draw_map(points, MapViewpoint::kBehind, {640, 480}));
      write_picture(outputs.map_views_dir / "above.jpg",
                    draw_map(points, MapViewpoint::kAbove, {640, 480}));
    }
  }
  if (recorder.segmenter_errors() > 0)
    say("the segmenter failed in " + std::to_string(recorder.segmenter_errors()) +
        " frames (masks were predicted there): " + recorder.segmenter_error());

  Json stats;
  stats["sequence"] = {{"path", settings.sequence.string()},
                       {"frames", sequence.size()},
                       {"first_timestamp", sequence.entry(0).timestamp},
                       {"last_timestamp", sequence.entry(count - 1).timestamp}};
  stats["frames"] = recorder.frames();
  stats["tracked"] = recorder.tracked();
  stats["coverage"] = static_cast<double>(recorder.tracked()) /
                      static_cast<double>(std::max<std::size_t>(1, recorder.frames()));
  stats["coverage_of"] = "frames";
  Json series = outputs.series ? recorder.series(settings.front_end) : Json();
  if (outputs.series) add_true_blur(series, settings.sequence / "blur.csv", recorder.timestamps());
  if (sequence.has_groundtruth()) {
    stats["groundtruth_of"] = settings.groundtruth_of;
    add_accuracy(stats, outputs.series ? &series : nullptr, groundtruth, trajectory,
                 recorder.timestamps(), say);
    if (coverage(groundtruth, online, recorder.timestamps()).covered >= 3)
      stats["evaluation_online"] =
          to_json(measure_accuracy(groundtruth, online, recorder.timestamps(), RpeSettings()));
  }
  recorder.summarize(stats, settings.front_end);
  if (const Json of_tracker = tracker_json(*tracker); !of_tracker.is_null())
    stats["tracker"] = of_tracker;
  if (with_map) stats["map"] = map_stats;
  if (settings.real_time_rate)
    stats["real_time"] = {
        {"dropped_frames", dropped},
        {"dropped_share", static_cast<double>(dropped) / static_cast<double>(count)}};
  stats["settings"] = settings_json(settings, front_end);
  stats["camera"] = camera_json(*sequence.camera());
  stats["versions"] = versions_json();
  stats["machine"] = machine_json();
  stats["peak_memory_mb"] = peak_memory_mb();
  stats["notes"] = notes;
  if (outputs.series) stats["series"] = series;
  return stats;
}

Json judge_estimate(const RunSettings& settings, const fs::path& file) {
  const TumSequence sequence(settings.sequence);
  const Trajectory estimate = read_trajectory(file);
  std::vector<double> times = sequence.timestamps();
  if (settings.frames > 0 && settings.frames < times.size()) times.resize(settings.frames);
  if (!sequence.has_groundtruth())
    throw Error("sequence " + settings.sequence.string() +
                ": has no groundtruth.txt to judge an estimate by");
  Json notes = Json::array(), series, stats;
  stats["frames"] = times.size();
  stats["tracked"] = associate(times, detail::timestamps_of(estimate)).size();
  stats["coverage"] = 0.0;
  for (double t : times) series["t_s"].push_back(std::round((t - times.front()) * 1e6) / 1e6);
  stats["groundtruth_of"] = settings.groundtruth_of;
  add_accuracy(stats, &series, camera_groundtruth(sequence.groundtruth(), settings.groundtruth_of),
               estimate, times, [&](const std::string& text) { notes.push_back(text); });
  stats["estimate"] = file.string();
  stats["versions"] = versions_json();
  stats["machine"] = machine_json();
  stats["notes"] = notes;
  stats["series"] = series;
  return stats;
}

Json versions_json() {
  const std::string eigen = std::to_string(EIGEN_WORLD_VERSION) + "." +
                            std::to_string(EIGEN_MAJOR_VERSION) + "." +
                            std::to_string(EIGEN_MINOR_VERSION);
#if defined(__clang__)
  const std::string compiler = "clang " __clang_version__;
#elif defined(__GNUC__)
  const std::string compiler = "gcc " __VERSION__;
#else
  const std::string compiler = "unknown";
#endif
#ifdef NDEBUG
  const char* build = "release";
#else
  const char* build = "debug (times mean nothing)";
#endif
  return {{"stillpoint", STILLPOINT_VERSION},
          {"opencv", CV_VERSION},
          {"eigen", eigen},
          {"compiler", compiler},
          {"build", build}};
}

Json machine_json() {
  std::string cpu = "unknown";
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);)
    if (line.compare(0, 10, "model name") == 0) {
      cpu = line.substr(std::min(line.size(), line.find(':') + 2));
      break;
    }
  return {{"cpu", cpu}, {"threads", std::thread::hardware_concurrency()}};
}

void write_json(const fs::path& path, const Json& json) {
  const fs::path part = path.string() + ".part";
  write_file(part, json.dump(1) + "\n", "result");
  std::error_code error;
  fs::rename(part, path, error);
  if (error) throw Error(path.string() + ": cannot be written: " + error.message());
}

void make_folder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error || !fs::is_directory(path))
    throw Error(path.string() + ": cannot be made a folder: " +
                (error ? error.message() : std::string("there is a file of this name")));
}

std::string summary_text(const Json& stats) {
  std::string out;
  const auto add = [&](const std::string& name, const std::string& text) {
    out += name + std::string(name.size() < 12 ? 12 - name.size() : 1, ' ') + text + "\n";
  };
  const double covered = number_at(stats, "coverage");
  add("frames", std::to_string(stats["frames"].get<std::size_t>()) + ", tracked " +
                    std::to_string(stats["tracked"].get<std::size_t>()) + ", coverage " +
                    fixed(100 * covered, 1) + " % of the " +
                    stats["coverage_of"].get<std::string>());
  if (stats.contains("evaluation")) {
    const Json& e = stats["evaluation"];
    add("ATE [m]",
        "RMSE " + fixed(number_at(e, "ate_rmse_m"), 4) + "  S.D. " +
            fixed(number_at(e, "ate_sd_m"), 4) + "  max " + fixed(number_at(e, "ate_max_m"), 4) +
            "  aligned in SE(3), ground truth of the " + stats.value("groundtruth_of", "camera"));
    if (stats.contains("evaluation_online"))
      add("  online", "RMSE " + fixed(number_at(stats["evaluation_online"], "ate_rmse_m"), 4) +
                          " of the poses as each frame had them at its time");
    add("  Sim(3)", "RMSE " + fixed(number_at(e, "ate_sim3_rmse_m"), 4) +
                        " with the scale aligned, too (by " + fixed(number_at(e, "scale"), 4) +
                        ")");
    add("RPE", fixed(number_at(e, "rpe_trans_m"), 4) + " m, " +
                   fixed(number_at(e, "rpe_rot_deg"), 3) + " deg from frame to frame; " +
                   fixed(number_at(e, "rpe_1s_trans_m"), 4) + " m, " +
                   fixed(number_at(e, "rpe_1s_rot_deg"), 3) + " deg over a second");
  }
  if (covered < kCoverageFloor)
    add("", "FAILED: under 95 % coverage; an error over the rest says little");
  if (stats.contains("masks")) {
    const Json& m = stats["masks"];
    add("masks", "IoU " + fixed(number_at(m, "iou_before"), 3) + " -> " +
                     fixed(number_at(m, "iou_after"), 3) + ", recall " +
                     fixed(number_at(m, "recall_before"), 3) + " -> " +
                     fixed(number_at(m, "recall_after"), 3) + ", precision " +
                     fixed(number_at(m, "precision_before"), 3) + " -> " +
                     fixed(number_at(m, "precision_after"), 3) + "  (masks_gt, before dilation)");
  }
  if (stats.contains("real_time")) {
    const Json& r = stats["real_time"];
    add("real time", std::to_string(r["dropped_frames"].get<std::size_t>()) +
                         " frames came too late and were dropped, " +
                         fixed(100 * number_at(r, "dropped_share"), 1) + " %");
  }
  std::string lost;
  for (const Json& l : stats["lost"]) {
    if (lost.size() > 200) {
      lost += ", ...";
      break;
    }
    lost += (lost.empty() ? "" : ", ") + std::to_string(l["frames"].get<std::size_t>()) +
            " frames from " + fixed(number_at(l, "from_s"), 2) + " to " +
            fixed(number_at(l, "to_s"), 2) + " s, " +
            (l["found_again"].get<bool>() ? "then found again" : "not found again");
  }
  if (!lost.empty()) add("lost", lost);
  if (stats.contains("tracker")) {
    const Json& t = stats["tracker"];
    add("tracker", fixed(number_at(t, "loops_closed"), 0) + " loops closed, " +
                       fixed(number_at(t, "keyframes"), 0) + " keyframes, " +
                       fixed(number_at(t, "map_points"), 0) + " points");
  }
  if (stats.contains("map") && stats["map"].contains("ghosts"))
    add("map", fixed(number_at(stats["map"], "voxels"), 0) + " voxels, " +
                   fixed(100 * number_at(stats["map"], "ghost_share"), 2) + " % ghosts of people");
  const Json& k = stats["keypoints"];
  std::string keypoints = fixed(number_at(k, "extracted"), 0) + " extracted, " +
                          fixed(number_at(k, "kept"), 0) + " kept per frame";
  if (std::isfinite(number_at(k, "kept_on_people")))
    keypoints += "; " + fixed(100 * number_at(k, "kept_on_people"), 2) + " % of the kept on people";
  add("keypoints", keypoints);
  std::string times;
  for (const auto& [stage, t] : stats["times_ms"].items())
    times += (times.empty() ? "" : ", ") + stage + " " + fixed(number_at(t, "median"), 2);
  const Json& total = stats["times_ms"]["total"];
  add("ms/frame", times + " (medians); total p95 " + fixed(number_at(total, "p95"), 1) +
                      ", longest " + fixed(number_at(total, "max"), 1));
  std::string status;
  for (const auto& [name, n] : stats["status"].items())
    status += (status.empty() ? "" : ", ") + name + " " + n.dump();
  if (!status.empty()) add("status", status + "  (frames)");
  return out;
}

}  // namespace stillpoint::cli
