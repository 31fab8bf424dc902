// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "bench_plan.hpp"

namespace stillpoint::cli {

/// How jobs are done.
struct BenchRun {
  /// Folder for the results.
  std::filesystem::path out;
  /// Jobs at the same time.
  int parallel = 1;
  /// Do also what is done.
  bool fresh = false;
};

/// Does the jobs that are not done yet, some at a time, and says a line of each. Returns false if
/// one of them broke off.
bool run_jobs(const std::vector<BenchJob>& jobs, const BenchRun& options);

}  // namespace stillpoint::cli
