// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dd {

/// Lower and upper limit of each example's weight. The interval contains 0.
struct WeightLimits {
  /// pairs: lower and upper limit of each example, perhaps infinite; empty: no limits.
  WeightLimits(const std::vector<double>& pairs, Eigen::Index count);

  Eigen::VectorXd within(const Eigen::VectorXd& weights) const {
    return weights.cwiseMax(lower).cwiseMin(upper);
  }

  Eigen::VectorXd lower, upper;
  bool any = false;
};

/// The minimizer x of ½ xᵀHx + sᵀx subject to least ≤ x ≤ most, by an active-set method from x = 0,
/// which must be feasible. H must be positive definite, so x is unique and continuous in all
/// inputs.
Eigen::VectorXd limited_step(const Eigen::MatrixXd& H, const Eigen::VectorXd& s,
                             const Eigen::VectorXd& lower, const Eigen::VectorXd& upper);

}  // namespace dd
