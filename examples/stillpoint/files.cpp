// SPDX-License-Identifier: BSD-2-Clause
#include "files.hpp"

#include "stillpoint/io/text_file.hpp"

namespace stillpoint::cli {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

void write_json(const fs::path& path, const Json& json) {
  const fs::path part = path.string() + ".part";
  write_file(part, json.dump(1) + "\n", "result");
  std::error_code error;
  fs::rename(part, path, error);
  if (error) throw Error(path.string() + ": cannot be written: " + error.message());
}

void check_can_hold(const fs::path& file, const std::string& option) {
  const fs::path folder = file.parent_path();
  if (!folder.empty() && !fs::is_directory(folder))
    throw Error(option + ": expected a file in a folder that is there, found no folder " +
                folder.string());
}

void make_folder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error || !fs::is_directory(path))
    throw Error(path.string() + ": cannot be made a folder: " +
                (error ? error.message() : std::string("there is a file of this name")));
}

}  // namespace stillpoint::cli
