// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/random.hpp"
#include "stillpoint/evaluation/error_statistics.hpp"

namespace stillpoint {

/// From `low` to `high`; NaN where there is too little to say.
struct Interval {
  double low = std::numeric_limits<double>::quiet_NaN(), high = low;
};

/// How sure the median of a few runs is: the percentile bootstrap's interval of it. The values are
/// drawn again, with replacement, `samples` times; the interval holds the middle `confidence` of
/// the medians. Of five runs it is nearly their range; NaN of fewer than two.
///
/// The same seed gives the same interval on every machine. Throws Error for a confidence that is
/// not between 0 and 1, no samples, or values that are not finite. O(samples * n log n).
inline Interval median_interval(const std::vector<double>& values, double confidence = 0.95,
                                int samples = 2000, std::uint64_t seed = 1) {
  detail::check(confidence > 0 && confidence < 1 && samples > 0, [&] {
    return "median_interval: expected a confidence between 0 and 1 and at least 1 sample, found " +
           std::to_string(confidence) + " and " + std::to_string(samples);
  });
  for (double v : values)
    detail::check(std::isfinite(v), [] {
      return std::string("median_interval: expected finite values, found NaN or infinity");
    });
  if (values.size() < 2) return {};
  RandomGenerator random(seed);
  std::vector<double> medians, drawn(values.size());
  for (int s = 0; s < samples; ++s) {
    for (double& v : drawn) v = values[random.below(values.size())];
    medians.push_back(error_statistics(drawn).median);
  }
  std::sort(medians.begin(), medians.end());
  const auto at = [&](double share) {
    const double last = static_cast<double>(medians.size() - 1);
    return medians[static_cast<std::size_t>(std::lround(share * last))];
  };
  return {at((1 - confidence) / 2), at((1 + confidence) / 2)};
}

}  // namespace stillpoint
