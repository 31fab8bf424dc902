// SPDX-License-Identifier: BSD-2-Clause
//
// Drives the built program as a user would: exit codes, messages, files.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace stillpoint {

namespace fs = std::filesystem;
using Json = nlohmann::json;

inline std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

inline Json json_of(const fs::path& path) { return Json::parse(text_of(path)); }
/// The rows of a bench's table. By value: a loop over a part of a temporary would read freed
/// memory.
inline Json rows_of(const fs::path& folder) {
  Json rows = json_of(folder / "results.json").at("rows");
  EXPECT_FALSE(rows.empty()) << folder;
  return rows;
}

inline std::size_t files_in(const fs::path& folder, const std::string& ending) {
  std::size_t n = 0;
  for (const auto& entry : fs::directory_iterator(folder)) n += entry.path().extension() == ending;
  return n;
}

inline long lines_of(const std::string& text) { return std::count(text.begin(), text.end(), '\n'); }

struct Result {
  int code = -1;
  std::string out, err;
};

class Cli : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new fs::path(fs::temp_directory_path() /
                           ("stillpoint_cli_test_" + std::to_string(getpid())));
    fs::remove_all(*folder_);
    fs::create_directories(*folder_);
    const Result made =
        run("synth walk --motion xyz --people 2 --frames 12 --size 320x240 --shutter-ms 10");
    ASSERT_EQ(made.code, 0) << made.err;
  }
  static void TearDownTestSuite() {
    std::error_code ignored;
    fs::remove_all(*folder_, ignored);
    delete folder_;
  }

  /// Runs the program in the test's folder with arguments as written in a shell.
  static Result run(const std::string& arguments) {
    const fs::path out = *folder_ / "stdout.txt", err = *folder_ / "stderr.txt";
    const std::string command = "cd '" + folder_->string() + "' && '" STILLPOINT_CLI "' " +
                                arguments + " >'" + out.string() + "' 2>'" + err.string() + "'";
    const int status = std::system(command.c_str());
    Result result;
    result.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    result.out = text_of(out);
    result.err = text_of(err);
    return result;
  }

  /// One line "stillpoint: ..." on stderr with `words`, and the exit code.
  static void expect_error(const std::string& arguments, int code, const std::string& words) {
    const Result r = run(arguments);
    EXPECT_EQ(r.code, code) << arguments << "\n" << r.err;
    EXPECT_EQ(r.err.rfind("stillpoint: "), 0U) << "the name once: " << arguments << "\n" << r.err;
    EXPECT_EQ(lines_of(r.err), 1) << arguments << "\n" << r.err;
    EXPECT_NE(r.err.find(words), std::string::npos) << arguments << "\n" << r.err;
  }

  static fs::path path(const std::string& name) { return *folder_ / name; }

  /// A copy of the sequence whose frames from `begin` on, before `end`, are of one gray.
  static void copy_with_blind_frames(const std::string& name, std::size_t begin, std::size_t end,
                                     int gray) {
    fs::copy(path("walk"), path(name), fs::copy_options::recursive);
    std::vector<fs::path> images;
    for (const auto& entry : fs::directory_iterator(path(name) / "rgb"))
      images.push_back(entry.path());
    std::sort(images.begin(), images.end());
    ASSERT_LE(end, images.size());
    for (std::size_t i = begin; i < end; ++i)
      cv::imwrite(images[i].string(), cv::Mat(240, 320, CV_8UC3, cv::Scalar::all(gray)));
  }

  inline static fs::path* folder_ = nullptr;
};

}  // namespace stillpoint
