// SPDX-License-Identifier: BSD-2-Clause
#include "mask_job.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <optional>

#include "files.hpp"
#include "front_end_options.hpp"
#include "mask_format.hpp"
#include "masker.hpp"
#include "stillpoint/core/mask_functions.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/io/depth_check.hpp"
#include "stillpoint/io/image_folder.hpp"
#include "stillpoint/io/mask_folder.hpp"
#include "stillpoint/io/objects_file.hpp"
#include "stillpoint/io/text_file.hpp"
#include "stillpoint/version.hpp"
#include "systems.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Note = std::function<void(const std::string&)>;

bool is_tum(const fs::path& folder) {
  return fs::exists(folder / "rgb.txt") || fs::exists(folder / "associations.txt");
}

/// The folder's images, or those of its subfolder images (COLMAP, nerfstudio).
fs::path image_folder_of(const fs::path& folder) {
  if (!fs::is_directory(folder) || !detail::images_by_stem(folder).empty()) return folder;
  return fs::is_directory(folder / "images") ? folder / "images" : folder;
}

std::size_t images_within_folders_of(const fs::path& folder, const fs::path& out) {
  std::size_t count = 0;
  for (auto it = fs::recursive_directory_iterator(folder); it != fs::end(it); ++it) {
    std::error_code differs;
    if (it->is_directory() && fs::equivalent(it->path(), out, differs))
      it.disable_recursion_pending();
    count += it.depth() > 0 && detail::is_image(it->path());
  }
  return count;
}

TumSequence open_input(const MaskSettings& settings, const Note& note) {
  const RunSettings& run = settings.run;
  if (is_tum(run.sequence)) {
    if (!settings.depth.empty() || settings.fps > 0)
      throw Error("--depth, --fps: only for a folder of images; " + run.sequence.string() +
                  " is a sequence, whose lists say where depth is and when");
    return open_sequence(run.sequence, run.camera, /*depth_required=*/false);
  }
  ImageFolderSettings images;
  if (!run.camera.empty()) images.camera = camera_from(run.camera);
  images.depth = settings.depth;
  images.fps = settings.fps > 0 ? settings.fps : images.camera ? images.camera->fps : 30;
  if (!settings.depth.empty() && !images.camera)
    throw Error(
        "--depth: needs the camera, for its focal length and the units of the depth: "
        "--camera fr1, fr2, fr3, bonn or an ORB-SLAM style YAML file");
  const fs::path folder = image_folder_of(run.sequence);
  TumSequence sequence = image_folder(folder, images);
  const std::size_t left =
      settings.format == "colmap" ? images_within_folders_of(folder, settings.out) : 0;
  if (left > 0)
    note(std::to_string(left) + " images lie in folders within " + folder.string() +
         ", which COLMAP reads, too: they get no masks; run each folder by itself");
  if (sequence.size() > 1 && sequence.entry(0).timestamp == 0)
    note("the names are no timestamps: " + fixed(images.fps, 0) +
         " images a second are taken (--fps)");
  else if (sequence.size() > 1 && settings.fps > 0)
    note("the names are timestamps: --fps does not count");
  return sequence;
}

/// What is counted over the frames, and told at the end.
struct Counts {
  std::size_t frames = 0, written = 0, there = 0, left_out = 0, without_result = 0, empty = 0;
  std::size_t objects = 0, restored = 0, moving = 0, segmenter_errors = 0;
  double share = 0, largest = 0;
  std::string largest_stem, segmenter_error;
  std::map<std::string, std::size_t> status;

  void add(const Masker& masker, const std::string& stem, bool network_only) {
    const double covered = cv::countNonZero(masker.dynamic()) /
                           static_cast<double>(std::max<std::size_t>(1, masker.dynamic().total()));
    share += covered;
    if (covered > largest) largest = covered, largest_stem = stem;
    empty += covered == 0;
    objects += masker.instances().size();
    if (network_only) return;
    const FrameStats& stats = masker.stats();
    restored += static_cast<std::size_t>(stats.restored);
    moving += static_cast<std::size_t>(stats.moving);
    for (const std::string& name : status_names(stats.status)) ++status[name];
    if (!stats.segmenter_error.empty() && segmenter_errors++ == 0)
      segmenter_error = stats.segmenter_error;
  }

