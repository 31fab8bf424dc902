// SPDX-License-Identifier: BSD-2-Clause
#include "systems.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <type_traits>
#include <utility>

#include "front_end_options.hpp"
#include "stillpoint/backends/mask_files.hpp"
#ifdef STILLPOINT_WITH_OPENCV_DNN
#include "stillpoint/backends/opencv_dnn/segmenter.hpp"
#endif
#include "stillpoint/backends/rgbd_slam/slam_system.hpp"
#ifdef STILLPOINT_WITH_TORCHSCRIPT
#include "stillpoint/backends/torchscript.hpp"
#endif
#include "stillpoint/io/mask_folder.hpp"
#include "stillpoint/io/setting_names.hpp"
#include "stillpoint/io/text_file.hpp"
#include "stillpoint/segmentation/detection_thread.hpp"
#include "stillpoint/testing/delayed_segmenter.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

/// The camera that a folder's name speaks of ("rgbd_dataset_freiburg3_..."), for a hint.
std::string hinted_camera(const std::string& folder) {
  for (const char* n : {"1", "2", "3"})
    for (const char* word : {"freiburg", "fr"})
      if (folder.find(std::string(word) + n) != std::string::npos) return std::string("fr") + n;
  return folder.find("bonn") != std::string::npos ? "bonn" : "";
}

/// A segmenter around another, and that other.
template <class Outer>
class Owning : public Segmenter {
 public:
  template <class... Arguments>
  explicit Owning(std::unique_ptr<Segmenter> inner, Arguments... arguments)
      : inner_(std::move(inner)), outer_(*inner_, arguments...) {}
  Segmentation segment(const RgbdFrame& frame) override {
    if constexpr (std::is_same_v<Outer, DetectionThread>) {
      // The map begins with the first frame: people in it must be known.
      if (first_) outer_.segment(frame), outer_.wait_for_result(60);
      first_ = false;
    }
    return outer_.segment(frame);
  }
  std::vector<std::string> classes() const override { return outer_.classes(); }

 private:
  bool first_ = true;
  std::unique_ptr<Segmenter> inner_;
  Outer outer_;
};

/// A folder of something else (color images) is refused at once, not in each frame.
void check_first_mask(const fs::path& folder, const TumSequence& sequence) {
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const fs::path file = mask_path(folder, sequence.entry(i).stem);
    if (!fs::exists(file)) continue;
    read_labels(file, sequence.load(i).color.size());
    return;
  }
}

bool is_network(const std::string& segmenter) {
  return segmenter == "opencv_dnn" || segmenter == "torchscript";
}

#if defined(STILLPOINT_WITH_OPENCV_DNN) || defined(STILLPOINT_WITH_TORCHSCRIPT)
cv::Size size_from(const std::string& text) {
  const std::size_t x = text.find('x');
  const auto width = detail::parse_number(text.substr(0, x));
  const auto height =
      x == std::string::npos ? std::nullopt : detail::parse_number(text.substr(x + 1));
  if (!width || !height || !(*width >= 32 && *width <= 8192 && *height >= 32 && *height <= 8192))
    throw Error("--input-size: expected WIDTHxHEIGHT, 32 to 8192 pixels each, found \"" + text +
                "\"");
  return {static_cast<int>(*width), static_cast<int>(*height)};
}

template <class Network>
std::unique_ptr<Segmenter> make_network(const RunSettings& settings,
                                        typename Network::Settings network) {
  network.decoder = settings.decoder;
  if (!settings.input_size.empty()) network.input_size = size_from(settings.input_size);
  auto segmenter = std::make_unique<Network>(settings.model, network);
  check_dynamic_classes(dynamic_classes(settings), segmenter->classes());
  return segmenter;
}
#endif

}  // namespace

std::vector<std::string> segmenter_names() {
  std::vector<std::string> names = {"none", "mask_files"};
#ifdef STILLPOINT_WITH_OPENCV_DNN
  names.push_back("opencv_dnn");
#endif
#ifdef STILLPOINT_WITH_TORCHSCRIPT
  names.push_back("torchscript");
#endif
  return names;
}
std::vector<std::string> tracker_names() { return {"slam", "vo"}; }
std::string default_tracker() { return "slam"; }

TumSequence open_sequence(const fs::path& folder, const std::string& camera, bool depth_required) {
  TumSequence::Settings settings;
  settings.depth_required = depth_required;
  if (!camera.empty()) settings.camera = camera_from(camera);
  TumSequence sequence(folder, settings);
  if (!sequence.camera() && !sequence.entry(0).depth_path.empty()) {
    const std::string hint = hinted_camera(fs::absolute(folder).lexically_normal().string());
    throw Error("sequence " + folder.string() +
                ": has no camera.yaml; say which camera took it: --camera fr1, fr2, fr3, bonn or "
                "an ORB-SLAM style YAML file" +
                (hint.empty() ? "" : " (its name speaks of --camera " + hint + ")"));
  }
  return sequence;
}

