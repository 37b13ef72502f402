// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "solver/sparse_cholesky.h"
#include "systems/free_block.h"

namespace dd {

constexpr double kSmooth = 0.01;  ///< of the box: the length over which places are smooth
constexpr double kEdge = 0.25;  ///< share of what is asked for at one place that is left, at least
constexpr double kLeastMass = 1e-3;  ///< of the mean

/// Systems (length² L + D) x = D values over a surface's free vertices, which give the smooth part
/// of values there; D are masses.
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
  std::shared_ptr<const SymbolicCholesky> symbolic_;  // of the first one, for all
};

}  // namespace dd
