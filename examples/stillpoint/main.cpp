// SPDX-License-Identifier: BSD-2-Clause
//
// The `stillpoint` command line. Exit codes: 0 done, 1 something went wrong (one line on stderr
// says what), 2 the command line was not understood.

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <cstdio>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <string>

#include "commands.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/version.hpp"

namespace {

/// Says `message` on one line of stderr, with the program's name once.
int fail(std::string message, int code) {
  for (char& c : message)
    if (c == '\n' || c == '\r') c = ' ';
  message.erase(message.find_last_not_of(' ') + 1);
  const std::string name = "stillpoint: ";  // also in an Error that another one quotes
  for (std::size_t at; (at = message.find(name)) != std::string::npos;)
    message.erase(at, name.size());
  std::fprintf(stderr, "%s%s\n", name.c_str(), message.c_str());
  return code;
}

/// The subcommand that the parser had reached, for "see ... --help".
std::string command_name(const CLI::App& app) {
  for (const CLI::App* sub : app.get_subcommands()) return "stillpoint " + sub->get_name();
  return "stillpoint";
}

std::string quoted_command_line(int argc, char** argv) {
  std::string line = "stillpoint";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool plain = !word.empty() && word.find_first_not_of(
                                            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                            "0123456789_-+=.,/:@") == std::string::npos;
    line += plain ? " " + word : " '" + word + "'";
  }
  return line;
}

}  // namespace

std::string& stillpoint::cli::command_line() {
  static std::string line;
  return line;
}

int main(int argc, char** argv) {
  // OpenCV's own log lines would stand between ours; what matters comes back as an error.
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);

  CLI::App app{
      "Stillpoint tells a SLAM system which keypoints and pixels of a blurred, crowded RGB-D "
      "frame\n"
      "belong to the static world, and tracks the camera on them."};
  app.name("stillpoint");
  app.set_version_flag("--version", "stillpoint " STILLPOINT_VERSION);
  app.require_subcommand(1);
  app.get_formatter()->column_width(32);
  app.footer(R"(
A first try, without any data:
  stillpoint synth /tmp/walk --frames 100       render people walking before a moving camera
  stillpoint run /tmp/walk --out /tmp/out       track it; the end of the output shows the error
  stillpoint bench /tmp/walk --out /tmp/bench   compare front end off, paper, default, each stage
                                                left out; then open /tmp/bench/index.html
With TUM RGB-D data (rgb.txt, depth.txt, groundtruth.txt) and masks of your network in masks/:
  stillpoint run rgbd_dataset_freiburg3_walking_xyz --camera fr3 --out out

Masks for another system (COLMAP, nerfstudio, your own), without SLAM:
  stillpoint mask photos --model yolov8n-seg_headless.onnx --format colmap --out masks

`stillpoint COMMAND --help` tells the rest. Distances are metres, times seconds (where a name does
not say ms), pictures 8-bit PNG or JPEG, masks 8-bit PNG with 0 = static background.)");

  stillpoint::cli::add_synth_command(app);
  stillpoint::cli::add_run_command(app);
  stillpoint::cli::add_evaluate_command(app);
  stillpoint::cli::add_mask_command(app);
  stillpoint::cli::add_segment_command(app);
  stillpoint::cli::add_bench_command(app);

  stillpoint::cli::command_line() = quoted_command_line(argc, argv);
  const auto known = app.get_subcommands([](const CLI::App*) { return true; });
  if (argc > 1 && argv[1][0] != '-' &&
      std::none_of(known.begin(), known.end(),
                   [&](const CLI::App* command) { return command->check_name(argv[1]); }))
    return fail("unknown command \"" + std::string(argv[1]) +
                    "\"; expected synth, run, evaluate, mask or bench (see `stillpoint --help`)",
                2);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help, --version
    return fail(std::string(e.what()) + " (see `" + command_name(app) + " --help`)", 2);
  } catch (const std::bad_alloc&) {
    return fail("out of memory", 1);
  } catch (const std::exception& e) {
    return fail(e.what(), 1);
  }
  return 0;
}
