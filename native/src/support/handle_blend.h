// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"

namespace dd {

/// Mean of the handles' linear parts A_h = R_h U_h with given weights, rotations through the
/// logarithm:
///
///   S_j = exp(Σ_h w_hj log R_h) · (I + Σ_h w_hj (U_h − I))
///
/// What the weights lack to 1 counts for the identity: that of fixed vertices.
///
/// Of each handle log R_h, and U_h − I unless only rotations are wanted: the terms that the weights
/// sum up, h×3 or h×12.
RowMatrix blend_terms(const std::vector<Eigen::Matrix3d>& linear, bool rotation_only);

/// S_j from the 3 or 12 sums of these terms.
Eigen::Matrix3d blended(const Eigen::Ref<const Eigen::RowVectorXd>& sums);

}  // namespace dd
