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
class HandleBlend {
 public:
  /// weights: elements × handles. rotation_only leaves the stretches out.
  HandleBlend(const std::vector<Eigen::Matrix3d>& linear, const RowMatrix& weights,
              bool rotation_only);
  /// S_j of element j.
  Eigen::Matrix3d at(Index j) const;

 private:
  RowMatrix turns_, stretches_;  // a row an element
};

}  // namespace dd
