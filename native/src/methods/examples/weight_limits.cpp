// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/weight_limits.h"

#include <Eigen/Cholesky>
#include <limits>

namespace dd {

using Eigen::Index;
using Eigen::VectorXd;

WeightLimits::WeightLimits(const std::vector<double>& pairs, Index count)
    : lower(VectorXd::Constant(count, -std::numeric_limits<double>::infinity())), upper(-lower) {
  if (pairs.empty()) return;
  const Eigen::Map<const Eigen::Matrix<double, 2, Eigen::Dynamic>> given(pairs.data(), 2, count);
  lower = given.row(0);
  upper = given.row(1);
  any = lower.array().isFinite().any() || upper.array().isFinite().any();
}

VectorXd limited_step(const Eigen::MatrixXd& H, const VectorXd& s, const VectorXd& lower,
                      const VectorXd& upper) {
  const Index count = s.size();
  VectorXd x = VectorXd::Zero(count);
  // The active set: −1 at the lower limit, 1 at the upper one, 0 inactive.
  std::vector<int> active_side(static_cast<size_t>(count), 0);
  const auto activate = [&](Index i, int side) {
    active_side[static_cast<size_t>(i)] = side;
    x[i] = side < 0 ? lower[i] : upper[i];
  };
  // Each round lowers the objective or adds a limit to the active set. The bound on rounds only
  // ends cycling by rounding.
  for (Index round = 0; round < 10 * count + 10; ++round) {
    std::vector<Index> inactive;
    for (Index i = 0; i < count; ++i)
      if (active_side[static_cast<size_t>(i)] == 0) inactive.push_back(i);
    const VectorXd gradient = H * x + s;
    VectorXd step = VectorXd::Zero(count);
    if (!inactive.empty()) {
      const Eigen::MatrixXd inactive_block = H(inactive, inactive);
      const VectorXd descent = -gradient(inactive);
      step(inactive) = VectorXd(inactive_block.llt().solve(descent));
    }
    double step_fraction = 1;
    Index first_limit = -1;
    for (const Index i : inactive) {
      const double room = step[i] < 0 ? lower[i] - x[i] : upper[i] - x[i];
      if (std::abs(step[i]) * step_fraction > std::abs(room)) {
        step_fraction = room / step[i];
        first_limit = i;
      }
    }
    x += step_fraction * step;
    if (first_limit >= 0) {
      activate(first_limit, step[first_limit] < 0 ? -1 : 1);
      continue;
    }
    const VectorXd new_gradient = H * x + s;
    // Safety: smaller multipliers are rounding, by whose sign limits would be released in turn.
    double strongest = 1e-12 * (s.cwiseAbs().maxCoeff() + new_gradient.cwiseAbs().maxCoeff());
    Index released = -1;
    for (Index i = 0; i < count; ++i) {
      const double multiplier = new_gradient[i] * active_side[static_cast<size_t>(i)];
      if (multiplier > strongest && lower[i] < upper[i]) {
        strongest = multiplier;
        released = i;
      }
    }
    if (released < 0) break;
    active_side[static_cast<size_t>(released)] = 0;
  }
  return x;
}

}  // namespace dd
