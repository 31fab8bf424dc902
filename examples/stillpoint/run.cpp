// SPDX-License-Identifier: BSD-2-Clause
#include <cmath>
#include <cstdio>
#include <memory>

#include "accuracy.hpp"
#include "commands.hpp"
#include "files.hpp"
#include "options.hpp"
#include "run_job.hpp"
#include "systems.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;

struct RunCommand {
  RunSettings settings;
  fs::path out, objects;
  bool save_masks = false, save_keypoints = false;
  std::size_t overlay_every = 0, worst = 0;
};

std::string settings_line(const RunSettings& s, bool segmenter_was_open) {
  std::string tracker = "; tracker " + s.tracker;
  if (s.real_time_rate) tracker += ", at the speed of the recording";
  if (!s.front_end) {
    for (const std::string& stage : s.without)
      if (stage == "loop_closing") tracker += ", without " + stage;
    return "front end off: every keypoint goes to the tracker" + tracker;
  }
  std::string line = "front end on, preset " + s.preset;
  if (!s.settings_file.empty()) line += ", " + s.settings_file.string();
  for (const std::string& text : s.changed) line += ", " + text;
  for (const std::string& stage : s.without) line += ", without " + stage;
  line += "; segmenter " + s.segmenter;
  if (s.segmenter == "mask_files") line += " (" + s.masks.string() + ")";
  if (!s.model.empty()) line += " (" + s.model.string() + ")";
  if (s.async) line += " in a thread, at the speed of the recording";
  if (s.latency_ms >= 0)
    line += " as if it took " + std::to_string(std::lround(s.latency_ms)) + " ms";
  if (segmenter_was_open && s.segmenter == "none")
    line += ", as there is no folder masks" +
            std::string(s.preset == "default" ? "" : ": nothing will be masked");
  return line + tracker;
}

/// Everything that a run may write.
const char* const kResults[] = {
    "trajectory.txt", "trajectory_online.txt", "groundtruth.txt", "stats.json", "settings.yaml",
    "map.ply",        "keypoints.csv",         "masks",           "overlays",   "worst"};

/// Where a result stands until the run is done.
fs::path partial(const fs::path& result) { return result.string() + ".partial"; }

/// Gives a finished result its name. Of a folder each file: what else lies there stays.
void put_in_place(const fs::path& result) {
  const fs::path made = partial(result);
  if (!fs::is_directory(made)) {
    if (fs::exists(made)) fs::rename(made, result);
    return;
  }
  make_folder(result);
  for (const auto& entry : fs::directory_iterator(made))
    fs::rename(entry.path(), result / entry.path().filename());
  fs::remove_all(made);
}

/// Refuses what would spoil its own input, or cannot be done.
void check(const RunCommand& command) {
  const RunSettings& settings = command.settings;
  if (fs::equivalent(command.out, settings.sequence))
    throw Error(
        "--out: " + command.out.string() +
        " is the sequence itself; results would overwrite its files, choose another folder");
  if (command.save_masks && fs::exists(command.out / "masks") && !settings.masks.empty() &&
      fs::equivalent(command.out / "masks", settings.masks))
    throw Error("--save-masks: would overwrite the masks that are read from " +
                settings.masks.string() + "; choose another --out");
  if (command.worst > 0 && !fs::is_directory(settings.sequence / "masks_gt"))
    throw Error("--save-worst: needs " + (settings.sequence / "masks_gt").string() +
                " to tell what is wrong");
  if (!command.objects.empty() && !settings.front_end)
    throw Error("--save-objects: the front end follows objects; leave --front-end off out");
  check_can_hold(command.objects, "--save-objects");
}

/// Results are made beside those of an earlier run, and take their place when all are there.
RunOutputs outputs_of(const RunCommand& command) {
  RunOutputs outputs;
  outputs.keep_unfinished = true;
  outputs.trajectory = partial(command.out / "trajectory.txt");
  outputs.trajectory_online = partial(command.out / "trajectory_online.txt");
  outputs.groundtruth = partial(command.out / "groundtruth.txt");
  outputs.map_ply = partial(command.out / "map.ply");
  if (command.save_masks) outputs.masks_dir = partial(command.out / "masks");
  if (command.save_keypoints) outputs.keypoints_csv = partial(command.out / "keypoints.csv");
  outputs.objects_csv = command.objects;
  if (command.overlay_every > 0) outputs.overlays_dir = partial(command.out / "overlays");
  outputs.overlay_every = command.overlay_every;
  outputs.worst = command.worst;
  outputs.worst_dir = partial(command.out / "worst");
  return outputs;
}

void remove_partial(const fs::path& out) {
  for (const char* name : kResults) fs::remove_all(partial(out / name));
}

