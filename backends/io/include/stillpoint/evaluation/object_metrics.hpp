// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/object.hpp"
#include "stillpoint/evaluation/assignment.hpp"

namespace stillpoint {

/// An object of a frame, true or found, in one world.
struct ObjectPlace {
  int id = 0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  /// Of a true one: hardly to be seen. It need not be found, and does no harm if it is.
  bool ignored = false;
};

/// The objects of a frame whose place is known, along the camera's axes: the truth and what was
/// found are compared there, so that the poses do not matter.
inline std::vector<ObjectPlace> places_in_camera(const std::vector<DynamicObject>& objects) {
  std::vector<ObjectPlace> places;
  for (const DynamicObject& o : objects)
    if (o.in_camera) places.push_back({o.id, o.in_camera->centroid_m, o.in_camera->velocity_m_s});
  return places;
}

/// Judges tracked objects by the CLEAR MOT metrics (Bernardin and Stiefelhagen, Evaluating Multiple
/// Object Tracking Performance, EURASIP Journal on Image and Video Processing, 2008).
///
/// In each frame a true object keeps the found one that it had, as long as that is within the
/// greatest distance; the others are matched with the least sum of distances. A true object that is
/// matched with another id than before is an id switch.
class ObjectMetrics {
 public:
  /// Throws Error for a distance that is not positive.
  explicit ObjectMetrics(double max_distance_m = 1) : max_distance_m_(max_distance_m) {
    detail::check(max_distance_m > 0 && std::isfinite(max_distance_m), [&] {
      return "ObjectMetrics: max_distance_m: expected a positive number, found " +
             std::to_string(max_distance_m);
    });
  }

  /// Adds the next frame. Throws Error for a place that is not finite. O(objects^3).
  void add(const std::vector<ObjectPlace>& truth, const std::vector<ObjectPlace>& found) {
    check_places(truth, "truth");
    check_places(found, "found");
    std::vector<int> match(truth.size(), -1);
    std::vector<char> taken(found.size(), 0);
    keep_matches(truth, found, match, taken);
    match_rest(truth, found, match, taken);
    for (std::size_t i = 0; i < truth.size(); ++i)
      count(truth[i], match[i] < 0 ? nullptr : &found[static_cast<std::size_t>(match[i])]);
    for (std::size_t j = 0; j < found.size(); ++j) false_positives_ += !taken[j];
  }

  /// True objects, summed over the frames; those of them that were found, and those that were not.
  int truths() const { return matches_ + misses_; }
  int matches() const { return matches_; }
  int misses() const { return misses_; }
  int false_positives() const { return false_positives_; }
  int id_switches() const { return id_switches_; }
  /// Share of the true objects that were found; NaN without any.
  double coverage() const { return share(matches_); }
  /// 1 - (misses + false positives + id switches) / true objects; NaN without any.
  double mota() const { return 1 - share(misses_ + false_positives_ + id_switches_); }
  /// Mean distance of the matched pairs, metres (its MOTP); NaN without any.
  double motp_m() const { return mean(distance_m_); }
  /// Root mean square of the distance, metres, and of the velocity's error, m/s.
  double position_rmse_m() const { return std::sqrt(mean(distance2_m2_)); }
  double velocity_rmse_m_s() const { return std::sqrt(mean(velocity2_m2_s2_)); }

 private:
  static void check_places(const std::vector<ObjectPlace>& places, const char* name) {
    for (std::size_t i = 0; i < places.size(); ++i)
      detail::check(places[i].position_m.allFinite() && places[i].velocity_m_s.allFinite(), [&] {
        return std::string("ObjectMetrics::add: ") + name + "[" + std::to_string(i) +
               "]: expected finite numbers, found NaN or infinity";
      });
  }

  void keep_matches(const std::vector<ObjectPlace>& truth, const std::vector<ObjectPlace>& found,
                    std::vector<int>& match, std::vector<char>& taken) const {
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const auto last = last_id_.find(truth[i].id);
      if (last == last_id_.end()) continue;
      for (std::size_t j = 0; j < found.size(); ++j)
        if (!taken[j] && found[j].id == last->second && in_reach(truth[i], found[j])) {
          match[i] = static_cast<int>(j), taken[j] = 1;
          break;
        }
    }
  }

  void match_rest(const std::vector<ObjectPlace>& truth, const std::vector<ObjectPlace>& found,
                  std::vector<int>& match, std::vector<char>& taken) const {
    std::vector<std::size_t> rows, columns;
    for (std::size_t i = 0; i < truth.size(); ++i)
      if (match[i] < 0) rows.push_back(i);
    for (std::size_t j = 0; j < found.size(); ++j)
      if (!taken[j]) columns.push_back(j);
    if (rows.empty() || columns.empty()) return;
    // Out of reach costs more than all pairs in reach together: as many as possible are matched.
    const double never = max_distance_m_ * static_cast<double>(rows.size() + columns.size() + 1);
    Eigen::MatrixXd cost(rows.size(), columns.size());
    for (std::size_t r = 0; r < rows.size(); ++r)
      for (std::size_t c = 0; c < columns.size(); ++c)
        cost(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) =
            in_reach(truth[rows[r]], found[columns[c]])
                ? distance(truth[rows[r]], found[columns[c]])
                : never;
    const std::vector<int> column_of = least_cost_assignment(cost);
    for (std::size_t r = 0; r < rows.size(); ++r) {
      if (column_of[r] < 0) continue;
      const std::size_t j = columns[static_cast<std::size_t>(column_of[r])];
      if (!in_reach(truth[rows[r]], found[j])) continue;
      match[rows[r]] = static_cast<int>(j), taken[j] = 1;
    }
  }

  void count(const ObjectPlace& truth, const ObjectPlace* found) {
    if (found) {
      const auto [last, is_new] = last_id_.emplace(truth.id, found->id);
      if (!is_new && last->second != found->id && !truth.ignored) ++id_switches_;
      last->second = found->id;
    }
    if (truth.ignored) return;
    if (!found) return void(++misses_);
    ++matches_;
    const double off_m = distance(truth, *found);
    distance_m_ += off_m, distance2_m2_ += off_m * off_m;
    velocity2_m2_s2_ += (truth.velocity_m_s - found->velocity_m_s).squaredNorm();
  }

  static double distance(const ObjectPlace& a, const ObjectPlace& b) {
    return (a.position_m - b.position_m).norm();
  }
  bool in_reach(const ObjectPlace& a, const ObjectPlace& b) const {
    return distance(a, b) <= max_distance_m_;
  }
  double mean(double sum) const {
    return matches_ ? sum / matches_ : std::numeric_limits<double>::quiet_NaN();
  }
  double share(int n) const {
    return truths() ? n / static_cast<double>(truths()) : std::numeric_limits<double>::quiet_NaN();
  }

  double max_distance_m_;
  std::map<int, int> last_id_;  // of the true objects: what they were matched with last
  int matches_ = 0, misses_ = 0, false_positives_ = 0, id_switches_ = 0;
  double distance_m_ = 0, distance2_m2_ = 0, velocity2_m2_s2_ = 0;  // sums over the matches
};

}  // namespace stillpoint
