// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/io/text_file.hpp"

namespace stillpoint {
namespace detail {

/// Largest image that is read; a broken header must not ask for gigabytes.
constexpr std::uint64_t kMaxImagePixels = 100'000'000;

inline std::uint32_t big_endian(const std::string& bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i)
    value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

inline std::string size_problem(std::uint64_t width, std::uint64_t height) {
  if (width > 0 && height > 0 && width < 65536 && height < 65536 &&
      width * height <= kMaxImagePixels)
    return {};
  return "a size of " + std::to_string(width) + "x" + std::to_string(height) + " in its header";
}

/// Walks the chunks of a PNG. Returns what is wrong with it, or nothing.
inline std::string png_problem(const std::string& bytes) {
  std::size_t at = 8;
  std::uint64_t data_bytes = 0, row_bits = 0, height = 0;
  while (at + 12 <= bytes.size()) {
    const std::uint64_t length = big_endian(bytes, at, 4);
    const std::string type = bytes.substr(at + 4, 4);
    if (length > bytes.size() - at - 12) break;
    if (at == 8) {
      if (type != "IHDR" || length != 13) return "a PNG without a header";
      const std::uint64_t width = big_endian(bytes, at + 8, 4);
      height = big_endian(bytes, at + 12, 4);
      const std::string problem = size_problem(width, height);
      if (!problem.empty()) return problem;
      const unsigned bits = big_endian(bytes, at + 16, 1), color = big_endian(bytes, at + 17, 1);
      const unsigned channels = color == 2 ? 3 : color == 4 ? 2 : color == 6 ? 4 : 1;
      row_bits = width * bits * channels;
    }
    if (type == "IDAT") data_bytes += length;
    if (type == "IEND") {
      // zlib packs at most about 1032 to 1: with less data the pixels cannot all be there.
      if (data_bytes * 1040 + 1040 < row_bits / 8 * height) return "too little data for its size";
      return {};
    }
    at += 12 + static_cast<std::size_t>(length);
  }
  return "a truncated PNG of " + std::to_string(bytes.size()) + " bytes (no end mark)";
}

/// Walks the segments of a JPEG. Returns what is wrong with it, or nothing. Needed because libjpeg
/// fills the missing part of a truncated image with gray and only warns.
inline std::string jpeg_problem(const std::string& bytes) {
  std::size_t at = 2;
  bool seen_size = false, seen_scan = false;
  while (at + 1 < bytes.size()) {
    if (static_cast<unsigned char>(bytes[at]) != 0xFF) return "a JPEG with a broken segment";
    const unsigned marker = static_cast<unsigned char>(bytes[at + 1]);
    if (marker == 0xFF) {  // fill byte
      ++at;
      continue;
    }
    if (marker == 0xD9) return seen_size && seen_scan ? "" : "a JPEG without an image in it";
    at += 2;
    if (marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8)) continue;
    if (at + 2 > bytes.size()) break;
    const std::size_t length = big_endian(bytes, at, 2);
    if (length < 2) return "a JPEG with a broken segment";
    if (length > bytes.size() - at) break;
    const bool is_frame =
        marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_frame && length >= 8) {
      const std::uint64_t height = big_endian(bytes, at + 3, 2);
      const std::uint64_t width = big_endian(bytes, at + 5, 2);
      const std::string problem = size_problem(width, height);
      if (!problem.empty()) return problem;
      // Each block of 8x8 takes at least a bit.
      if (width * height / 1024 > bytes.size()) return "too little data for its size";
      seen_size = true;
    }
    at += length;
    if (marker != 0xDA) continue;
    // Coded data: up to the next marker that is neither a stuffed zero nor a restart.
    seen_scan = true;
    while (at + 1 < bytes.size()) {
      const void* found = std::memchr(bytes.data() + at, 0xFF, bytes.size() - at - 1);
      if (!found) {
        at = bytes.size();
        break;
      }
      at = static_cast<std::size_t>(static_cast<const char*>(found) - bytes.data());
      const unsigned next = static_cast<unsigned char>(bytes[at + 1]);
      if (next != 0 && !(next >= 0xD0 && next <= 0xD7)) break;
      at += 2;
    }
  }
  return "a truncated JPEG of " + std::to_string(bytes.size()) + " bytes (no end mark)";
}