  std::string text(bool network_only, double seconds) const {
    const auto n = [](std::size_t value) { return std::to_string(value); };
    const double masked =
        static_cast<double>(std::max<std::size_t>(1, frames - without_result - left_out));
    std::string out = "frames      " + n(frames) + ", " + n(written) + " masks written";
    if (there > 0) out += ", " + n(there) + " were there";
    if (network_only) out += ", " + n(frames - without_result) + " with a result";
    if (left_out > 0) out += "; the rest is of the new ones";
    out += "; " + fixed(static_cast<double>(frames) / std::max(seconds, 1e-3), 1) + " frames/s\n";
    out += "masked      " + fixed(100 * share / masked, 1) +
           " % of the image on average, at most " + fixed(100 * largest, 1) + " %" +
           (largest_stem.empty() ? "" : " (" + largest_stem + ")") + "; nothing in " + n(empty) +
           " frames\n";
    out += "objects     " + n(objects) + " instances, " +
           fixed(static_cast<double>(objects) / masked, 2) + " per frame";
    if (!network_only)
      out +=
          "; " + n(restored) + " carried through a miss, " + n(moving) + " found by motion alone";
    out += "\nstatus      ";
    std::string names;
    for (const auto& [name, count] : status)
      names += (names.empty() ? "" : ", ") + name + " " + n(count);
    return out +
           (names.empty() ? network_only ? "the segmenter alone" : "ok in all frames"
                          : names + "  (frames)") +
           "\n";
  }
};

Json camera_key(const std::optional<Camera>& camera) {
  if (!camera) return nullptr;
  const Camera& c = *camera;
  return {c.fx,        c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3, c.fps, c.depth_units_per_m,
          c.exposure_s};
}

/// What masks in a folder are of: an unfinished run is gone on with by the same settings only.
Json key_of(const MaskSettings& settings, const FrontEndSettings& front_end,
            const TumSequence& sequence, std::size_t count) {
  std::uintmax_t bytes = 0;
  std::error_code ignored;
  const auto add = [&](const fs::path& file) {
    const std::uintmax_t size = file.empty() ? 0 : fs::file_size(file, ignored);
    if (!ignored) bytes += size;
  };
  for (std::size_t i = 0; i < count; ++i) {
    add(sequence.entry(i).color_path);
    add(sequence.entry(i).depth_path);
    if (!settings.run.masks.empty()) add(mask_path(settings.run.masks, sequence.entry(i).stem));
  }
  add(settings.run.model);
  Json classes;
  for (const DynamicClass& c : front_end.dynamic_classes) classes[c.name] = c.prior;
  const RunSettings& run = settings.run;
  return {{"version", STILLPOINT_VERSION},
          {"format", settings.format},
          {"network_only", settings.network_only},
          {"segmenter", run.segmenter},
          {"model", run.model.filename().string()},
          {"model_config", run.model_config.filename().string()},
          {"decoder", run.decoder},
          {"input_size", run.input_size},
          {"masks", run.masks.string()},
          {"masked_depth", settings.masked_depth.string()},
          {"images", count},
          {"first", sequence.entry(0).color_path.filename().string()},
          {"last", sequence.entry(count - 1).color_path.filename().string()},
          {"last_s", sequence.entry(count - 1).timestamp},
          {"bytes", bytes},
          {"camera", camera_key(sequence.camera())},
          {"dynamic_classes", classes},
          {"settings", all_settings(front_end)}};
}

/// Refuses a folder with masks of something else.
void check_out(const MaskSettings& settings, const Json& key, const TumSequence& sequence) {
  const fs::path file = settings.out / "mask.json";
  Json old;
  std::string what = "masks of something else";
  if (fs::exists(file)) {
    old = Json::parse(read_file(file, "result"), nullptr, false);
    if (old == key) return;
  } else if (std::none_of(sequence.entries().begin(), sequence.entries().end(), [&](const auto& e) {
               return fs::exists(mask_file(settings.format, settings.out, e));
             })) {
    return;
  }
  if (old.is_object())
    for (const auto& [name, value] : key.items())
      if (old.value(name, Json()) != value) {
        what = "masks with another " + name;
        break;
      }
  throw Error("--out: expected an empty folder, or one of the same command, found " + what +
              " in " + settings.out.string() + "; choose another folder, or remove what is in it");
}

class MaskJob {
 public:
  MaskJob(const MaskSettings& settings, const Note& note)
      : settings_(settings), note_(note), sequence_(open_input(settings, note)) {
    check_names_differ(sequence_);
    choose_segmenter(settings_.run);
    const RunSettings& run = settings_.run;
    count_ = run.frames > 0 ? std::min(run.frames, sequence_.size()) : sequence_.size();
    for (std::size_t i = 0; i < count_; ++i) with_depth_ += !sequence_.entry(i).depth_path.empty();
    segmenter_ = make_segmenter(run, sequence_);
    if (!segmenter_ && (settings_.network_only || with_depth_ == 0))
      throw Error(settings_.network_only
                      ? "--network-only: needs a segmenter; name one by --model or --masks"
                      : "mask: without depth only a segmenter finds anybody; give --model or "
                        "--masks, or depth");
    check_masked_depth();
    if (!settings_.objects.empty() && settings_.network_only)
      throw Error("--objects: the front end follows objects; leave --network-only out");
    check_can_hold(settings_.objects, "--objects");
    if (settings_.format == "nerfstudio")
      transforms_ = find_transforms(sequence_.entry(0).color_path.parent_path());
    front_end_ = front_end_settings(run);
    tell();
  }

