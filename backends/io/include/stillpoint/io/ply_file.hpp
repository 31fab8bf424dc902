// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "stillpoint/core/colored_point.hpp"
#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Writes colored points as binary little-endian PLY (x, y, z as 32-bit floats in metres; red,
/// green, blue as bytes), which CloudCompare, MeshLab and Open3D read. The bytes are the same on
/// every machine. Throws Error if writing fails. O(points); holds one block of points at a time.
inline void write_ply(const std::filesystem::path& path, const std::vector<ColoredPoint>& points) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file << "ply\nformat binary_little_endian 1.0\nelement vertex " << std::to_string(points.size())
       << "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
          "property uchar green\nproperty uchar blue\nend_header\n";
  std::string block;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      std::uint32_t bits;
      static_assert(sizeof(bits) == sizeof(float), "PLY floats have 32 bits");
      std::memcpy(&bits, &points[i].position[axis], sizeof(bits));
      for (int shift = 0; shift < 32; shift += 8) block += static_cast<char>(bits >> shift & 0xFF);
    }
    for (int channel = 2; channel >= 0; --channel)
      block += static_cast<char>(points[i].bgr[channel]);
    if (block.size() > 1 << 16 || i + 1 == points.size()) {
      file.write(block.data(), static_cast<std::streamsize>(block.size()));
      block.clear();
    }
  }
  file.close();
  detail::check(!file.fail(), [&] {
    return "PLY file " + path.string() +
           ": writing it failed; check that the folder exists, is writable and has space left";
  });
}

}  // namespace stillpoint