std::vector<std::string> sequence_notes(const TumSequence& sequence) {
  std::vector<std::string> notes;
  if (sequence.missing_images() > 0)
    notes.push_back(std::to_string(sequence.missing_images()) +
                    " listed images are not on the disk; their frames are left out");
  // A few are usual at the ends of a recording.
  const std::size_t alone = sequence.without_depth(), all = alone + sequence.size();
  if (20 * alone > all)
    notes.push_back(std::to_string(alone) + " of " + std::to_string(all) +
                    " listed color images have no depth within 0.02 s; they are left out, and "
                    "coverage is that of the rest");
  if (!sequence.camera()) return notes;
  const Camera& camera = *sequence.camera();
  const cv::Size size = sequence.load(0).color.size();
  if (!cv::Rect2d(0, 0, size.width, size.height).contains({camera.cx, camera.cy}))
    notes.push_back("the camera's principal point, " + fixed(camera.cx, 1) + " " +
                    fixed(camera.cy, 1) + ", is outside of the image, " +
                    std::to_string(size.width) + "x" + std::to_string(size.height) +
                    "; is the camera file of another resolution?");
  return notes;
}

void check_names_differ(const TumSequence& sequence) {
  std::map<std::string, std::string> files;
  for (const SequenceEntry& entry : sequence.entries()) {
    const auto [first, is_new] = files.emplace(entry.stem, entry.color_path.string());
    if (!is_new)
      throw Error("sequence " + sequence.folder().string() +
                  ": masks are named after their images, and " + first->second + " and " +
                  entry.color_path.string() + " have one name; name them apart");
  }
}

void load_settings(RunSettings& settings) {
  if (!settings.settings_file.empty()) settings.from_file = read_settings(settings.settings_file);
}

void choose_segmenter(RunSettings& settings) {
  const fs::path masks = settings.sequence / "masks";
  if (settings.segmenter.empty() && !settings.model.empty()) {
    const fs::path ending = settings.model.extension();
    settings.segmenter = ending == ".pt" || ending == ".torchscript" ? "torchscript" : "opencv_dnn";
  }
  if (settings.segmenter.empty())
    settings.segmenter = !settings.masks.empty() || fs::is_directory(masks) ? "mask_files" : "none";
  if (settings.segmenter == "mask_files" && settings.masks.empty()) settings.masks = masks;
  if (settings.segmenter != "mask_files" && !settings.masks.empty())
    throw Error("--masks: only the segmenter mask_files reads masks, found --segmenter " +
                settings.segmenter);
  for (const auto& [name, given] :
       {std::make_pair("--model", !settings.model.empty()),
        std::make_pair("--model-config", !settings.model_config.empty()),
        std::make_pair("--decoder", !settings.decoder.empty()),
        std::make_pair("--input-size", !settings.input_size.empty())})
    if (given && !is_network(settings.segmenter))
      throw Error(std::string(name) + ": only the segmenters opencv_dnn and torchscript run a " +
                  "network, found --segmenter " + settings.segmenter);
  if (is_network(settings.segmenter) && settings.model.empty())
    throw Error("--segmenter " + settings.segmenter + ": needs its network: --model FILE");
  if (settings.segmenter == "torchscript" && !settings.model_config.empty())
    throw Error(
        "--model-config: only the segmenter opencv_dnn takes one, found --segmenter "
        "torchscript");
  if (settings.async && settings.latency_ms >= 0)
    throw Error("--async and --latency exclude each other: one is real, one is played");
  for (const auto& [option, given] :
       {std::make_pair("--dynamic: only a segmenter names classes", !settings.dynamic.empty()),
        std::make_pair("--latency: only a segmenter's results are late", settings.latency_ms >= 0),
        std::make_pair("--async: only a segmenter runs in a thread", settings.async)})
    if (given && settings.segmenter == "none")
      throw Error(std::string(option) + ", found --segmenter none");
  dynamic_classes(settings);  // says what is wrong with them
}

