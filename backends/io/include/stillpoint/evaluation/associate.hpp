// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Indices of two timestamps that belong together.
struct TimestampPair {
  std::size_t first = 0;
  std::size_t second = 0;
};

/// Pairs two lists of timestamps (seconds, in any order) as the TUM benchmark's associate.py does:
/// the nearest pair first, each timestamp used once, only pairs less than `max_difference_s` apart.
///
/// Returns the pairs in the order of `first`'s time. Equally near pairs: the earlier first
/// timestamp wins, then the earlier second one. Throws Error on NaN or infinite timestamps.
/// O((n + m) log(n + m)): the nearest pair left is always a pair of neighbors in the merged list.
inline std::vector<TimestampPair> associate(const std::vector<double>& first,
                                            const std::vector<double>& second,
                                            double max_difference_s = 0.02) {
  struct Node {
    double time;
    bool is_second;
    std::size_t index;
    int previous, next;
  };
  std::vector<Node> nodes;
  nodes.reserve(first.size() + second.size());
  const auto add = [&nodes](const std::vector<double>& times, bool is_second) {
    for (std::size_t i = 0; i < times.size(); ++i) {
      detail::check(std::isfinite(times[i]), [&] {
        return std::string("associate: ") + (is_second ? "second" : "first") + "[" +
               std::to_string(i) + "]: expected a timestamp in seconds, found " +
               std::to_string(times[i]);
      });
      nodes.push_back({times[i], is_second, i, -1, -1});
    }
  };
  add(first, false);
  add(second, true);
  std::sort(nodes.begin(), nodes.end(), [](const Node& a, const Node& b) {
    if (a.time != b.time) return a.time < b.time;
    return a.is_second != b.is_second ? b.is_second : a.index < b.index;
  });

  struct Candidate {
    double difference, time_first, time_second;
    int left, right;
    bool operator>(const Candidate& o) const {
      if (difference != o.difference) return difference > o.difference;
      if (time_first != o.time_first) return time_first > o.time_first;
      if (time_second != o.time_second) return time_second > o.time_second;
      return left > o.left;
    }
  };
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<Candidate>> queue;
  const auto node = [&nodes](int i) -> Node& { return nodes[static_cast<std::size_t>(i)]; };
  const auto offer = [&](int left, int right) {
    if (left < 0 || right < 0) return;
    const Node &a = node(left), &b = node(right);
    if (a.is_second == b.is_second || !(b.time - a.time < max_difference_s)) return;
    queue.push({b.time - a.time, a.is_second ? b.time : a.time, a.is_second ? a.time : b.time, left,
                right});
  };
  const int count = static_cast<int>(nodes.size());
  for (int i = 0; i < count; ++i) {
    node(i).previous = i - 1;
    node(i).next = i + 1 < count ? i + 1 : -1;
    offer(i - 1, i);
  }

  std::vector<TimestampPair> pairs;
  std::vector<char> used(nodes.size(), 0);
  while (!queue.empty()) {
    const Candidate best = queue.top();
    queue.pop();
    auto &left_used = used[static_cast<std::size_t>(best.left)],
         &right_used = used[static_cast<std::size_t>(best.right)];
    if (left_used || right_used) continue;
    left_used = right_used = 1;
    const Node &a = node(best.left), &b = node(best.right);
    pairs.push_back(a.is_second ? TimestampPair{b.index, a.index}
                                : TimestampPair{a.index, b.index});
    const int before = a.previous, after = b.next;
    if (before >= 0) node(before).next = after;
    if (after >= 0) node(after).previous = before;
    offer(before, after);
  }
  std::sort(pairs.begin(), pairs.end(), [&](const TimestampPair& a, const TimestampPair& b) {
    if (first[a.first] != first[b.first]) return first[a.first] < first[b.first];
    return a.first < b.first;
  });
  return pairs;
}

}  // namespace stillpoint
