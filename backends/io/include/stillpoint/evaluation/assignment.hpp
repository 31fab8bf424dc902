// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <limits>
#include <utility>
#include <vector>

namespace stillpoint {

/// The assignment of rows to columns with the least sum of costs (Kuhn 1955; by shortest augmenting
/// paths). Returns the column of each row, -1 where there are fewer columns than rows. Costs must
/// be finite. O(rows^2 columns), or the other way round.
inline std::vector<int> least_cost_assignment(const Eigen::MatrixXd& cost) {
  if (cost.rows() > cost.cols()) {
    const std::vector<int> row_of = least_cost_assignment(cost.transpose());
    std::vector<int> column_of(static_cast<std::size_t>(cost.rows()), -1);
    for (std::size_t c = 0; c < row_of.size(); ++c)
      column_of[static_cast<std::size_t>(row_of[c])] = static_cast<int>(c);
    return column_of;
  }
  const int rows = static_cast<int>(cost.rows()), columns = static_cast<int>(cost.cols());
  // Prices of rows and columns; no pair costs less than the sum of its two. Column `columns` stands
  // for the row that is being assigned.
  Eigen::VectorXd row_price = Eigen::VectorXd::Zero(rows);
  Eigen::VectorXd column_price = Eigen::VectorXd::Zero(columns + 1);
  std::vector<int> row_of(static_cast<std::size_t>(columns) + 1, -1);
  const auto row_at = [&](int column) -> int& { return row_of[static_cast<std::size_t>(column)]; };
  for (int row = 0; row < rows; ++row) {
    Eigen::VectorXd slack =
        Eigen::VectorXd::Constant(columns, std::numeric_limits<double>::infinity());
    std::vector<int> before(static_cast<std::size_t>(columns), columns);
    std::vector<char> reached(static_cast<std::size_t>(columns) + 1, 0);
    int column = columns;
    row_at(column) = row;
    while (row_at(column) >= 0) {
      reached[static_cast<std::size_t>(column)] = 1;
      const int from = row_at(column);
      int next = -1;
      for (int c = 0; c < columns; ++c) {
        if (reached[static_cast<std::size_t>(c)]) continue;
        const double over = cost(from, c) - row_price[from] - column_price[c];
        if (over < slack[c]) slack[c] = over, before[static_cast<std::size_t>(c)] = column;
        if (next < 0 || slack[c] < slack[next]) next = c;
      }
      const double step = slack[next];
      for (int c = 0; c <= columns; ++c) {
        if (reached[static_cast<std::size_t>(c)])
          row_price[row_at(c)] += step, column_price[c] -= step;
        else if (c < columns)
          slack[c] -= step;
      }
      column = next;
    }
    // Along the path each column takes over the row of the one before it.
    while (column != columns) {
      const int previous = before[static_cast<std::size_t>(column)];
      row_at(column) = row_at(previous);
      column = previous;
    }
  }
  std::vector<int> column_of(static_cast<std::size_t>(rows), -1);
  for (int c = 0; c < columns; ++c)
    if (row_at(c) >= 0) column_of[static_cast<std::size_t>(row_at(c))] = c;
  return column_of;
}

}  // namespace stillpoint
