// SPDX-License-Identifier: BSD-2-Clause
#include "mask_format.hpp"

#include <nlohmann/json.hpp>
#include <set>

#include "files.hpp"
#include "stillpoint/io/mask_folder.hpp"
#include "stillpoint/io/text_file.hpp"

namespace stillpoint::cli {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

const std::vector<std::string>& mask_formats() {
  static const std::vector<std::string> formats{"stillpoint", "dynamic", "static", "colmap",
                                                "nerfstudio"};
  return formats;
}

fs::path mask_file(const std::string& format, const fs::path& out, const SequenceEntry& entry) {
  if (format == "colmap") return out / (entry.color_path.filename().string() + ".png");
  return mask_path(out, entry.stem);
}

cv::Mat coded_mask(const std::string& format, const cv::Mat& dynamic,
                   const std::vector<Instance>& instances) {
  if (format == "stillpoint") return labels_from_instances(instances, dynamic.size());
  if (format == "dynamic") return dynamic;
  return ~dynamic;
}

fs::path find_transforms(const fs::path& images) {
  for (const fs::path& folder : {images, fs::absolute(images).lexically_normal().parent_path()})
    if (fs::exists(folder / "transforms.json")) return folder / "transforms.json";
  throw Error("--format nerfstudio: expected transforms.json (of ns-process-data) in " +
              images.string() + " or the folder above, found none");
}

void write_transforms(const fs::path& transforms, const fs::path& out,
                      const TumSequence& sequence) {
  const std::string name = "transforms file " + transforms.string();
  Json json = Json::parse(read_file(transforms, "transforms file"), nullptr, false);
  if (!json.is_object() || !json.contains("frames") || !json["frames"].is_array())
    throw Error(name + ": expected JSON with a list of frames, found something else");
  std::set<std::string> stems;
  for (const SequenceEntry& entry : sequence.entries())
    if (fs::exists(mask_path(out, entry.stem))) stems.insert(entry.stem);
  for (Json& frame : json["frames"]) {
    const std::string file = frame.value("file_path", std::string());
    const std::string stem = fs::path(file).stem().string();
    if (stems.count(stem) == 0)
      throw Error(name + ": expected a mask for each frame, as nerfstudio does, found none for " +
                  detail::quoted(file));
    frame["mask_path"] =
        fs::relative(mask_path(out, stem), fs::absolute(transforms).parent_path()).generic_string();
  }
  write_json(out / "transforms.json", json);
}

void write_whole(const fs::path& file, const cv::Mat& image) {
  const fs::path part = file.parent_path() / (".part" + file.extension().string());
  write_image(part, image);
  fs::rename(part, file);
}

}  // namespace stillpoint::cli
