// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "operators.h"
#include "region.h"
#include "sparse_cholesky.h"

namespace dd {

/// The bi-Laplacian K = L M⁻¹ L on the free vertices, factored once: solutions of K x = 0 with
/// given values at the constrained vertices, the smoothest (thin-plate) functions that take them
/// on.
class BendingSystem {
 public:
  /// metric and triangles: the geometry that K is built on. n: number of vertices.
  /// Throws Error(numeric) naming the vertex where K is singular.
  BendingSystem(const TriangleMetric& metric, const Triangles& triangles, const Region& region);

  /// K_FF x_F = −K_FC x_C. values: n×k; only the rows of constrained vertices are read.
  /// Returns F×k, rows as in Region::free.
  RowMatrix extend(const RowMatrix& values) const;

 private:
  const Region& region_;
  SparseMatrix laplacian_;
  Eigen::VectorXd inverse_masses_;
  SparseCholesky factor_;
};

/// The rows or columns of a symmetric n×n matrix that belong to free vertices: n×F.
SparseMatrix free_columns(const SparseMatrix& matrix, const Region& region);

/// Factors a free×free block and names the vertex when it is singular.
SparseCholesky factor_free_block(const SparseMatrix& block, const Region& region);

}  // namespace dd
