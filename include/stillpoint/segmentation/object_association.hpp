// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/instance.hpp"
#include "stillpoint/segmentation/object_locator.hpp"
#include "stillpoint/segmentation/remembered_object.hpp"

namespace stillpoint {

/// Which instance of a frame shows which remembered object: at most one each. Both are named by
/// their index; -1 is none.
class ObjectAssociation {
 public:
  /// Pairs them anew: an instance goes to the object of whose predicted points it holds the largest
  /// share, at least a quarter. `size` is the image's. O(objects x instances).
  void find(const std::vector<RememberedObject>& objects, const std::vector<Instance>& instances,
            const cv::Size& size, const ObjectLocator& locator) {
    object_of_.assign(instances.size(), -1);
    instance_of_.assign(objects.size(), -1);
    pairs_.clear();
    for (std::size_t j = 0; j < objects.size(); ++j) {
      const cv::Rect box = objects[j].predicted_box(size);
      for (std::size_t i = 0; i < instances.size(); ++i) {
        if ((box & instances[i].box).empty()) continue;
        const double share = locator.share_in(objects[j], instances[i]);
        if (share >= kLeastShare) pairs_.push_back({share, j, i});
      }
    }
    std::sort(pairs_.begin(), pairs_.end(), [](const Pair& a, const Pair& b) {
      if (a.share != b.share) return a.share > b.share;
      return a.object != b.object ? a.object < b.object : a.instance < b.instance;
    });
    for (const Pair& pair : pairs_)
      if (instance_of(pair.object) < 0 && object_of(pair.instance) < 0)
        set(pair.object, pair.instance);
  }

  /// Pairs one object with one instance; either may be new.
  void set(std::size_t object, std::size_t instance) {
    if (instance >= object_of_.size()) object_of_.resize(instance + 1, -1);
    if (object >= instance_of_.size()) instance_of_.resize(object + 1, -1);
    object_of_[instance] = static_cast<int>(object);
    instance_of_[object] = static_cast<int>(instance);
  }

  int object_of(std::size_t instance) const { return object_of_[instance]; }
  int instance_of(std::size_t object) const { return instance_of_[object]; }
  /// How many instances there are.
  std::size_t instances() const { return object_of_.size(); }

 private:
  static constexpr double kLeastShare = 0.25;

  struct Pair {
    double share;
    std::size_t object, instance;
  };

  std::vector<int> object_of_, instance_of_;
  std::vector<Pair> pairs_;
};

}  // namespace stillpoint
