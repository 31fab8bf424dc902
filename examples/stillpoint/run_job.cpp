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
//                     motion_px (of the image, predicted, during the exposure)
//   depth_delay_s     how long after its stamp the depth was taken at last, if frames tell it
//   depth_readout_s   how long it took to read it out, first to last row, if frames tell it
//   masks             against masks_gt, undilated; before = the segmenter's own, after = final;
//                     means over the frames; _blurred: over the least sharp third; recall_measured,
//                     precision_measured: of all pixels with depth of all frames together
//   mask_share        0 to 1: of the image in the final mask, mean over the frames
//   restored_per_frame  objects that were restored, wholly or partly
//   keypoints         extracted, kept: per frame; with masks_gt kept_on_people (share of the kept),
//                     precision, recall, f1, static_kept
//                     (the latter on keypoints of the whole image)
//   times_ms          per stage: median, p95, max
//   status            how many frames had which status bit
//   settings          what was asked for; all: each setting of the front end by its path
//   camera, versions, machine, peak_memory_mb
//   notes             what the user should know (wrong depth factor, frames left out)
#include "run_job.hpp"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "accuracy.hpp"
#include "environment.hpp"
#include "map_maker.hpp"
#include "recording_clock.hpp"
#include "run_recorder.hpp"
#include "run_stats.hpp"
#include "stillpoint/io/depth_check.hpp"
#include "stillpoint/io/run_sequence.hpp"
#include "systems.hpp"
#include "thinned_tracker.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

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

/// One run over a sequence: what it needs, and what it makes.
class Job {
 public:
  using Say = std::function<void(const std::string&)>;
  using Progress = std::function<void(std::size_t, std::size_t)>;

  Job(const RunSettings& settings, const RunOutputs& outputs, const Progress& progress,
      const Say& note)
      : settings_(settings),
        outputs_(outputs),
        progress_(progress),
        note_(note),
        sequence_(open_sequence(settings.sequence, settings.camera)),
        front_end_settings_(front_end_settings(settings_)),
        truth_dir_(fs::is_directory(settings.sequence / "masks_gt") ? settings.sequence / "masks_gt"
                                                                    : fs::path()),
        depth_check_(*sequence_.camera()),
        recorder_(truth_dir_),
        judge_(front_end_settings_, settings.features),
        writer_(outputs, *sequence_.camera()),
        worst_(outputs) {
    // Read before the run: a broken file must not be found after hours.
    if (sequence_.has_groundtruth())
      groundtruth_ = camera_groundtruth(sequence_.groundtruth(), settings.groundtruth_of);
    truth_times_ = detail::timestamps_of(groundtruth_);
    choose_segmenter(settings_);
    front_end_settings_ = front_end_settings(settings_);
    segmenter_ = make_late(settings_, make_segmenter(settings_, sequence_));
    tracker_ = make_tracker(settings_, *sequence_.camera());
    if (settings_.seed != 0) thinned_.emplace(*tracker_, settings_.seed);
    judge_map_ = !truth_dir_.empty() && sequence_.has_groundtruth();
    with_map_ = judge_map_ || !outputs.map_ply.empty() || !outputs.map_views_dir.empty();
  }

  Json run() {
    for (const std::string& note : sequence_notes(sequence_)) say(note);
    if (const auto problem = unread_associations(sequence_)) say(*problem);
    reset_peak_memory();
    try {
      track();
      tell_depth();
      writer_.finish();
      worst_.finish();
      if (recorder_.frames() > 0 && recorder_.segmenter_errors() == recorder_.frames())
        throw Error("the segmenter failed in all " + std::to_string(recorder_.frames()) +
                    " frames: " + recorder_.segmenter_error());
    } catch (const std::exception&) {
      if (outputs_.keep_unfinished) keep_tracked();
      throw;
    }
    if (!outputs_.trajectory.empty()) write_trajectory(outputs_.trajectory, trajectory_);
    if (!outputs_.trajectory_online.empty()) write_trajectory(outputs_.trajectory_online, online_);
    if (!outputs_.groundtruth.empty() && settings_.groundtruth_of != "camera")
      write_trajectory(outputs_.groundtruth, groundtruth_);
    Json map;
    if (with_map_)
      map = write_map(
          map_.make(sequence_, trajectory_, groundtruth_, judge_map_ ? truth_dir_ : fs::path()),
          outputs_);
    if (recorder_.segmenter_errors() > 0)
      say("the segmenter failed in " + std::to_string(recorder_.segmenter_errors()) +
          " frames (masks were predicted there): " + recorder_.segmenter_error());
    return stats(map);
  }

