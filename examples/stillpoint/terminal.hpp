// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

namespace stillpoint::cli {

/// Draws one progress line on stderr, and only when stderr is a terminal: `label [###...] 12/150`.
/// The line is wiped when the object goes out of scope. Redraws at most ten times a second.
class Progress {
 public:
  Progress(std::string label, std::size_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Says that `done` of the total steps are done.
  void update(std::size_t done);
  /// Wipes the line, so that something else can be printed.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;

  std::string label_;
  std::size_t total_;
  bool enabled_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point drawn_;
};

/// A table as aligned text: the first column to the left, all others to the right.
class TextTable {
 public:
  explicit TextTable(std::vector<std::string> header) : rows_{std::move(header)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  /// Ends the lines so far with a rule.
  void rule() { rows_.push_back({}); }
  std::string text() const;
  const std::vector<std::vector<std::string>>& rows() const { return rows_; }

 private:
  std::vector<std::vector<std::string>> rows_;
};

/// `value` with `digits` decimals; "-" when it is not a finite number.
std::string fixed(double value, int digits);

}  // namespace stillpoint::cli
