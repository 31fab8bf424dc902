// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <queue>
#include <string>
#include <tuple>
#include <vector>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Indices of two timestamps that belong together.
struct TimestampPair {
  std::size_t first = 0;
  std::size_t second = 0;
};

namespace detail {

// A timestamp of either list, in the order of time. Those not paired yet are linked.
struct TimestampNode {
  double time;
  bool is_second;
  std::size_t index;
  int previous, next;
};

inline void add_timestamps(const std::vector<double>& times, bool is_second,
                           std::vector<TimestampNode>& nodes) {
  for (std::size_t i = 0; i < times.size(); ++i) {
    check(std::isfinite(times[i]), [&] {
      return std::string("associate: ") + (is_second ? "second" : "first") + "[" +
             std::to_string(i) + "]: expected a timestamp in seconds, found " +
             std::to_string(times[i]);
    });
    nodes.push_back({times[i], is_second, i, -1, -1});
  }
}

// Both lists as one.
inline std::vector<TimestampNode> merge_timestamps(const std::vector<double>& first,
                                                   const std::vector<double>& second) {
  std::vector<TimestampNode> nodes;
  nodes.reserve(first.size() + second.size());
  add_timestamps(first, false, nodes);
  add_timestamps(second, true, nodes);
  std::sort(nodes.begin(), nodes.end(), [](const TimestampNode& a, const TimestampNode& b) {
    if (a.time != b.time) return a.time < b.time;
    return a.is_second != b.is_second ? b.is_second : a.index < b.index;
  });
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i].previous = static_cast<int>(i) - 1;
    nodes[i].next = i + 1 < nodes.size() ? static_cast<int>(i) + 1 : -1;
  }
  return nodes;
}

// Neighbors, one of each list. The least is paired first.
struct TimestampCandidate {
  double difference, time_first, time_second;
  int left, right;
  bool operator>(const TimestampCandidate& o) const {
    return std::tie(difference, time_first, time_second, left) >
           std::tie(o.difference, o.time_first, o.time_second, o.left);
  }
};

}  // namespace detail

/// Pairs two lists of timestamps (seconds, in any order) as the TUM benchmark's associate.py does:
/// the nearest pair first, each timestamp used once, only pairs less than `max_difference_s` apart.
///
/// Returns the pairs in the order of `first`'s time. Equally near pairs: the earlier first
/// timestamp wins, then the earlier second one. Throws Error on NaN or infinite timestamps.
/// O((n + m) log(n + m)): the nearest pair left is always a pair of neighbors in the merged list.
inline std::vector<TimestampPair> associate(const std::vector<double>& first,
                                            const std::vector<double>& second,
                                            double max_difference_s = 0.02) {
  using Candidate = detail::TimestampCandidate;
  std::vector<detail::TimestampNode> nodes = detail::merge_timestamps(first, second);
  const auto node = [&nodes](int i) -> detail::TimestampNode& {
    return nodes[static_cast<std::size_t>(i)];
  };
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<Candidate>> queue;
  const auto offer = [&](int left, int right) {
    if (left < 0 || right < 0) return;
    const auto &a = node(left), &b = node(right);
    if (a.is_second == b.is_second || !(b.time - a.time < max_difference_s)) return;
    queue.push({b.time - a.time, a.is_second ? b.time : a.time, a.is_second ? a.time : b.time, left,
                right});
  };
  for (int i = 1; i < static_cast<int>(nodes.size()); ++i) offer(i - 1, i);

  std::vector<TimestampPair> pairs;
  std::vector<char> used(nodes.size(), 0);
  while (!queue.empty()) {
    const Candidate best = queue.top();
    queue.pop();
    char &left_used = used[static_cast<std::size_t>(best.left)],
         &right_used = used[static_cast<std::size_t>(best.right)];
    if (left_used || right_used) continue;
    left_used = right_used = 1;
    const auto &a = node(best.left), &b = node(best.right);
    pairs.push_back(a.is_second ? TimestampPair{b.index, a.index}
                                : TimestampPair{a.index, b.index});
    const int before = a.previous, after = b.next;
    if (before >= 0) node(before).next = after;
    if (after >= 0) node(after).previous = before;
    offer(before, after);
  }
  std::sort(pairs.begin(), pairs.end(), [&](const TimestampPair& a, const TimestampPair& b) {
    return std::tie(first[a.first], a.first) < std::tie(first[b.first], b.first);
  });
  return pairs;
}

}  // namespace stillpoint
