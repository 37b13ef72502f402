// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/displacements.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "systems/free_block.h"
#include "systems/operators.h"

namespace dd {

namespace {

// Ratios of sizes, the larger over the smaller: up to the first one, displacements aren't scaled;
// from the second one on, fully.
constexpr double kMaxUnscaledRatio = 1.1, kMinScaledRatio = 1.2;

/// s. scale: the placement's.
double displacement_scale(double scale) {
  const double scaled_fraction =
      (std::max(scale, 1 / scale) - kMaxUnscaledRatio) / (kMinScaledRatio - kMaxUnscaledRatio);
  return std::pow(scale, std::clamp(scaled_fraction, 0.0, 1.0));
}

}  // namespace

Displacements::Displacements(const TransferContext& context)
    : source_(*context.source),
      target_(*context.target),
      points_(*context.points),
      scaled_rotation_(displacement_scale(context.placement->scale) * context.placement->rotation),
      pool_(*context.pool) {
  std::vector<int> roles(static_cast<size_t>(target_.vertex_count()), kFixed);
  for (const Component& component : *context.components) {
    if (component.held || component.triangles.empty()) continue;
    for (int v : component.vertices) {
      if (points_.is_known(v))
        known_.push_back(v);
      else
        roles[size_t(v)] = kFree;
    }
  }
  region_ = region_of_roles(std::move(roles), 0);
  if (region_.free.empty()) return;
  const SurfaceOperators operators = surface_operators(target_.positions, target_.triangles);
  const SparseMatrix block = free_block(operators.laplacian, region_);
  coupling_ = SparseMatrix(free_columns(operators.laplacian, region_).transpose());
  factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region_));
}

void Displacements::correct(const Positions& pose, Positions& result) {
  RowMatrix corrections;  // corrections of known vertices, zero elsewhere
  if (factor_) corrections = RowMatrix::Zero(result.rows(), 3);
  pool_.parallel_for(
      static_cast<int64_t>(known_.size()), kLeastRange, [&](int64_t begin, int64_t end) {
        for (int64_t i = begin; i < end; ++i) {
          const int v = known_[size_t(i)];
          const Eigen::RowVector3d position =
              target_.positions.row(v) +
              displacement(points_.at(source_.positions, v), points_.at(pose, v)).transpose();
          if (factor_) corrections.row(v) = position - result.row(v);
          result.row(v) = position;
        }
      });
  if (!factor_) return;
  const RowMatrix extended = factor_->solve(-RowMatrix(coupling_ * corrections), &pool_);
  for (int r = 0; r < region_.free_count(); ++r) result.row(region_.free[r]) += extended.row(r);
}

}  // namespace dd
