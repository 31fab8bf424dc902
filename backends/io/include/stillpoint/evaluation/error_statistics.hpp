// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace stillpoint {

/// Root mean square, standard deviation (of the population, as numpy's std), mean, median, smallest
/// and largest of some errors; all NaN when there are none.
struct ErrorStatistics {
  double rmse = std::numeric_limits<double>::quiet_NaN();
  double sd = rmse, mean = rmse, median = rmse, min = rmse, max = rmse;
  std::size_t count = 0;
};

/// Computes the statistics of a list of errors. O(n log n).
inline ErrorStatistics error_statistics(std::vector<double> errors) {
  ErrorStatistics s;
  s.count = errors.size();
  if (errors.empty()) return s;
  std::sort(errors.begin(), errors.end());
  const double n = static_cast<double>(errors.size());
  double sum = 0, squares = 0, deviations = 0;
  for (double e : errors) sum += e, squares += e * e;
  s.mean = sum / n;
  for (double e : errors) deviations += (e - s.mean) * (e - s.mean);
  s.rmse = std::sqrt(squares / n);
  s.sd = std::sqrt(deviations / n);
  const std::size_t half = errors.size() / 2;
  s.median = errors.size() % 2 ? errors[half] : (errors[half - 1] + errors[half]) / 2;
  s.min = errors.front();
  s.max = errors.back();
  return s;
}

}  // namespace stillpoint
