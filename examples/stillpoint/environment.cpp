// SPDX-License-Identifier: BSD-2-Clause
#include "environment.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <fstream>
#include <limits>
#include <opencv2/core/version.hpp>
#include <string>
#include <thread>

#include "stillpoint/version.hpp"

namespace stillpoint::cli {

using Json = nlohmann::ordered_json;

Json versions_json() {
  const std::string eigen = std::to_string(EIGEN_WORLD_VERSION) + "." +
                            std::to_string(EIGEN_MAJOR_VERSION) + "." +
                            std::to_string(EIGEN_MINOR_VERSION);
#if defined(__clang__)
  const std::string compiler = "clang " __clang_version__;
#elif defined(__GNUC__)
  const std::string compiler = "gcc " __VERSION__;
#else
  const std::string compiler = "unknown";
#endif
#ifdef NDEBUG
  const char* build = "release";
#else
  const char* build = "debug (times mean nothing)";
#endif
  return {{"stillpoint", STILLPOINT_VERSION},
          {"opencv", CV_VERSION},
          {"eigen", eigen},
          {"compiler", compiler},
          {"build", build}};
}

Json machine_json() {
  std::string cpu = "unknown";
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);)
    if (line.compare(0, 10, "model name") == 0) {
      cpu = line.substr(std::min(line.size(), line.find(':') + 2));
      break;
    }
  return {{"cpu", cpu}, {"threads", std::thread::hardware_concurrency()}};
}

double peak_memory_mb() {
  std::ifstream in("/proc/self/status");
  for (std::string line; std::getline(in, line);)
    if (line.compare(0, 6, "VmHWM:") == 0) return std::stod(line.substr(6)) / 1024;
  return std::numeric_limits<double>::quiet_NaN();
}

void reset_peak_memory() { std::ofstream("/proc/self/clear_refs") << "5"; }

}  // namespace stillpoint::cli