/// Runs, and leaves all results as .partial. After a failure only the trajectory stays, if any.
nlohmann::ordered_json make_results(const RunCommand& command) {
  const RunOutputs outputs = outputs_of(command);
  std::unique_ptr<Progress> progress;
  try {
    const auto stats = run_job(
        command.settings, outputs,
        [&](std::size_t done, std::size_t total) {
          if (!progress) progress = std::make_unique<Progress>("run", total);
          progress->update(done);
        },
        [&](const std::string& note) {
          progress.reset();
          std::fprintf(stderr, "stillpoint: warning: %s\n", note.c_str());
        });
    write_json(partial(command.out / "stats.json"), stats);
    // Without the run's seed: the file and the same options give the same run again.
    RunSettings unseeded = command.settings;
    unseeded.seed = 0;
    write_settings(partial(command.out / "settings.yaml"), front_end_settings(unseeded));
    return stats;
  } catch (const std::exception& e) {
    if (fs::exists(outputs.trajectory) && fs::file_size(outputs.trajectory) > 0)
      throw Error(std::string(e.what()) + "; what was tracked before it is in " +
                  outputs.trajectory.string());
    remove_partial(command.out);
    throw;
  }
}

/// What an earlier run left must not be taken for this one's.
void replace_results(const RunCommand& command, const TumSequence& sequence) {
  if (command.overlay_every > 0)
    for (const SequenceEntry& entry : sequence.entries())
      fs::remove(command.out / "overlays" / (entry.stem + ".png"));
  if (command.worst > 0) fs::remove_all(command.out / "worst");
  for (const char* name : {"keypoints.csv", "groundtruth.txt"}) fs::remove(command.out / name);
  for (const char* name : kResults) put_in_place(command.out / name);
}

void print_summary(const RunCommand& command, const nlohmann::ordered_json& stats) {
  const RunSettings& settings = command.settings;
  std::printf("%s", summary_text(stats).c_str());
  const fs::path truth = settings.groundtruth_of == "camera" ? settings.sequence : command.out;
  const fs::path file = command.out / "trajectory.txt";
  if (stats.contains("evaluation"))
    std::printf("evo         %s\n", evo_command(truth / "groundtruth.txt", file).c_str());
  std::printf(
      "written     %s: trajectory.txt, trajectory_online.txt, stats.json, settings.yaml, "
      "map.ply%s%s%s%s\n",
      command.out.string().c_str(), command.save_masks ? ", masks/" : "",
      command.save_keypoints ? ", keypoints.csv" : "",
      command.overlay_every > 0 ? ", overlays/" : "", command.worst > 0 ? ", worst/" : "");
}

void run(RunCommand command) {
  RunSettings& settings = command.settings;
  const bool segmenter_was_open = settings.segmenter.empty();
  load_settings(settings);
  // Bad input is said before anything is written.
  const TumSequence sequence = open_sequence(settings.sequence, settings.camera);
  if (sequence.has_groundtruth()) sequence.groundtruth();
  choose_segmenter(settings);
  if (command.save_masks || command.overlay_every > 0 || settings.segmenter == "mask_files")
    check_names_differ(sequence);
  make_segmenter(settings, sequence);
  std::printf("%s\n", settings_line(settings, segmenter_was_open).c_str());
  std::fflush(stdout);
  make_folder(command.out);
  check(command);
  // Whether a result can be written is known before the run.
  write_file(partial(command.out / "trajectory.txt"), "", "result");
  remove_partial(command.out);
  const auto stats = make_results(command);
  replace_results(command, sequence);
  print_summary(command, stats);
  if (stats["tracked"] == 0)
    throw Error("no frame was tracked; are camera, depth factor and mask right? " +
                (command.out / "stats.json").string() + " tells what is known");
}

/// Options for the tracker and the pace of the run.
void add_run_options(CLI::App* command, RunSettings& s) {
  choices(command->add_option_function<std::string>(
              "--front-end", [&s](const std::string& value) { s.front_end = value == "on"; },
              "off: the tracker alone, for comparison  [on]"),
          {"on", "off"});
  choices(command->add_option("--without", s.without, "Leave a stage out; may be given again"),
          {"compensation", "depth", "probability", "motion", "prediction", "loop_closing"})
      ->allow_extra_args(false);
  choices(
      command->add_option("--tracker", s.tracker,
                          "slam: maps and closes loops; vo: odometry, which never looks back  [" +
                              default_tracker() + "]"),
      tracker_names());
  between(command->add_option(
              "--features", s.features,
              "Keypoints per frame; up to three times as many\nwhere masks hide much  [1000]"),
          50, 100000);
  command
      ->add_option("--seed", s.seed,
                   "Another chance: other random samples in the front end, and a hundredth of the\n"
                   "keypoints left out at random  [0: neither]")
      ->type_name("N");
  add_groundtruth_option(command, s.groundtruth_of);
  command->add_flag("--async", s.async,
                    "The segmenter in a thread, the frames at the speed of the recording");
  command->add_flag("--real-time-rate", s.real_time_rate,
                    "Frames at the speed of the recording; those that come too late are dropped");
  between(command->add_option("--latency", s.latency_ms,
                              "As if the segmenter took so long per frame; the same in every run"),
          0.0, 10000.0, "MS");
}

