// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace stillpoint {

/// An output of a network, whatever ran it: dense 32-bit floats, last dimension fastest. Not owned.
struct TensorView {
  std::string name;
  std::vector<int> shape;
  const float* data = nullptr;

  std::size_t size() const {
    std::size_t n = 1;
    for (const int d : shape) n *= static_cast<std::size_t>(d);
    return n;
  }
  /// Length of dimension `d`; 0 if there is none.
  int dim(std::size_t d) const { return d < shape.size() ? shape[d] : 0; }
};

/// "1x80x40x40".
inline std::string shape_text(const std::vector<int>& shape) {
  std::string text;
  for (const int d : shape) text += (text.empty() ? "" : "x") + std::to_string(d);
  return text.empty() ? "scalar" : text;
}

/// "scores 1x100x80, masks 1x100x640x640", for messages.
inline std::string tensors_text(const std::vector<TensorView>& tensors) {
  std::string text;
  for (const TensorView& t : tensors)
    text += (text.empty() ? "" : ", ") + t.name + " " + shape_text(t.shape);
  return text.empty() ? "none" : text;
}

/// The tensor of that name; null if there is none.
inline const TensorView* find_tensor(const std::vector<TensorView>& tensors,
                                     const std::string& name) {
  for (const TensorView& t : tensors)
    if (t.name == name) return &t;
  return nullptr;
}

}  // namespace stillpoint
