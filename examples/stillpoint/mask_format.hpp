// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/instance.hpp"
#include "stillpoint/io/tum_sequence.hpp"

namespace stillpoint::cli {

/// How masks are named and coded for those who read them: stillpoint (STEM.png, k = object k),
/// dynamic (STEM.png, 255 = dynamic), static (STEM.png, 255 = use), colmap (NAME.png with the
/// image's whole NAME, 0 = ignored), nerfstudio (as static, and transforms.json).
const std::vector<std::string>& mask_formats();

/// The file of an entry's mask.
std::filesystem::path mask_file(const std::string& format, const std::filesystem::path& out,
                                const SequenceEntry& entry);

/// The mask as the format codes it. `dynamic`: CV_8UC1, 255 = dynamic; `instances` for the format
/// stillpoint.
cv::Mat coded_mask(const std::string& format, const cv::Mat& dynamic,
                   const std::vector<Instance>& instances);

/// For nerfstudio: the transforms.json that belongs to these images (in their folder, or the one
/// above). Throws Error if there is none.
std::filesystem::path find_transforms(const std::filesystem::path& images);

/// Writes a copy of it to `out`, with mask_path in each frame, relative to the folder of the
/// original, where the copy belongs. Throws Error naming a frame that has no mask, as nerfstudio
/// wants one for each.
void write_transforms(const std::filesystem::path& transforms, const std::filesystem::path& out,
                      const TumSequence& sequence);

/// Writes an image by way of a temporary file, so that a killed program never leaves half of one.
void write_whole(const std::filesystem::path& file, const cv::Mat& image);

}  // namespace stillpoint::cli