std::string overlay_problem(const std::string& value) {
  return !value.empty() && value.find_first_not_of("0123456789") == std::string::npos &&
                 value.size() < 10 && std::stoul(value) > 0
             ? std::string()
             : "expected a number of frames of at least 1, found \"" + value +
                   "\"; write --save-overlays=1";
}

/// Options for what is written beside the usual results.
void add_save_options(CLI::App* command, RunCommand& c) {
  command->add_flag("--save-masks", c.save_masks,
                    "Write DIR/masks/STEM.png: the final mask, 255 = dynamic");
  command->add_flag("--save-keypoints", c.save_keypoints,
                    "Write DIR/keypoints.csv: timestamp,x,y,probability,kept");
  add_objects_option(command, "--save-objects", c.objects);
  command
      ->add_option_function<std::string>(
          "--save-overlays",
          [&c](const std::string& value) {
            c.overlay_every =
                value.empty() || value == "true" ? 1 : static_cast<std::size_t>(std::stoul(value));
          },
          "Write DIR/overlays/STEM.png of every EVERY-th frame  [1]")
      ->expected(0, 1)
      ->check(CLI::Validator([](std::string& value) { return overlay_problem(value); }, ""))
      ->type_name("[EVERY]");
  between(command->add_option("--save-worst", c.worst,
                              "Write DIR/worst/: the N frames with the worst masks, by masks_gt"),
          1, 1000);
}

const char* const kRunFooter = R"(
Examples:
  stillpoint run walk --out out
  stillpoint run rgbd_dataset_freiburg3_walking_xyz --camera fr3 --masks my_masks --out out
  stillpoint run walk --out out --front-end off             the tracker alone
  stillpoint run walk --out out --without depth             leave one stage out
  stillpoint run walk --model FastestDet.onnx --out out     a network, and no masks on the disk
  stillpoint run walk --model yolo.onnx --async --out out   beside the camera, as on a robot
  stillpoint run walk --out out --real-time-rate            as on a robot: late frames are dropped
  stillpoint run walk --out out --set dilation_px=5         another value for a setting
  stillpoint run walk --out again --settings out/settings.yaml   as that run was set
  stillpoint run walk --out out --save-overlays 10          images of every tenth frame

Presets: default is ours, with the motion check, which finds what moves although no segmenter names
it, also with --segmenter none; network_only is without it; paper the literal method of the paper.

Masks: 8-bit PNGs named like the color files (rgb/12.5.jpg: 12.5.png), 0 = background, k = object k; an
image with only 0 and 255 is split into connected parts. A black image says that nobody is there;
a missing file that there is no result for this frame, and its masks are predicted.

Results in DIR: trajectory.txt (TUM format: timestamp tx ty tz qx qy qz qw, seconds and metres, one
line per tracked frame, as the whole map knows it in the end), trajectory_online.txt (the same as each
frame had it at its time, which is what a robot acts on), stats.json (coverage, errors, ms per stage,
status counts, settings, versions), settings.yaml (all settings of the front end as used; --settings
takes it), map.ply (colored points of the static world), and what --save-... asks for. They take the
place of an earlier run's when the run is done; one that breaks off leaves what was tracked so far in
trajectory.txt.partial. Overlays: kept keypoints green, removed ones red, the mask's edge yellow. With
groundtruth.txt in SEQUENCE the error is computed, with masks_gt/ masks and keypoints are judged, with
both the map's ghosts of people.
--real-time-rate: the clock stands still while images are read and results judged (not with
--async); the tracker slam maps in threads of its own, so runs differ a little.)";

}  // namespace

void add_run_command(CLI::App& app) {
  auto* command = app.add_subcommand("run", "Run the whole system over a sequence");
  auto options = std::make_shared<RunCommand>();
  RunSettings& s = options->settings;
  s.tracker = default_tracker();
  add_input_option(command, "SEQUENCE", s.sequence,
                   "Folder in TUM layout: rgb.txt, depth.txt, images");
  add_out_option(command, options->out, "results");
  add_system_options(command, s);
  add_preset_option(command, s);
  add_front_end_options(command, s);
  add_run_options(command, s);
  add_save_options(command, *options);
  command->footer(kRunFooter);
  command->callback([options] { run(*options); });
}

}  // namespace stillpoint::cli
