// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dd {

/// The column of each row, −1 of those that are left over where there are more of them than
/// columns, no two with the same and as many as can be, so that the sum of their costs is least
/// (shortest augmenting paths); −1 of all where there is none of finite costs.
std::vector<int> least_assignment(const Eigen::MatrixXd& costs);

}  // namespace dd
