// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "stillpoint/backends/rgbd_slam/descriptor.hpp"
#include "stillpoint/core/random.hpp"

namespace stillpoint::rgbd_slam {

/// Finds the places (keyframes) that look like a list of binary descriptors.
///
/// Locality-sensitive hashing: each table reads 14 fixed bits of a descriptor as the number of a
/// bucket, so that near descriptors likely share a bucket in one of the tables. Those in the same
/// bucket are compared in full, and each described keypoint gives one vote to a place. No
/// vocabulary is needed. add() and query() cost O(descriptors) for a filled table; 60 bytes per
/// descriptor.
class PlaceIndex {
 public:
  struct Vote {
    int place = -1, votes = 0;
  };

  PlaceIndex() : tables_(kTables) {
    RandomGenerator random(0x5eed);  // the same tables on every machine
    for (Table& table : tables_) {
      table.buckets.resize(1u << kBits);
      for (auto& bit : table.bits) bit = static_cast<std::uint8_t>(random.next() >> 56);
    }
  }

  /// Adds a place; its number is the caller's.
  void add(int place, const std::vector<Descriptor>& descriptors) {
    // First, as query() looks up every entry's place here, also those of a call that ran out of
    // memory.
    alive_.resize(std::max(alive_.size(), static_cast<std::size_t>(place) + 1), 0);
    sizes_.resize(alive_.size(), 0);
    for (const Descriptor& d : descriptors) {
      const auto entry = static_cast<std::uint32_t>(entries_.size());
      entries_.push_back({d, place});
      for (Table& table : tables_) table.buckets[bucket(table, d)].push_back(entry);
    }
    alive_[static_cast<std::size_t>(place)] = 1;
    live_entries_ += descriptors.size();
    sizes_[static_cast<std::size_t>(place)] = descriptors.size();
  }

  /// Takes a place out.
  void remove(int place) {
    const auto p = static_cast<std::size_t>(place);
    if (place < 0 || p >= alive_.size() || !alive_[p]) return;
    alive_[p] = 0;
    live_entries_ -= sizes_[p];
    if (live_entries_ * 2 < entries_.size()) rebuild();
  }

  /// Places by the number of descriptors that found one of theirs within `max_distance` bits; most
  /// votes first, then lower numbers.
  std::vector<Vote> query(const std::vector<Descriptor>& descriptors, int max_distance = 45) const {
    std::vector<int> votes(alive_.size(), 0), voted(alive_.size(), -1);
    for (std::size_t i = 0; i < descriptors.size(); ++i)
      for (const Table& table : tables_)
        for (const std::uint32_t e : table.buckets[bucket(table, descriptors[i])]) {
          const Entry& entry = entries_[e];
          const auto place = static_cast<std::size_t>(entry.place);
          if (voted[place] == static_cast<int>(i) || !alive_[place]) continue;
          if (hamming_distance(descriptors[i], entry.descriptor) > max_distance) continue;
          voted[place] = static_cast<int>(i);
          ++votes[place];
        }
    std::vector<Vote> result;
    for (std::size_t p = 0; p < votes.size(); ++p)
      if (votes[p] > 0) result.push_back({static_cast<int>(p), votes[p]});
    std::stable_sort(result.begin(), result.end(),
                     [](const Vote& a, const Vote& b) { return a.votes > b.votes; });
    return result;
  }

  std::size_t size() const { return live_entries_; }

 private:
  static constexpr int kTables = 6, kBits = 14;
  struct Entry {
    Descriptor descriptor;
    int place;
  };
  struct Table {
    std::array<std::uint8_t, kBits> bits{};
    std::vector<std::vector<std::uint32_t>> buckets;
  };

  static std::size_t bucket(const Table& table, const Descriptor& d) {
    std::size_t b = 0;
    for (const std::uint8_t bit : table.bits) b = b << 1 | (d[bit >> 6] >> (bit & 63) & 1);
    return b;
  }

  void rebuild() {
    std::vector<Entry> old;
    old.swap(entries_);
    for (Table& table : tables_)
      for (auto& b : table.buckets) b.clear();
    for (const Entry& e : old) {
      if (!alive_[static_cast<std::size_t>(e.place)]) continue;
      const auto entry = static_cast<std::uint32_t>(entries_.size());
      entries_.push_back(e);
      for (Table& table : tables_) table.buckets[bucket(table, e.descriptor)].push_back(entry);
    }
  }

  std::vector<Table> tables_;
  std::vector<Entry> entries_;
  std::vector<char> alive_;
  std::vector<std::size_t> sizes_;
  std::size_t live_entries_ = 0;
};

}  // namespace stillpoint::rgbd_slam