  std::string run(const std::function<void(std::size_t, std::size_t)>& progress) {
    const Json key = key_of(settings_, front_end_, sequence_, count_);
    check_out(settings_, key, sequence_);
    make_folder(settings_.out);
    if (!settings_.masked_depth.empty()) make_folder(settings_.masked_depth);
    write_json(settings_.out / "mask.json", key);
    const Camera camera = sequence_.camera().value_or(Camera());
    Masker masker(front_end_, camera, segmenter_.get(), settings_.network_only);
    DepthScaleCheck depth_check(camera);
    bool depth_told = false;
    const auto start = std::chrono::steady_clock::now();
    for (std::size_t i = 0; i < count_; ++i) {
      const RgbdFrame frame = sequence_.load(i);
      process(masker, frame, sequence_.entry(i));
      depth_check.add(frame, masker.instances());
      const bool last = i + 1 == count_;
      if (!depth_told && (last || depth_check.is_over(frame.timestamp))) {
        depth_told = true;
        if (const auto problem = depth_check.problem()) note_(*problem);
      }
      progress(i + 1, count_);
    }
    if (counts_.segmenter_errors == counts_.frames)
      throw Error("the segmenter failed in all " + std::to_string(counts_.frames) +
                  " frames: " + counts_.segmenter_error);
    if (counts_.segmenter_errors > 0)
      note_("the segmenter failed in " + std::to_string(counts_.segmenter_errors) +
            " frames (masks were predicted there): " + counts_.segmenter_error);
    if (!settings_.objects.empty()) write_file(settings_.objects, objects_, "objects file");
    if (!transforms_.empty()) write_transforms(transforms_, settings_.out, sequence_);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    return counts_.text(settings_.network_only, took.count());
  }

 private:
  // Masks, and depth that is read, are not to be taken for depth that is written.
  void check_masked_depth() const {
    const fs::path& folder = settings_.masked_depth;
    if (folder.empty()) return;
    if (with_depth_ == 0) throw Error("--masked-depth: needs depth, found none");
    const auto same = [&](const fs::path& other) {
      return fs::weakly_canonical(folder) == fs::weakly_canonical(other);
    };
    if (same(settings_.out))
      throw Error("--masked-depth: expected another folder than --out, found " + folder.string());
    for (std::size_t i = 0; i < count_; ++i)
      if (!sequence_.entry(i).depth_path.empty() &&
          same(sequence_.entry(i).depth_path.parent_path()))
        throw Error("--masked-depth: " + folder.string() +
                    " holds the depth that is read; choose another folder");
  }

  void tell() {
    for (const std::string& note : sequence_notes(sequence_)) note_(note);
    if (with_depth_ == 0 && !settings_.network_only)
      note_(
          "without depth: masks are the segmenter's, mended; no depth fusion, and nothing "
          "without a name is found");
    else if (with_depth_ < count_ && with_depth_ > 0)
      note_(std::to_string(count_ - with_depth_) + " of " + std::to_string(count_) +
            " images have no depth");
  }

  void process(Masker& masker, const RgbdFrame& frame, const SequenceEntry& entry) {
    ++counts_.frames;
    const fs::path file = mask_file(settings_.format, settings_.out, entry);
    if (settings_.network_only && fs::exists(file)) {  // nothing is carried along
      ++counts_.there, ++counts_.left_out;
      return;
    }
    if (!masker.process(frame)) {
      ++counts_.without_result;
      return;
    }
    counts_.add(masker, entry.stem, settings_.network_only);
    if (!settings_.objects.empty()) objects_ += objects_csv(frame.timestamp, masker.objects());
    // What was written before is the same: the frames before it ran again.
    const bool there = fs::exists(file);
    if (there)
      ++counts_.there;
    else
      write_whole(file, coded_mask(settings_.format, masker.dynamic(), masker.instances()));
    counts_.written += !there;
    if (settings_.masked_depth.empty() || frame.depth.empty()) return;
    const fs::path depth_file = mask_path(settings_.masked_depth, entry.stem);
    if (there && fs::exists(depth_file)) return;
    write_whole(depth_file, masked_depth(frame.depth, masker.dynamic()));
  }

  MaskSettings settings_;
  Note note_;
  const TumSequence sequence_;
  FrontEndSettings front_end_;
  std::unique_ptr<Segmenter> segmenter_;
  fs::path transforms_;
  std::size_t count_ = 0, with_depth_ = 0;
  Counts counts_;
  std::string objects_ = objects_csv_header();
};

}  // namespace

std::string run_mask_job(const MaskSettings& settings,
                         const std::function<void(std::size_t, std::size_t)>& progress,
                         const Note& note) {
  return MaskJob(settings, note).run(progress);
}

}  // namespace stillpoint::cli
