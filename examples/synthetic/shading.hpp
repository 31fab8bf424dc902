// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <vector>

#include "synthetic/rasterizer.hpp"

namespace stillpoint::synthetic {

/// Colors of what a Rasterizer found: texture times light, summed in linear light
/// (displayed = sqrt(light), so that decoding and encoding are exact). About 10 ns per pixel.
class Shader {
 public:
  Shader() {
    for (int i = 0; i < 256; ++i) linear_[i] = static_cast<float>(i * i) * (1.0f / 65025.0f);
  }

  /// Adds the image's light, times `weight`, to `sum` (3 floats per pixel: blue, green, red).
  /// `dither` of [0, 1) chooses between texture levels, so that several passes blend them.
  void add(const Rasterizer& raster, float weight, float dither, std::vector<float>& sum) const;

 private:
  static constexpr int kChunk = 16;

  void put(float* out, std::uint32_t texel, const std::array<float, 3>& tint, float light) const {
    out[0] += linear_[texel & 255] * tint[2] * light;
    out[1] += linear_[texel >> 8 & 255] * tint[1] * light;
    out[2] += linear_[texel >> 16 & 255] * tint[0] * light;
  }

  static int level_for(const Texture& texture, float texels_per_pixel, float dither) {
    const float wanted = rough_log2(std::max(texels_per_pixel, 1e-3f)) - 0.6f + dither;
    return wanted <= 0 ? 0 : std::min(texture.level_count() - 1, static_cast<int>(wanted));
  }

  void add_quad(const Rasterizer& raster, int id, int begin, int end, int y, float weight,
                float dither, float* row) const;

  /// One whole repetition, so that the half texel that a level is moved by stays positive.
  static float border(int side) { return static_cast<float>(side); }
  static float clamp(float x) { return x < 0 ? 0 : x > 1 ? 1 : x; }

  /// Texels per pixel: the wider direction, but at most five times the narrower one.
  static float footprint(const Quad& quad, const Rasterizer::Plane& plane, int x, int y);

  static float shadow(const Rasterizer& raster, const Quad& quad, float u, float v);

  void add_part(const Rasterizer& raster, int id, int begin, int end, int y, float weight,
                float dither, float* row) const;

  float linear_[256];
};

}  // namespace stillpoint::synthetic
