// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "options.hpp"
#include "run_job.hpp"
#include "stillpoint/io/mask_folder.hpp"
#include "systems.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

struct SegmentOptions {
  RunSettings settings;
  std::filesystem::path out;
};

// Mask files have no classes: only what moves is written.
void keep_dynamic(const std::vector<DynamicClass>& classes, std::vector<Instance>& instances) {
  instances.erase(std::remove_if(instances.begin(), instances.end(),
                                 [&](const Instance& s) { return !is_dynamic(s, classes); }),
                  instances.end());
}

// A detector's boxes become masks by the depth in them.
void carve_boxes(const RgbdFrame& frame, Segmentation& result, DepthMaskFuser& fuser) {
  bool bare = false;
  for (const Instance& s : result.instances) bare = bare || s.mask.empty();
  if (!bare) return;
  fuser.fuse(frame, result);
  for (std::size_t i = 0; i < result.instances.size(); ++i)
    if (result.instances[i].mask.empty()) result.instances[i] = fuser.instances()[i];
}

void segment(SegmentOptions options) {
  const TumSequence sequence = open_sequence(options.settings.sequence, options.settings.camera);
  choose_segmenter(options.settings);
  const std::unique_ptr<Segmenter> segmenter = make_segmenter(options.settings, sequence);
  if (!segmenter)
    throw Error(
        "segment: needs a segmenter; say which one with --segmenter (\"none\" finds nobody)");
  make_folder(options.out);
  const std::size_t count = options.settings.frames > 0
                                ? std::min(options.settings.frames, sequence.size())
                                : sequence.size();
  const std::vector<DynamicClass> classes = dynamic_classes(options.settings);
  DepthMaskFuserSettings fusion;
  fusion.dilation_px = 0;
  DepthMaskFuser fuser(fusion, *sequence.camera());
  std::size_t written = 0, instances = 0;
  {
    Progress progress("segment", count);
    for (std::size_t i = 0; i < count; ++i) {
      const RgbdFrame frame = sequence.load(i);
      Segmentation result = segmenter->segment(frame);
      if (result.available) {
        keep_dynamic(classes, result.instances);
        carve_boxes(frame, result, fuser);
        write_labels(options.out, sequence.entry(i).stem, result.instances, frame.color.size());
        ++written;
        instances += result.instances.size();
      }
      progress.update(i + 1);
    }
  }
  std::printf("%zu frames, %zu with a result, %zu instances in all; written: %s\n", count, written,
              instances, options.out.string().c_str());
}

}  // namespace

void add_segment_command(CLI::App& app) {
  auto* command = app.add_subcommand("segment", "Run a segmenter once and keep its masks as files");
  auto options = std::make_shared<SegmentOptions>();
  command->add_option("SEQUENCE", options->settings.sequence, "Folder in TUM layout")
      ->required()
      ->type_name("DIR");
  command->add_option("--out", options->out, "Folder for the masks; made if it is not there")
      ->required()
      ->type_name("DIR");
  add_system_options(command, options->settings);
  command->footer(R"(
Examples:
  stillpoint segment walk --model yolov8n-seg_headless.onnx --out walk/masks
  stillpoint segment walk --model FastestDet.onnx --dynamic person,chair=0.5 --out walk/masks

Writes one 8-bit PNG per color picture that the segmenter has a result for, named by the color file's
stem: 0 = background, k = dynamic object k; a detector's boxes are filled by the depth in them.
`stillpoint run --segmenter mask_files --masks DIR` reads them.)");
  command->callback([options] { segment(*options); });
}

}  // namespace stillpoint::cli
