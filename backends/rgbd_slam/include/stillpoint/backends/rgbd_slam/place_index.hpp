// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "stillpoint/backends/rgbd_slam/descriptor.hpp"
#include "stillpoint/backends/rgbd_slam/ids.hpp"
#include "stillpoint/core/random.hpp"

namespace stillpoint::rgbd_slam {

/// Finds the keyframes that look like a list of binary descriptors.
///
/// Locality-sensitive hashing: each table reads 14 fixed bits of a descriptor as the number of a
/// bucket, so that near descriptors likely share a bucket in one of the tables. Those in the same
/// bucket are compared in full, and each described keypoint gives one vote to a keyframe. No
/// vocabulary is needed. add(), remove() and query() cost O(descriptors) for a filled table; 80
/// bytes per descriptor.
class PlaceIndex {
 public:
  struct Vote {
    KeyframeId place;
    int votes;
  };

  PlaceIndex() {
    RandomGenerator random(0x5eed);  // the same tables on every machine
    for (Table& table : tables_) {
      table.buckets.resize(1u << kBits);
      for (auto& bit : table.bits) bit = static_cast<std::uint8_t>(random.next() >> 56);
    }
  }

  void add(KeyframeId place, const std::vector<Descriptor>& descriptors) {
    if (places_.size() <= place.index()) places_.resize(place.index() + 1);
    places_[place.index()] = descriptors;
    for (std::uint32_t i = 0; i < descriptors.size(); ++i)
      for (Table& table : tables_)
        table.buckets[table.bucket_of(descriptors[i])].push_back({place, i});
  }

  void remove(KeyframeId place) {
    if (places_.size() <= place.index()) return;
    for (const Descriptor& d : places_[place.index()])
      for (Table& table : tables_) {
        std::vector<Entry>& entries = table.buckets[table.bucket_of(d)];
        entries.erase(std::remove_if(entries.begin(), entries.end(),
                                     [&](const Entry& e) { return e.place == place; }),
                      entries.end());
      }
    places_[place.index()] = {};
  }

  /// Keyframes by the number of descriptors that found one of theirs within `max_distance` bits;
  /// most votes first, then the oldest.
  std::vector<Vote> query(const std::vector<Descriptor>& descriptors, int max_distance = 45) const {
    std::vector<int> votes(places_.size(), 0);
    std::vector<std::size_t> last_voter(places_.size(), descriptors.size());
    for (std::size_t i = 0; i < descriptors.size(); ++i)
      for (const Table& table : tables_)
        for (const auto& [place, index] : table.buckets[table.bucket_of(descriptors[i])]) {
          const std::size_t p = place.index();
          if (last_voter[p] == i ||
              hamming_distance(descriptors[i], places_[p][index]) > max_distance)
            continue;
          last_voter[p] = i;
          ++votes[p];
        }
    std::vector<Vote> result;
    for (std::size_t p = 0; p < votes.size(); ++p)
      if (votes[p] > 0) result.push_back({KeyframeId(p), votes[p]});
    std::stable_sort(result.begin(), result.end(),
                     [](const Vote& a, const Vote& b) { return a.votes > b.votes; });
    return result;
  }

 private:
  static constexpr int kTables = 6, kBits = 14;
  struct Entry {
    KeyframeId place;
    std::uint32_t index;
  };
  struct Table {
    std::array<std::uint8_t, kBits> bits;
    std::vector<std::vector<Entry>> buckets;

    std::size_t bucket_of(const Descriptor& d) const {
      std::size_t bucket = 0;
      for (const std::uint8_t bit : bits) bucket = bucket << 1 | (d[bit / 8u] >> bit % 8 & 1u);
      return bucket;
    }
  };

  std::array<Table, kTables> tables_;
  std::vector<std::vector<Descriptor>> places_;  // by keyframe
};

}  // namespace stillpoint::rgbd_slam