inline cv::Mat decode(const std::string& bytes, int flags) {
  try {
    const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8UC1,
                         const_cast<char*>(bytes.data()));
    return cv::imdecode(buffer, flags);
  } catch (const cv::Exception&) {
    return {};
  }
}

/// Reads a PNG or JPEG file. Throws Error if it is missing, of another format, truncated or
/// cannot be decoded; never returns an empty or half an image.
inline cv::Mat read_image(const std::filesystem::path& path, int flags, const std::string& what) {
  const std::string bytes = read_file(path, what);
  const auto begins = [&](const std::string& magic) {
    return bytes.compare(0, magic.size(), magic) == 0;
  };
  const bool png = begins("\x89PNG\r\n\x1A\n"), jpeg = begins("\xFF\xD8");
  std::string problem;
  if (bytes.empty())
    problem = "an empty file";
  else if (bytes.size() > (std::size_t{1} << 30))
    problem = "a file of over 1 GiB";
  else if (png)
    problem = png_problem(bytes);
  else if (jpeg)
    problem = jpeg_problem(bytes);
  else
    problem = "another kind of file";
  cv::Mat image;
  if (problem.empty()) {
    image = decode(bytes, flags);
    if (image.empty()) problem = "broken data";
  }
  check(problem.empty(), [&] {
    return what + " " + path.string() + ": expected a whole PNG or JPEG image, found " + problem +
           "; copy or write the file again";
  });
  return image;
}

}  // namespace detail

/// Reads a color image (PNG or JPEG) as CV_8UC3, BGR. A rotation note of the camera (EXIF) is not
/// applied: the depth image does not follow it. Throws Error as detail::read_image().
inline cv::Mat read_color(const std::filesystem::path& path) {
  return detail::read_image(path, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION, "color image");
}

/// Reads a depth image, a 16-bit gray PNG, as CV_16UC1 in stored units. Throws Error if it is of
/// another type, and as detail::read_image().
inline cv::Mat read_depth(const std::filesystem::path& path) {
  cv::Mat depth = detail::read_image(path, cv::IMREAD_UNCHANGED, "depth image");
  detail::check(depth.type() == CV_16UC1, [&] {
    return "depth image " + path.string() + ": expected one channel of 16 bits (CV_16UC1), found " +
           detail::type_text(depth) + "; write depth as a 16-bit gray PNG";
  });
  return depth;
}

/// Writes an 8-bit or 16-bit image; the format is that of the file's ending (.png, .jpg). Throws
/// Error if that fails. `parameters`: cv::imencode's, such as {cv::IMWRITE_JPEG_QUALITY, 95}.
inline void write_image(const std::filesystem::path& path, const cv::Mat& image,
                        const std::vector<int>& parameters = {}) {
  bool done = false;
  std::string reason;
  try {
    std::vector<uchar> bytes;
    done = !image.empty() && cv::imencode(path.extension().string(), image, bytes, parameters);
    if (done) write_file(path, std::string(bytes.begin(), bytes.end()), "image");
  } catch (const cv::Exception& e) {
    reason = e.err;
  }
  detail::check(done, [&] {
    return "image " + path.string() + ": cannot encode " +
           (image.empty() ? "an empty image" : detail::type_text(image)) + " as \"" +
           path.extension().string() + "\" " + reason;
  });
}

/// Old name; gone in the next version.
[[deprecated("use write_image()")]] inline void write_picture(
    const std::filesystem::path& path, const cv::Mat& image,
    const std::vector<int>& parameters = {}) {
  write_image(path, image, parameters);
}

}  // namespace stillpoint
