// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "stillpoint/core/error.hpp"

/// A folder that is there for one test and removed after it.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "stillpoint_XXXXXX").string();
    if (!mkdtemp(&name[0])) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

  /// Writes a file, making the folders above it, and returns its path.
  std::filesystem::path write(const std::string& name, const std::string& bytes) const {
    std::filesystem::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name, std::ios::binary) << bytes;
    return path_ / name;
  }

 private:
  std::filesystem::path path_;
};

/// The message of the stillpoint::Error that `action` throws; empty if it throws none.
template <class Action>
std::string error_of(Action&& action) {
  try {
    action();
  } catch (const stillpoint::Error& e) {
    return e.what();
  }
  return {};
}

/// Expects an Error whose message holds each of these texts.
#define EXPECT_ERROR(action, ...)                                           \
  do {                                                                      \
    const std::string message_ = error_of([&] { action; });                 \
    EXPECT_FALSE(message_.empty()) << "no stillpoint::Error from " #action; \
    for (const std::string& part_ : {__VA_ARGS__})                          \
      EXPECT_NE(message_.find(part_), std::string::npos)                    \
          << "expected \"" << part_ << "\" in: " << message_;               \
  } while (false)
