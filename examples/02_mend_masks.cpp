// SPDX-License-Identifier: BSD-2-Clause
//
// Mends a folder of masks: what a network missed for some frames, wholly or in part, is put back.
// Uses the compensator alone (paper section 3.1), without depth fusion, keypoints or tracking.
//
// Usage: 02_mend_masks SEQUENCE MASKS OUT    (MASKS, OUT: one STEM.png per color file STEM.jpg)

#include <filesystem>
#include <iostream>
#include <stillpoint/backends/mask_files.hpp>
#include <stillpoint/io/mask_folder.hpp>
#include <stillpoint/io/tum_sequence.hpp>
#include <stillpoint/segmentation/segmentation_compensator.hpp>

int main(int argc, char** argv) try {
  if (argc != 4) {
    std::cerr << "usage: " << argv[0] << " SEQUENCE MASKS OUT\n";
    return 2;
  }
  const stillpoint::TumSequence sequence(argv[1]);
  stillpoint::MaskFilesSegmenter masks(argv[2], stillpoint::frame_names(sequence));
  std::filesystem::create_directories(argv[3]);

  stillpoint::SegmentationCompensator compensator;
  int restored = 0;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const stillpoint::RgbdFrame frame = sequence.load(i);
    // A frame without a file gets the masks of all remembered people, carried along.
    const stillpoint::Segmentation& mended = compensator.compensate(frame, masks.segment(frame));
    stillpoint::write_labels(argv[3], sequence.entry(i).stem, mended.instances, frame.color.size());
    restored += compensator.restored();
  }
  std::cout << sequence.size() << " masks written, " << restored << " objects put back\n";
} catch (const stillpoint::Error& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
