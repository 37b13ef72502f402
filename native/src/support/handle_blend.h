// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"

namespace dd {

/// Weighted mean of the handles' linear parts A_h = R_h U_h, rotations through the logarithm:
///
///   S_j = exp(Σ_h w_hj log R_h) · (I + Σ_h w_hj (U_h − I))
///
/// If the weights sum to less than 1, the remainder is the weight of the identity, the motion of
/// fixed vertices.
///
/// Returns the summands, a row for each handle: log R_h, and unless rotation_only the columns of
/// U_h − I; h×3 or h×12.
RowMatrix blend_terms(const std::vector<Eigen::Matrix3d>& linear, bool rotation_only);

/// S_j from the weighted sum of these rows, 3 or 12 numbers.
Eigen::Matrix3d blended(const Eigen::Ref<const Eigen::RowVectorXd>& sums);

}  // namespace dd
