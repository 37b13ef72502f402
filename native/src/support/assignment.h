// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dd {

/// Minimum-cost assignment of min(rows, columns) pairs (Hungarian method by shortest augmenting
/// paths), O(min² · max). Returns the column of each row, −1 for rows left over; −1 for all rows if
/// no assignment has a finite cost.
std::vector<int> min_cost_assignment(const Eigen::MatrixXd& costs);

}  // namespace dd
