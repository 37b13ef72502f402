// SPDX-License-Identifier: GPL-3.0-or-later
#include "support/assignment.h"

#include <limits>

namespace dd {

std::vector<int> min_cost_assignment(const Eigen::MatrixXd& costs) {
  const size_t rows = static_cast<size_t>(costs.rows()),
               columns = static_cast<size_t>(costs.cols());
  std::vector<int> result(rows, -1);
  if (rows > columns) {
    const std::vector<int> of_columns = min_cost_assignment(costs.transpose());
    for (size_t c = 0; c < columns; ++c)
      if (of_columns[c] >= 0) result[size_t(of_columns[c])] = static_cast<int>(c);
    return result;
  }
  constexpr double kUnreached = std::numeric_limits<double>::infinity();
  // Dual variables: of the rows assigned so far, the reduced costs (cost − row_price −
  // column_price) are ≥ 0, and 0 for assigned pairs. The extra last column is each search's root.
  std::vector<double> row_price(rows, 0), column_price(columns + 1, 0);
  std::vector<size_t> row_of(columns + 1, rows), before(columns + 1, columns);
  for (size_t row = 0; row < rows; ++row) {
    size_t column = columns;
    row_of[column] = row;
    std::vector<double> least(columns, kUnreached);
    std::vector<char> reached(columns + 1, 0);
    while (row_of[column] < rows) {
      reached[column] = 1;
      const size_t from = row_of[column];
      double step = kUnreached;
      size_t next = columns;
      for (size_t c = 0; c < columns; ++c) {
        if (reached[c]) continue;
        const double over =
            costs(Eigen::Index(from), Eigen::Index(c)) - row_price[from] - column_price[c];
        if (over < least[c]) {
          least[c] = over;
          before[c] = column;
        }
        if (least[c] < step) {
          step = least[c];
          next = c;
        }
      }
      if (next == columns) return result;  // no assignment of finite cost
      for (size_t c = 0; c <= columns; ++c)
        if (reached[c]) {
          row_price[row_of[c]] += step;
          column_price[c] -= step;
        } else {
          least[c] -= step;
        }
      column = next;
    }
    for (; column != columns; column = before[column]) row_of[column] = row_of[before[column]];
  }
  for (size_t c = 0; c < columns; ++c)
    if (row_of[c] < rows) result[row_of[c]] = static_cast<int>(c);
  return result;
}

}  // namespace dd
