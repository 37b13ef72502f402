// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "solver/sparse_cholesky.h"
#include "systems/free_block.h"

namespace dd {

/// The smoothing length of corrections, as a fraction of the target box's diagonal. A longer one
/// keeps more of the detail that gradients give, a shorter one follows the wanted places more
/// closely.
constexpr double kSmoothingLength = 0.01;
/// A smoothed correction is divided by the smoothed indicator of the vertices that asked for one,
/// so that smoothing doesn't lessen it, but by this value at least: beyond them it falls to 0.
constexpr double kMinSmoothedIndicator = 0.25;
/// The least mass of a vertex, as a fraction of the mean mass. Safety: keeps D invertible.
constexpr double kMinRelativeMass = 1e-3;

/// Systems (length² L + D) x = D values over the free vertices of a surface. Their solution is the
/// smooth part of values; D is a diagonal matrix of masses.
class Smoothing {
 public:
  /// laplacian: of the free vertices. All must outlive this.
  Smoothing(const SparseMatrix& laplacian, const Region& region, const Positions& positions,
            const Eigen::VectorXd& masses, ThreadPool& pool);

  std::unique_ptr<SparseCholesky> factored(double length, Precision precision,
                                           const Progress& progress);

 private:
  const SparseMatrix& laplacian_;
  const Region& region_;
  const Eigen::VectorXd& masses_;
  ThreadPool& pool_;
  Dissection dissection_;
  std::shared_ptr<const SymbolicCholesky> symbolic_;  // made for the first factor, shared by all
};

}  // namespace dd