 private:
  void say(const std::string& text) {
    notes_.push_back(text);
    note_(text);
  }

  std::size_t count() const {
    return settings_.frames > 0 ? std::min(settings_.frames, sequence_.size()) : sequence_.size();
  }
  double time_of(std::size_t i) const {
    return sequence_.entry(i).timestamp - sequence_.entry(0).timestamp;
  }

  void track() {
    Tracker& tracker = thinned_ ? *thinned_ : *tracker_;
    SequenceRun run;
    run.frames = settings_.frames;
    if (settings_.real_time_rate) run.choose = [this](std::size_t i) { return newest(i); };
    run.loaded = [this](std::size_t i, const RgbdFrame&) { begin(i); };
    if (settings_.front_end) {
      FrontEnd front_end(front_end_settings_, *sequence_.camera(), segmenter_.get());
      run.tracked = [&](const TrackedFrame& t) { end(FrameView(t, &front_end)); };
      trajectory_ = run_sequence(sequence_, front_end, tracker, run);
    } else {
      NoFrontEnd front_end;
      run.tracked = [this](const TrackedFrame& t) { end(FrameView(t, nullptr)); };
      trajectory_ = run_sequence(sequence_, front_end, tracker, run);
    }
  }

  /// The newest frame that has come while the last one ran.
  std::size_t newest(std::size_t i) {
    if (i > 0)
      for (; i + 1 < count() && clock_.is_past(time_of(i + 1)); ++i) ++dropped_;
    return i;
  }

  void begin(std::size_t i) {
    clock_.go_on();
    if (i > 0 && (settings_.async || settings_.real_time_rate)) clock_.wait_for(time_of(i));
  }

  void end(const FrameView& view) {
    if (view.index() == 0) clock_.start();
    // A segmenter beside the camera works all the time, so the camera must not stop.
    if (!settings_.async) clock_.stop();
    check_depth(view);
    const std::string& stem = sequence_.entry(view.index()).stem;
    if (view.pose()) online_.push_back({view.frame().timestamp, *view.pose()});
    recorder_.add(view, stem, judge_);
    writer_.write(view, stem, judge_);
    worst_.add(view, stem, recorder_.truth(), recorder_.mask_counts());
    if (with_map_) map_.remember(view);
    progress_(view.index() + 1, count());
  }

  /// Says what the first second tells of the depth factor, as soon as it is over.
  void check_depth(const FrameView& view) {
    if (depth_told_) return;
    depth_check_.add(view.frame(), view.uses_front_end() ? view.front_end().instances()
                                                         : std::vector<Instance>());
    compare_motion(view);
    if (depth_check_.is_over(view.frame().timestamp)) tell_depth();
  }
  /// How far it is from the first tracked frame, beside the truth. Without the front end who walks
  /// by carries the tracker along: that is no error of the depth.
  void compare_motion(const FrameView& view) {
    if (!view.pose() || groundtruth_.empty() || !view.uses_front_end()) return;
    const double t = view.frame().timestamp;
    const StampedPose& truth = groundtruth_[detail::nearest(truth_times_, t)];
    if (std::abs(truth.timestamp - t) > kMaxDifferenceS) return;
    const Eigen::Vector3d tracked_m = view.pose()->translation(),
                          true_m = truth.T_world_camera.translation();
    if (!start_) start_ = {tracked_m, true_m};
    depth_check_.add_motion((tracked_m - start_->first).norm(), (true_m - start_->second).norm());
  }
  void tell_depth() {
    if (!depth_told_)
      if (const auto problem = depth_check_.problem()) say(*problem);
    depth_told_ = true;
  }

