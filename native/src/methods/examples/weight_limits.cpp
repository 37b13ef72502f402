// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/weight_limits.h"

#include <Eigen/Cholesky>
#include <limits>

namespace dd {

using Eigen::Index;
using Eigen::VectorXd;

WeightLimits::WeightLimits(const std::vector<double>& pairs, Index count)
    : least(VectorXd::Constant(count, -std::numeric_limits<double>::infinity())), most(-least) {
  if (pairs.empty()) return;
  const Eigen::Map<const Eigen::Matrix<double, 2, Eigen::Dynamic>> given(pairs.data(), 2, count);
  least = given.row(0);
  most = given.row(1);
  any = least.array().isFinite().any() || most.array().isFinite().any();
}

VectorXd limited_step(const Eigen::MatrixXd& H, const VectorXd& s, const VectorXd& least,
                      const VectorXd& most) {
  const Index count = s.size();
  VectorXd x = VectorXd::Zero(count);
  // The active set: −1 at the lower limit, 1 at the upper one, 0 inactive.
  std::vector<int> kept(static_cast<size_t>(count), 0);
  const auto keep = [&](Index i, int side) {
    kept[static_cast<size_t>(i)] = side;
    x[i] = side < 0 ? least[i] : most[i];
  };
  // Each round lowers the objective or adds a limit to the active set. The bound on rounds only
  // ends cycling by rounding.
  for (Index round = 0; round < 10 * count + 10; ++round) {
    std::vector<Index> open;
    for (Index i = 0; i < count; ++i)
      if (kept[static_cast<size_t>(i)] == 0) open.push_back(i);
    const VectorXd slope = H * x + s;
    VectorXd way = VectorXd::Zero(count);
    if (!open.empty()) {
      const Eigen::MatrixXd of_open = H(open, open);
      const VectorXd pull = -slope(open);
      way(open) = VectorXd(of_open.llt().solve(pull));
    }
    double part = 1;
    Index first = -1;
    for (const Index i : open) {
      const double room = way[i] < 0 ? least[i] - x[i] : most[i] - x[i];
      if (std::abs(way[i]) * part > std::abs(room)) {
        part = room / way[i];
        first = i;
      }
    }
    x += part * way;
    if (first >= 0) {
      keep(first, way[first] < 0 ? -1 : 1);
      continue;
    }
    const VectorXd there = H * x + s;
    double strongest = 1e-12 * (s.cwiseAbs().maxCoeff() + there.cwiseAbs().maxCoeff());
    Index leaves = -1;
    for (Index i = 0; i < count; ++i) {
      const double pull = there[i] * kept[static_cast<size_t>(i)];
      if (pull > strongest && least[i] < most[i]) {
        strongest = pull;
        leaves = i;
      }
    }
    if (leaves < 0) break;
    kept[static_cast<size_t>(leaves)] = 0;
  }
  return x;
}

}  // namespace dd
