// SPDX-License-Identifier: BSD-2-Clause
#include <cstdio>
#include <fstream>
#include <memory>

#include "commands.hpp"
#include "files.hpp"
#include "options.hpp"
#include "run_job.hpp"
#include "synthetic/writer.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;

struct SynthOptions {
  fs::path out;
  std::string motion = "xyz", size = "640x480";
  double shutter_ms = 25;
  SyntheticSettings settings;
  bool no_object = false;
  SyntheticWriterOptions writer;
};

/// A folder with a sequence of another origin must not be overwritten.
void check_target(const fs::path& out) {
  std::ifstream list(out / "rgb.txt");
  if (!list) return;
  std::string text{std::istreambuf_iterator<char>(list), std::istreambuf_iterator<char>()};
  if (text.find("# file: synthetic") == std::string::npos)
    throw Error(out.string() +
                ": holds a sequence that synth did not make (see its rgb.txt); choose another "
                "folder");
}

bool parse_size(const std::string& text, SyntheticSettings& settings) {
  char end = 0;
  return std::sscanf(text.c_str(), "%dx%d%c", &settings.width, &settings.height, &end) == 2;
}

void synth(SynthOptions options) {
  SyntheticSettings& settings = options.settings;
  settings.motion = synthetic_motion(options.motion);
  settings.shutter_s = options.shutter_ms / 1000;
  settings.carried_object = !options.no_object;
  parse_size(options.size, settings);
  check_target(options.out);
  make_folder(options.out);
  SyntheticSummary summary;
  {
    std::unique_ptr<Progress> progress;
    summary = write_synthetic_sequence(
        options.out.string(), settings,
        [&](int done, int total) {
          if (!progress)
            progress = std::make_unique<Progress>("synth", static_cast<std::size_t>(total));
          progress->update(static_cast<std::size_t>(done));
        },
        options.writer);
  }
  std::printf("%d frames of motion %s at %s, shutter %g ms, seed %llu: %s\n", summary.frames,
              options.motion.c_str(), options.size.c_str(), options.shutter_ms,
              static_cast<unsigned long long>(settings.seed), options.out.string().c_str());
  std::printf("blur        %.1f px of the room, %.1f px of the people, on average\n",
              summary.camera_blur_px, summary.people_blur_px);
  if (summary.most_cover > 0)
    std::printf(
        "%-12scover %.1f %% of the image on average, %.1f %% at most\n"
        "masks/      miss %.1f %% of the people's pixels; %.1f %% of their own pixels are wrong\n",
        settings.movers > 0 ? "movers" : "people", 100 * summary.mean_cover,
        100 * summary.most_cover, 100 * summary.lost_share, 100 * summary.false_share);
}

}  // namespace

void add_synth_command(CLI::App& app) {
  auto* command = app.add_subcommand("synth", "Render a sequence of people walking in a room");
  auto options = std::make_shared<SynthOptions>();
  SyntheticSettings& s = options->settings;
  command->add_option("OUT", options->out, "Folder for the sequence; made if it is not there")
      ->required()
      ->type_name("DIR");
  choices(command->add_option("--motion", options->motion,
                              "How the camera moves; loop: around the room, 27 m  [xyz]"),
          synthetic_motion_names());
  between(command->add_option("--people", s.people, "How many walk there, up to 20  [2]"), 0, 20);
  between(command->add_option("--frames", s.frames, "At 30 Hz  [150; loop: the whole way]"), 1,
          1000000);
  between(command->add_option("--shutter-ms", options->shutter_ms,
                              "Exposure time: makes motion blur; 0: none  [25]"),
          0.0, 1000.0, "MS");
  command->add_option("--size", options->size, "Of the images in pixels  [640x480]")
      ->type_name("WxH")
      ->check(CLI::Validator(
          [](std::string& value) {
            SyntheticSettings ignored;
            return parse_size(value, ignored)
                       ? std::string()
                       : "expected WIDTHxHEIGHT in pixels, e.g. 640x480, found \"" + value + "\"";
          },
          ""));
  command->add_option("--seed", s.seed, "Another room, people and paths  [1]")->type_name("N");
  command->add_flag("--seated", s.seated, "People sit or stand and hardly move");
  command->add_flag("--no-object", options->no_object, "Nobody carries a carton");
  between(command->add_option("--movers", s.movers,
                              "Movers unknown to networks; 1: a pushed carton, 2: and a door  [0]"),
          0, 2);
  command->add_flag("--jpeg", options->writer.jpeg, "Color as JPEG, to save space");
  command->footer(R"(
Examples:
  stillpoint synth walk_xyz
  stillpoint synth walk_rpy --motion rpy --people 3 --shutter-ms 30
  stillpoint synth calm --people 0 --frames 60 --size 320x240

Writes the TUM layout: rgb/, depth/ (16 bit, 5000 per metre), rgb.txt, depth.txt, associations.txt,
groundtruth.txt, camera.yaml; masks_gt/ (exact) and masks/ (as a network gives them that blur makes
fail: people and limbs missing, ragged borders); blur.csv. Exposure is integrated over time, so blur
is as real as the motion. The same options give the same files.)");
  command->callback([options] { synth(*options); });
}

}  // namespace stillpoint::cli
