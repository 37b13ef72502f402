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
constexpr double kSameSize = 1.1, kOtherSize = 1.2;

/// s. scale: the placement's.
double proportion(double scale) {
  const double counts = (std::max(scale, 1 / scale) - kSameSize) / (kOtherSize - kSameSize);
  return std::pow(scale, std::clamp(counts, 0.0, 1.0));
}

}  // namespace

Displacements::Displacements(const Mesh& source, const Mesh& target,
                             const std::vector<Component>& components, const SourcePoints& points,
                             const Similarity& placement, ThreadPool& pool)
    : source_(source),
      target_(target),
      points_(points),
      turn_(proportion(placement.scale) * placement.rotation),
      pool_(pool) {
  std::vector<int> roles(static_cast<size_t>(target.vertex_count()), kFixed);
  for (const Component& component : components) {
    if (component.held || component.triangles.empty()) continue;
    for (int v : component.vertices) {
      if (points.is_known(v))
        known_.push_back(v);
      else
        roles[size_t(v)] = kFree;
    }
  }
  region_ = region_of(std::move(roles), 0);
  if (region_.free.empty()) return;
  const SurfaceOperators operators = surface_operators(target.positions, target.triangles);
  const SparseMatrix block = free_block(operators.laplacian, region_);
  coupling_ = SparseMatrix(free_columns(operators.laplacian, region_).transpose());
  factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region_));
}

void Displacements::correct(const Positions& pose, Positions& result) {
  RowMatrix moved;  // corrections of known vertices, zero elsewhere
  if (factor_) moved = RowMatrix::Zero(result.rows(), 3);
  pool_.parallel_for(static_cast<int64_t>(known_.size()), kLeastRange,
                     [&](int64_t begin, int64_t end) {
                       for (int64_t i = begin; i < end; ++i) {
                         const int v = known_[size_t(i)];
                         const Eigen::RowVector3d place =
                             target_.positions.row(v) +
                             way(points_.at(source_.positions, v), points_.at(pose, v)).transpose();
                         if (factor_) moved.row(v) = place - result.row(v);
                         result.row(v) = place;
                       }
                     });
  if (!factor_) return;
  const RowMatrix spread = factor_->solve(-RowMatrix(coupling_ * moved), &pool_);
  for (int r = 0; r < region_.free_count(); ++r) result.row(region_.free[r]) += spread.row(r);
}

}  // namespace dd
