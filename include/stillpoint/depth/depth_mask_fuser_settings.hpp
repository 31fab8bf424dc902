// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "stillpoint/core/blur.hpp"
#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Settings of DepthMaskFuser (paper section 3.2).
struct DepthMaskFuserSettings {
  enum class Method {
    kPaper,     ///< mean of the box +- range_m, every pixel of the box in the range
    kConnected  ///< range of the instance's own mask, connected growth, floor known
  };
  Method method = Method::kConnected;
  /// Side of a sampling cell in an image 640 wide, more in a wider one; one depth sample is drawn
  /// in each.
  int cell_px = 5;
  /// Alpha of the paper: half of the "human value range". For kConnected: how far depth may reach
  /// beyond the range seen on the mask.
  float range_m = 0.25f;
  /// How far the mask may grow over connected depth, from its own rim.
  float growth_m = 0.3f;
  /// Half of the side of the dilation square, minus a half: 10 means (2 * 10 + 1)^2.
  int dilation_px = 10;
  /// An instance is dilated by at least this share of its blur: half of it is how far its outline
  /// is smeared to either side, 0: all alike. At most kMostBlurDilationPx more than dilation_px.
  double dilation_per_blur_px = 0.5;
  static constexpr double kMostBlurDilationPx = 10;
  /// Seed of the samples' places.
  std::uint64_t seed = 1;

  /// The literal method; alpha and the cells are not given there.
  static DepthMaskFuserSettings paper() {
    DepthMaskFuserSettings settings;
    settings.method = Method::kPaper;
    settings.cell_px = 8;
    settings.range_m = 0.3f;
    settings.dilation_per_blur_px = 0;
    return settings;
  }

  /// Throws Error if a setting makes no sense.
  void check() const {
    const auto fail = [](const char* name, const char* expected, double found) {
      throw Error(std::string("DepthMaskFuserSettings.") + name + ": expected " + expected +
                  ", found " + std::to_string(found));
    };
    if (cell_px < 1 || cell_px > 64) fail("cell_px", "1 to 64", cell_px);
    if (!(range_m > 0 && range_m < 100)) fail("range_m", "0 to 100 m", range_m);
    if (!(growth_m >= 0 && growth_m < 100)) fail("growth_m", "0 to 100 m", growth_m);
    if (dilation_px < 0 || dilation_px > 100) fail("dilation_px", "0 to 100", dilation_px);
    if (!(dilation_per_blur_px >= 0 && dilation_per_blur_px <= 10))
      fail("dilation_per_blur_px", "0 to 10", dilation_per_blur_px);
  }
  /// Half of the side of the dilation square of an instance with that blur.
  int dilation_of(const Blur& blur) const {
    const double smeared_px = dilation_per_blur_px * blur.width_px() - dilation_px;
    return dilation_px +
           static_cast<int>(std::max(0.0, std::min(smeared_px, double{kMostBlurDilationPx})) + 0.5);
  }
};

}  // namespace stillpoint
