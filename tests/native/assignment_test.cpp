// SPDX-License-Identifier: GPL-3.0-or-later
#include "support/assignment.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "catch.h"

using namespace dd;

namespace {

double cost_of(const Eigen::MatrixXd& costs, const std::vector<int>& columns) {
  double sum = 0;
  for (size_t row = 0; row < columns.size(); ++row)
    if (columns[row] >= 0) sum += costs(Eigen::Index(row), columns[row]);
  return sum;
}

/// The least cost over all permutations of the columns.
double least_cost(const Eigen::MatrixXd& costs) {
  if (costs.rows() > costs.cols()) return least_cost(costs.transpose());
  std::vector<int> order(size_t(costs.cols()));
  std::iota(order.begin(), order.end(), 0);
  double least = std::numeric_limits<double>::infinity();
  do {
    least = std::min(least, cost_of(costs, {order.begin(), order.begin() + costs.rows()}));
  } while (std::next_permutation(order.begin(), order.end()));
  return least;
}

}  // namespace

TEST_CASE("no order of columns costs less than the least assignment") {
  std::srand(3);
  for (const auto& [rows, columns] : {std::pair{1, 1}, {5, 5}, {7, 7}, {3, 6}, {6, 3}, {1, 5}})
    for (int i = 0; i < 20; ++i) {
      Eigen::MatrixXd costs = Eigen::MatrixXd::Random(rows, columns);
      if (i % 4 == 0) costs = (3 * costs).array().round();  // ties
      const std::vector<int> found = min_cost_assignment(costs);
      REQUIRE(found.size() == size_t(rows));
      std::vector<int> taken;
      for (int column : found)
        if (column >= 0) taken.push_back(column);
      std::sort(taken.begin(), taken.end());
      CHECK(int(taken.size()) == std::min(rows, columns));
      CHECK(std::unique(taken.begin(), taken.end()) == taken.end());
      CHECK(cost_of(costs, found) == Approx(least_cost(costs)).margin(1e-12));
    }
}

TEST_CASE("costs that aren't finite assign nothing") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (double none : {nan, std::numeric_limits<double>::infinity()})
    for (int rows : {1, 2, 4})
      CHECK(min_cost_assignment(Eigen::MatrixXd::Constant(rows, 2, none)) ==
            std::vector<int>(size_t(rows), -1));
  CHECK(min_cost_assignment(Eigen::MatrixXd(0, 0)).empty());
}
