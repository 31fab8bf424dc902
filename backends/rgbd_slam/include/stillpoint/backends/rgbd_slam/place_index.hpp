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
/// vocabulary is needed. add(), remove() and query() cost O(descriptors) for a filled table; 80
/// bytes per descriptor.
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
    const auto p = static_cast<std::uint32_t>(place);
    // First, as query() looks up every entry there, also those of a call that ran out of memory.
    places_.resize(std::max<std::size_t>(places_.size(), p + 1));
    places_[p] = descriptors;
    for (std::uint32_t i = 0; i < descriptors.size(); ++i)
      for (Table& table : tables_) table.buckets[bucket(table, descriptors[i])].push_back({p, i});
  }

  /// Takes a place out.
  void remove(int place) {
    const auto p = static_cast<std::uint32_t>(place);
    if (p >= places_.size()) return;
    for (const Descriptor& d : places_[p])
      for (Table& table : tables_) {
        std::vector<Entry>& entries = table.buckets[bucket(table, d)];
        entries.erase(std::remove_if(entries.begin(), entries.end(),
                                     [&](const Entry& e) { return e.place == p; }),
                      entries.end());
      }
    std::vector<Descriptor>().swap(places_[p]);
  }

  /// Places by the number of descriptors that found one of theirs within `max_distance` bits; most
  /// votes first, then lower numbers.
  std::vector<Vote> query(const std::vector<Descriptor>& descriptors, int max_distance = 45) const {
    std::vector<int> votes(places_.size(), 0), voted(places_.size(), -1);
    for (std::size_t i = 0; i < descriptors.size(); ++i)
      for (const Table& table : tables_)
        for (const Entry& e : table.buckets[bucket(table, descriptors[i])]) {
          if (voted[e.place] == static_cast<int>(i)) continue;
          if (hamming_distance(descriptors[i], places_[e.place][e.index]) > max_distance) continue;
          voted[e.place] = static_cast<int>(i);
          ++votes[e.place];
        }
    std::vector<Vote> result;
    for (std::size_t p = 0; p < votes.size(); ++p)
      if (votes[p] > 0) result.push_back({static_cast<int>(p), votes[p]});
    std::stable_sort(result.begin(), result.end(),
                     [](const Vote& a, const Vote& b) { return a.votes > b.votes; });
    return result;
  }

  /// Descriptors of all places. O(places).
  std::size_t size() const {
    std::size_t n = 0;
    for (const auto& place : places_) n += place.size();
    return n;
  }

 private:
  static constexpr int kTables = 6, kBits = 14;
  struct Entry {
    std::uint32_t place, index;
  };
  struct Table {
    std::array<std::uint8_t, kBits> bits{};
    std::vector<std::vector<Entry>> buckets;
  };

  static std::size_t bucket(const Table& table, const Descriptor& d) {
    std::size_t b = 0;
    for (const std::uint8_t bit : table.bits) b = b << 1 | (d[bit >> 6] >> (bit & 63) & 1);
    return b;
  }

  std::vector<Table> tables_;
  std::vector<std::vector<Descriptor>> places_;
};

}  // namespace stillpoint::rgbd_slam
