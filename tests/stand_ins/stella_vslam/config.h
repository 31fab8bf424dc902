// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

namespace stella_vslam {
/// stella_vslam/config.h: reads a YAML file. The stand-in takes its name and reads nothing.
class config {
 public:
  explicit config(const std::string& config_file_path) : config_file_path_(config_file_path) {}
  const std::string config_file_path_;
};
}  // namespace stella_vslam