std::unique_ptr<Segmenter> make_segmenter(const RunSettings& settings,
                                          const TumSequence& sequence) {
  if (settings.segmenter == "none") return nullptr;
  if (settings.segmenter == "mask_files") {
    auto segmenter = std::make_unique<MaskFilesSegmenter>(settings.masks, frame_names(sequence));
    check_first_mask(settings.masks, sequence);
    const std::vector<std::string> known = segmenter->classes();
    for (const DynamicClass& c : dynamic_classes(settings))
      if (c.name != known.front())
        throw Error("--dynamic: mask files have no class names, everything in them is \"" +
                    known.front() + "\"; found \"" + c.name + "\"");
    return segmenter;
  }
#ifdef STILLPOINT_WITH_OPENCV_DNN
  if (settings.segmenter == "opencv_dnn") {
    OpenCvDnnSettings network;
    network.config = settings.model_config;
    return make_network<OpenCvDnnSegmenter>(settings, network);
  }
#endif
#ifdef STILLPOINT_WITH_TORCHSCRIPT
  if (settings.segmenter == "torchscript") return make_network<TorchScriptSegmenter>(settings, {});
#else
  if (settings.segmenter == "torchscript")
    throw Error(settings.model.string() + ": this program was built without the segmenter " +
                "torchscript; install libtorch-dev (Debian, Ubuntu) and build it again");
#endif
  throw Error("--segmenter: expected one of " + joined(segmenter_names()) + ", found \"" +
              settings.segmenter + "\"");
}

std::unique_ptr<Segmenter> make_late(const RunSettings& settings,
                                     std::unique_ptr<Segmenter> segmenter) {
  if (!segmenter || (!settings.async && settings.latency_ms < 0)) return segmenter;
  if (settings.async) return std::make_unique<Owning<DetectionThread>>(std::move(segmenter));
  return std::make_unique<Owning<DelayedSegmenter>>(std::move(segmenter),
                                                    settings.latency_ms / 1000);
}

std::vector<DynamicClass> dynamic_classes(const RunSettings& settings) {
  const auto& given = settings.dynamic.empty() ? settings.from_file.dynamic : settings.dynamic;
  if (given.empty()) return FrontEndSettings().dynamic_classes;
  std::vector<DynamicClass> classes;
  for (const std::string& text : given) {
    const std::size_t equals = text.find('=');
    const auto prior = equals == std::string::npos ? std::optional<double>(1)
                                                   : detail::parse_number(text.substr(equals + 1));
    if (!prior || equals == 0)
      throw Error("--dynamic: expected NAME or NAME=PRIOR (0 to 1), found \"" + text + "\"");
    classes.emplace_back(text.substr(0, equals), static_cast<float>(*prior));
  }
  check_dynamic_classes(classes, {});
  return classes;
}

std::unique_ptr<Tracker> make_tracker(const RunSettings& settings, const Camera& camera) {
  const auto names = tracker_names();
  if (std::find(names.begin(), names.end(), settings.tracker) == names.end())
    throw Error("--tracker: expected one of " + joined(names) + ", found \"" + settings.tracker +
                "\"");
  using Slam = rgbd_slam::SlamSystem;
  Slam::Settings slam = settings.tracker == "vo" ? Slam::Settings::odometry() : Slam::Settings();
  // Else not threaded: the same input gives the same trajectory, which tables need.
  slam.threaded = settings.real_time_rate;
  if (std::find(settings.without.begin(), settings.without.end(), "loop_closing") !=
      settings.without.end())
    slam.loops.enabled = false;
  if (settings.features > 0) slam.features.features = settings.features;
  slam.noise.sensor = front_end_settings(settings).sensor;
  return std::make_unique<Slam>(camera, slam);
}

nlohmann::ordered_json tracker_json(const Tracker& tracker) {
  const auto* slam = dynamic_cast<const rgbd_slam::SlamSystem*>(&tracker);
  if (!slam) return {};
  return {{"loops_closed", slam->loops_closed()},
          {"keyframes", slam->keyframes()},
          {"map_points", slam->map_points()}};
}

FrontEndSettings front_end_settings(const RunSettings& settings) {
  FrontEndSettings front_end = FrontEndSettings::preset(settings.preset);
  if (!settings.sensor.empty()) front_end.sensor = sensor_of(settings.sensor);
  for (const auto* changes : {&settings.from_file.changed, &settings.changed})
    for (const std::string& text : *changes) change_setting(front_end, text);
  if (!settings.varied.empty())
    set_setting(front_end, settings.varied, detail::number_text(settings.varied_value));
  for (const std::string& stage : settings.without) {
    if (stage == "compensation") front_end.use_compensation = false;
    if (stage == "depth") front_end.use_depth = false;
    if (stage == "probability") front_end.use_probability = false;
    if (stage == "motion") front_end.use_motion = false;
    if (stage == "prediction") front_end.late.predict = false;
  }
  front_end.depth.seed += settings.seed;
  front_end.dynamic_classes = dynamic_classes(settings);
  return front_end;
}

}  // namespace stillpoint::cli
