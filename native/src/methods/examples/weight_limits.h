// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dd {

/// The least and the largest weight that each example may have; 0 is among those it may.
struct WeightLimits {
  /// pairs: both of each example, perhaps infinite; empty: none is limited.
  WeightLimits(const std::vector<double>& pairs, Eigen::Index count);

  Eigen::VectorXd within(const Eigen::VectorXd& weights) const {
    return weights.cwiseMax(least).cwiseMin(most);
  }

  Eigen::VectorXd least, most;
  bool any = false;
};

/// The step x with the least ½ xᵀHx + sᵀx and least ≤ x ≤ most, by active sets from x = 0, which is
/// within these. H is positive definite, so that it is unique and a continuous function of all.
Eigen::VectorXd limited_step(const Eigen::MatrixXd& H, const Eigen::VectorXd& s,
                             const Eigen::VectorXd& least, const Eigen::VectorXd& most);

}  // namespace dd