  /// After a failure: writes the poses there are. That this fails too is not worth another message.
  void keep_tracked() {
    try {
      if (trajectory_.empty()) {  // it broke off
        tracker_->finish();
        trajectory_ = tracker_->trajectory();
      }
      if (!trajectory_.empty()) write_trajectory(outputs_.trajectory, trajectory_);
    } catch (const std::exception&) {
    }
  }

  Json stats(const Json& map) {
    Json stats;
    stats["sequence"] = {{"path", settings_.sequence.string()},
                         {"frames", sequence_.size()},
                         {"first_timestamp", sequence_.entry(0).timestamp},
                         {"last_timestamp", sequence_.entry(count() - 1).timestamp}};
    stats["frames"] = recorder_.frames();
    stats["tracked"] = recorder_.tracked();
    stats["coverage"] = static_cast<double>(recorder_.tracked()) /
                        static_cast<double>(std::max<std::size_t>(1, recorder_.frames()));
    stats["coverage_of"] = "frames";
    Json series = outputs_.series ? recorder_.series(settings_.front_end) : Json();
    if (outputs_.series)
      add_true_blur(series, settings_.sequence / "blur.csv", recorder_.timestamps());
    if (sequence_.has_groundtruth()) judge_trajectory(stats, series);
    recorder_.summarize(stats, settings_.front_end);
    if (const Json of_tracker = tracker_json(*tracker_); !of_tracker.is_null())
      stats["tracker"] = of_tracker;
    if (with_map_) stats["map"] = map;
    if (settings_.real_time_rate)
      stats["real_time"] = {
          {"dropped_frames", dropped_},
          {"dropped_share", static_cast<double>(dropped_) / static_cast<double>(count())}};
    stats["settings"] = settings_json(settings_, front_end_settings_);
    stats["camera"] = camera_json(*sequence_.camera());
    stats["versions"] = versions_json();
    stats["machine"] = machine_json();
    stats["peak_memory_mb"] = peak_memory_mb();
    stats["notes"] = notes_;
    if (outputs_.series) stats["series"] = series;
    return stats;
  }

  void judge_trajectory(Json& stats, Json& series) {
    const std::vector<double> frames = recorder_.timestamps();
    stats["groundtruth_of"] = settings_.groundtruth_of;
    add_accuracy(stats, outputs_.series ? &series : nullptr, groundtruth_, trajectory_, frames,
                 sequence_.camera()->depth_units_per_m,
                 [this](const std::string& text) { say(text); });
    if (is_measurable(groundtruth_, online_))
      stats["evaluation_online"] =
          to_json(measure_accuracy(groundtruth_, online_, frames, RpeSettings()));
  }

  RunSettings settings_;
  RunOutputs outputs_;
  Progress progress_;
  Say note_;
  const TumSequence sequence_;
  FrontEndSettings front_end_settings_;
  fs::path truth_dir_;
  Trajectory groundtruth_, trajectory_, online_;
  std::unique_ptr<Segmenter> segmenter_;
  std::unique_ptr<Tracker> tracker_;
  std::optional<ThinnedTracker> thinned_;
  DepthScaleCheck depth_check_;
  std::vector<double> truth_times_;
  std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> start_;  // tracked, true
  RunRecorder recorder_;
  WholeImageJudge judge_;
  FrameWriter writer_;
  WorstFrames worst_;
  MapMaker map_;
  RecordingClock clock_;
  Json notes_ = Json::array();
  std::size_t dropped_ = 0;
  bool judge_map_ = false, with_map_ = false, depth_told_ = false;
};

}  // namespace

Json run_job(const RunSettings& settings, const RunOutputs& outputs,
             const std::function<void(std::size_t, std::size_t)>& progress,
             const std::function<void(const std::string&)>& note) {
  return Job(settings, outputs, progress, note).run();
}

}  // namespace stillpoint::cli
