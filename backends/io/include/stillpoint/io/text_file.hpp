// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <locale>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Reads a whole file as bytes. `what` names its role in the message ("depth list").
/// Throws Error if it is missing, a folder, or unreadable. O(bytes).
inline std::string read_file(const std::filesystem::path& path, const std::string& what) {
  std::error_code ignored;
  const bool is_folder = std::filesystem::is_directory(path, ignored);
  const bool there = std::filesystem::exists(path, ignored);
  std::ifstream file;
  if (there && !is_folder) file.open(path, std::ios::binary);
  detail::check(file.is_open(), [&] {
    return what + " " + path.string() + ": expected a readable file, found " +
           (is_folder ? "a folder"
            : there   ? "one that cannot be opened; check its permissions"
                      : "no such file; check the path");
  });
  std::string bytes;
  std::vector<char> block(1 << 16);
  while (file.read(block.data(), static_cast<std::streamsize>(block.size())) || file.gcount() > 0)
    bytes.append(block.data(), static_cast<std::size_t>(file.gcount()));
  detail::check(!file.bad(), [&] { return what + " " + path.string() + ": reading it failed"; });
  return bytes;
}

/// Writes a whole file, replacing an older one. Throws Error if that fails (no folder, disk full).
inline void write_file(const std::filesystem::path& path, const std::string& bytes,
                       const std::string& what) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  detail::check(!file.fail(), [&] {
    return what + " " + path.string() +
           ": writing it failed; check that the folder exists, is writable and has space left";
  });
}

namespace detail {

/// A line of a text file that is neither empty nor a comment.
struct TextLine {
  int number;
  std::string text;
};

inline std::string trimmed(const std::string& s) {
  const auto begin = s.find_first_not_of(" \t\r\n\f\v");
  if (begin == std::string::npos) return {};
  return s.substr(begin, s.find_last_not_of(" \t\r\n\f\v") - begin + 1);
}

/// Splits into trimmed lines, leaving out empty ones and those that begin with '#'. Accepts
/// Windows line ends and a byte order mark.
inline std::vector<TextLine> text_lines(const std::string& bytes) {
  std::vector<TextLine> lines;
  std::size_t begin = bytes.compare(0, 3, "\xEF\xBB\xBF") == 0 ? 3 : 0;
  for (int number = 1; begin < bytes.size(); ++number) {
    const std::size_t end = std::min(bytes.find('\n', begin), bytes.size());
    std::string text = trimmed(bytes.substr(begin, end - begin));
    if (!text.empty() && text[0] != '#') lines.push_back({number, std::move(text)});
    begin = end + 1;
  }
  return lines;
}

inline std::vector<std::string> words(const std::string& line) {
  std::istringstream stream(line);
  stream.imbue(std::locale::classic());
  return {std::istream_iterator<std::string>(stream), std::istream_iterator<std::string>()};
}

/// A finite number, written with a point whatever the host's locale; nothing else in the word.
inline std::optional<double> parse_number(const std::string& word) {
  std::istringstream stream(word);
  stream.imbue(std::locale::classic());
  double value = 0;
  stream >> std::noskipws >> value;
  if (stream.fail() || stream.peek() != std::istringstream::traits_type::eof() ||
      !std::isfinite(value))
    return std::nullopt;
  return value;
}

/// Shortens text found in a broken file so that a message stays readable and printable.
inline std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (char c : text.substr(0, 60)) out += c >= ' ' && c < 127 ? c : '?';
  return out + (text.size() > 60 ? "...\"" : "\"");
}

/// Seconds with six decimals, as TUM files write them.
inline std::string seconds_text(double seconds) {
  std::ostringstream stream;
  stream.imbue(std::locale::classic());
  stream.setf(std::ios::fixed);
  stream.precision(6);
  stream << seconds;
  return stream.str();
}

/// Parses a timestamp in seconds. `where` is "file FILE, line N".
inline double parse_timestamp(const std::string& word, const std::string& where) {
  const std::optional<double> time = parse_number(word);
  check(time && *time >= 0 && *time < 1e11, [&] {
    return where + ": expected a timestamp in seconds, not negative, found " + quoted(word) +
           (time && *time >= 1e11 ? "; nanoseconds? divide by 1e9" : "");
  });
  return *time;
}

/// Throws Error unless `time` comes after `last_time`.
inline void check_after(double last_time, int last_line, double time, int line,
                        const std::string& file) {
  check(time > last_time, [&] {
    return file + ", line " + std::to_string(line) + ": expected a timestamp after " +
           seconds_text(last_time) + " of line " + std::to_string(last_line) + ", found " +
           seconds_text(time) + (time == last_time ? " again" : ", out of order") +
           "; `sort -n -u -k1,1` mends such a file";
  });
}

}  // namespace detail
}  // namespace stillpoint
