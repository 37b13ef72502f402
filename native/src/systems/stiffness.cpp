// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/stiffness.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dd {

namespace {

// The common logarithm of k of a rigid part. Tuned: on a solid limb bent by 90° a plate of a fifth
// of its length is off a rigid motion by 4e-3 of its own length with 2, 4e-4 with 3, 4e-5 with 4,
// at 1,700 and at 15,000 vertices; single precision ends at 1e-6.
constexpr double kRigid = 4;

}  // namespace

Stiffness::Stiffness(const Eigen::VectorXf& weights, const Region& region) {
  if (weights.size() == 0 || region.free.empty()) return;
  const auto free = weights(region.free);
  const float softest = free.minCoeff();
  if (free.maxCoeff() == softest) return;
  of_vertex_.setZero(weights.size());
  for (int v : region.free) of_vertex_[v] = std::pow(10.0, kRigid * double(weights[v] - softest));
}

Eigen::VectorXd Stiffness::of_triangles(const Triangles& triangles) const {
  Eigen::VectorXd result;
  if (!varies()) return result;
  result.resize(triangles.rows());
  for (Index j = 0; j < triangles.rows(); ++j) {
    double softest = std::numeric_limits<double>::infinity(), stiffest = 0;
    for (int v : triangles.row(j)) {
      if (of_vertex_[v] == 0) continue;
      softest = std::min(softest, of_vertex_[v]);
      stiffest = std::max(stiffest, of_vertex_[v]);
    }
    const bool has_free_corner = stiffest > 0;
    result[j] = !has_free_corner ? 1 : by_stiffest_corner_ ? stiffest : softest;
  }
  return result;
}

Stiffness Stiffness::of_coarse(const std::vector<int>& of_vertex, const Region& coarse) const {
  Stiffness result;
  if (!varies()) return result;
  result.of_vertex_ = largest_merged(of_vertex_, of_vertex, coarse.role.size());
  for (size_t v = 0; v < coarse.role.size(); ++v)
    if (coarse.role[v] != kFree) result.of_vertex_[Index(v)] = 0;
  result.by_stiffest_corner_ = true;
  return result;
}

}  // namespace dd
