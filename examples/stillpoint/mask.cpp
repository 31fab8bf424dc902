// SPDX-License-Identifier: BSD-2-Clause
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "mask_format.hpp"
#include "mask_job.hpp"
#include "options.hpp"
#include "systems.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

void mask(MaskSettings& settings) {
  load_settings(settings.run);
  std::unique_ptr<Progress> progress;
  const std::string statistics = run_mask_job(
      settings,
      [&](std::size_t done, std::size_t total) {
        if (!progress) progress = std::make_unique<Progress>("mask", total);
        progress->update(done);
      },
      [&](const std::string& note) {
        progress.reset();
        std::fprintf(stderr, "stillpoint: note: %s\n", note.c_str());
      });
  progress.reset();
  std::printf("%swritten     %s\n", statistics.c_str(), settings.out.string().c_str());
}

void add_options(CLI::App* command, MaskSettings& s) {
  add_input_option(command, "INPUT", s.run.sequence,
                   "Folder of images (PNG, JPEG), or in TUM layout: rgb.txt, depth.txt, images");
  add_out_option(command, s.out, "masks");
  choices(command->add_option("--format", s.format,
                              "Whose names and codes the masks have, see below  [stillpoint]"),
          mask_formats());
  command
      ->add_option("--depth", s.depth,
                   "Depth images of a folder of images, named like these; needs --camera")
      ->type_name("DIR");
  command
      ->add_option("--masked-depth", s.masked_depth,
                   "Write the depth, too, with 0 where the mask is dynamic")
      ->type_name("DIR");
  add_objects_option(command, "--objects", s.objects);
  between(command->add_option("--fps", s.fps, "Images per second of a folder of images  [30]"),
          0.01, 10000.0);
  add_system_options(command, s.run);
  add_preset_option(command, s.run);
  add_front_end_options(command, s.run);
}

}  // namespace

void add_mask_command(CLI::App& app) {
  auto* command = app.add_subcommand("mask", "Write a mask for each image, without SLAM");
  auto settings = std::make_shared<MaskSettings>();
  add_options(command, *settings);
  command->add_flag(
      "--network-only", settings->network_only,
      "The segmenter's masks as they are, boxes filled by depth; to run it only once");
  command->footer(R"(
Examples:
  stillpoint mask walk --model yolov8n-seg_headless.onnx --out walk/people
  stillpoint mask photos --model yolov8n-seg_headless.onnx --format colmap --out colmap_masks
  stillpoint mask data --model yolov8n-seg_headless.onnx --format nerfstudio --out data/masks
  stillpoint mask walk --out masks --format dynamic --masked-depth static_depth
  stillpoint mask walk --model FastestDet.onnx --network-only --out walk/masks     once, for many runs

The whole front end runs over the images, in the order of their names; the camera's motion is its own.
Without depth it mends the segmenter's masks; with depth it completes them, and finds what moves
without a name. A folder of images may hold them in images/. The camera: --camera, a sequence's
camera.yaml, or none, which will do without depth.

Formats: stillpoint (STEM.png: 0 = background, k = object k; `run --masks` reads it), dynamic (255 =
dynamic), static (255 = use), colmap (photo.jpg.png, 0 = ignored: ImageReader.mask_path), nerfstudio
(0 = ignored, and DIR/transforms.json with a mask_path for each frame: put it in the place of yours).

A command that was broken off goes on when it is given again: masks that are there stay, and their
frames run again for what is carried along (with --network-only they are left out). The result is
that of an uninterrupted run.)");
  command->callback([settings] { mask(*settings); });
}

void add_segment_command(CLI::App& app) {
  auto* command = app.add_subcommand("segment", "Old name of mask --network-only");
  auto settings = std::make_shared<MaskSettings>();
  settings->network_only = true;
  add_options(command, *settings);
  command->footer(
      "\nExample:\n  stillpoint mask walk --model FastestDet.onnx --network-only "
      "--out walk/masks\n\nThe next version knows this only.");
  command->callback([settings] {
    std::fprintf(stderr,
                 "stillpoint: note: segment is now `mask --network-only`; the next version "
                 "knows this only\n");
    mask(*settings);
  });
}

}  // namespace stillpoint::cli
