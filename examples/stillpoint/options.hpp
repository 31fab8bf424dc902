// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "front_end_options.hpp"
#include "run_job.hpp"

namespace stillpoint::cli {

/// Restricts an option to some words and shows them in the help: `--tracker slam|vo`.
inline CLI::Option* choices(CLI::Option* option, const std::vector<std::string>& words) {
  std::string shown;
  for (const std::string& word : words) shown += (shown.empty() ? "" : "|") + word;
  CLI::IsMember member(words);
  member.description("");
  return option->check(member)->type_name(shown);
}

/// Takes names of an earlier version for today's, and says so.
inline CLI::Validator renamed(const std::map<std::string, std::string>& names) {
  return {[names](std::string& name) {
            const auto found = names.find(name);
            if (found == names.end()) return std::string();
            std::fprintf(stderr, "stillpoint: note: %s is now called %s\n", name.c_str(),
                         found->second.c_str());
            name = found->second;
            return std::string();
          },
          ""};
}

/// "masks/" as "masks".
inline CLI::Validator without_last_slash() {
  return {[](std::string& folder) {
            while (folder.size() > 1 && folder.back() == '/') folder.pop_back();
            return std::string();
          },
          ""};
}

/// Restricts an option to a range, which its error message names; the help says N.
template <class Number>
CLI::Option* between(CLI::Option* option, Number least, Number most, const char* unit = "N") {
  CLI::Range range(least, most);
  range.description("");
  return option->check(range)->type_name(unit);
}

/// The options that `run` and `mask` share: what is read, where results go, and the objects' file.
inline void add_input_option(CLI::App* command, const char* name, std::filesystem::path& folder,
                             const char* text) {
  command->add_option(name, folder, text)->required()->type_name("DIR");
}
inline void add_out_option(CLI::App* command, std::filesystem::path& folder,
                           const std::string& what) {
  command->add_option("--out", folder, "Folder for the " + what + "; made if it is not there")
      ->required()
      ->type_name("DIR");
}
inline void add_objects_option(CLI::App* command, const char* name, std::filesystem::path& file) {
  command
      ->add_option(name, file,
                   "Write the objects of each frame as CSV: id, class, box, place, velocity")
      ->type_name("FILE");
}

/// The option of `run`, `bench` and `evaluate`.
inline void add_groundtruth_option(CLI::App* command, std::string& of) {
  choices(
      command->add_option("--groundtruth-of", of,
                          "What the true poses are of; body: the markers of the Bonn data set,\n"
                          "turned into the camera by its T_ROS and T_m  [camera]"),
      {"camera", "body"});
}

/// The option that `run` and `mask` share: which settings to start from.
inline void add_preset_option(CLI::App* command, RunSettings& s) {
  choices(command->add_option("--preset", s.preset,
                              "network_only: without the motion check  [default]"),
          {"default", "network_only", "paper"})
      ->transform(renamed({{"motion", "default"}}));
}

/// The options that `run`, `mask` and `bench` share: what the front end is to be like.
inline void add_front_end_options(CLI::App* command, RunSettings& s) {
  choices(command->add_option("--sensor", s.sensor, "What the depth is worth  [kinect_v1]"),
          sensor_names());
  command
      ->add_option("--set", s.changed,
                   "Another value for a setting: depth.dilation_px=5; may be given again,\n"
                   "and wins over --settings")
      ->allow_extra_args(false)
      ->check(CLI::Validator(
          [](std::string& text) {
            FrontEndSettings settings;
            try {
              change_setting(settings, text);
            } catch (const Error& error) {
              return std::string(error.what());
            }
            return std::string();
          },
          ""))
      ->type_name("NAME=VALUE");
  command
      ->add_option("--settings", s.settings_file,
                   "YAML file of settings by the same names, as run writes it: settings.yaml")
      ->type_name("FILE");
}

/// The options that `run` and `mask` share: where images and masks come from.
inline void add_system_options(CLI::App* command, RunSettings& s) {
  command
      ->add_option("--camera", s.camera,
                   "fr1, fr2, fr3, bonn or a YAML file  [SEQUENCE/camera.yaml]")
      ->type_name("NAME|FILE");
  choices(command->add_option("--segmenter", s.segmenter,
                              "Where masks come from  [mask_files if there are masks]"),
          segmenter_names());
  command->add_option("--masks", s.masks, "Folder of masks for mask_files  [SEQUENCE/masks]")
      ->type_name("DIR");
  command
      ->add_option("--model", s.model, "Network: ONNX and others by opencv_dnn, .pt by torchscript")
      ->type_name("FILE");
  command->add_option("--model-config", s.model_config, "Its .pbtxt, if it has one")
      ->type_name("FILE");
  command->add_option("--decoder", s.decoder, "Kind of network  [recognised]")->type_name("NAME");
  command
      ->add_option("--input-size", s.input_size,
                   "Size that images are fitted into  [the network's own]")
      ->type_name("WxH");
  command
      ->add_option("--dynamic", s.dynamic,
                   "Classes that move, and how probably: person,chair=0.5  [person]")
      ->delimiter(',')
      ->type_name("NAMES");
  between(command->add_option("--frames", s.frames, "Only the first N frames  [all]"), 1, 1000000);
}

}  // namespace stillpoint::cli
