// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace stillpoint {

/// The 80 classes of COCO, in the order of most networks.
inline std::vector<std::string> coco_class_names() {
  return {"person",        "bicycle",      "car",
          "motorcycle",    "airplane",     "bus",
          "train",         "truck",        "boat",
          "traffic light", "fire hydrant", "stop sign",
          "parking meter", "bench",        "bird",
          "cat",           "dog",          "horse",
          "sheep",         "cow",          "elephant",
          "bear",          "zebra",        "giraffe",
          "backpack",      "umbrella",     "handbag",
          "tie",           "suitcase",     "frisbee",
          "skis",          "snowboard",    "sports ball",
          "kite",          "baseball bat", "baseball glove",
          "skateboard",    "surfboard",    "tennis racket",
          "bottle",        "wine glass",   "cup",
          "fork",          "knife",        "spoon",
          "bowl",          "banana",       "apple",
          "sandwich",      "orange",       "broccoli",
          "carrot",        "hot dog",      "pizza",
          "donut",         "cake",         "chair",
          "couch",         "potted plant", "bed",
          "dining table",  "toilet",       "tv",
          "laptop",        "mouse",        "remote",
          "keyboard",      "cell phone",   "microwave",
          "oven",          "toaster",      "sink",
          "refrigerator",  "book",         "clock",
          "vase",          "scissors",     "teddy bear",
          "hair drier",    "toothbrush"};
}

/// The 90 numbers of COCO's own annotations, of which ten have no class ("unused"): TensorFlow's
/// detection graphs count so.
inline std::vector<std::string> coco_annotation_names() {
  std::vector<std::string> names;
  const std::vector<std::string> classes = coco_class_names();
  std::size_t next = 0;
  for (int id = 1; id <= 90; ++id) {
    bool used = true;
    for (const int gap : {12, 26, 29, 30, 45, 66, 68, 69, 71, 83}) used = used && id != gap;
    names.push_back(used ? classes[next++] : "unused");
  }
  return names;
}

}  // namespace stillpoint
