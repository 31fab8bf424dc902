// SPDX-License-Identifier: BSD-2-Clause
#include "terminal.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace stillpoint::cli {

Progress::Progress(std::string label, std::size_t total)
    : label_(std::move(label)), total_(total), enabled_(isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() { clear(); }

void Progress::clear() {
  if (enabled_ && drawn_ != Clock::time_point()) std::fputs("\r\033[K", stderr);
}

void Progress::update(std::size_t done) {
  if (!enabled_ || total_ == 0) return;
  const auto now = Clock::now();
  if (done < total_ && now - drawn_ < std::chrono::milliseconds(100)) return;
  drawn_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const double share = std::min(1.0, static_cast<double>(done) / static_cast<double>(total_));
  constexpr int kWidth = 30;
  const int filled = static_cast<int>(share * kWidth);
  std::string left;
  if (done > 0 && seconds > 1)
    left =
        ", " + std::to_string(static_cast<long>(std::ceil(seconds / share - seconds))) + " s left";
  std::fprintf(stderr, "\r\033[K%s [%s%s] %zu/%zu%s", label_.c_str(),
               std::string(static_cast<std::size_t>(filled), '#').c_str(),
               std::string(static_cast<std::size_t>(kWidth - filled), '.').c_str(), done, total_,
               left.c_str());
  std::fflush(stderr);
}

std::string TextTable::text() const {
  std::vector<std::size_t> width;
  for (const auto& row : rows_) {
    width.resize(std::max(width.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) width[i] = std::max(width[i], row[i].size());
  }
  std::size_t total = 0;
  for (std::size_t w : width) total += w + 2;
  std::string out;
  for (const auto& row : rows_) {
    if (row.empty()) {
      out += std::string(total > 2 ? total - 2 : 0, '-') + "\n";
      continue;
    }
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string pad(width[i] - row[i].size(), ' ');
      line += (i ? "  " : "") + (i ? pad + row[i] : row[i] + pad);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  }
  return out;
}

std::string fixed(double value, int digits) {
  if (!std::isfinite(value)) return "-";
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, "%.*f", digits, value);
  return buffer;
}

}  // namespace stillpoint::cli
