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
  /// operators: of the geometry that K is built on. Both arguments must outlive the system.
  /// Throws Error(numeric) naming the vertex where K is singular.
  BendingSystem(const SurfaceOperators& operators, const Region& region);

  /// K_FF x_F = −K_FC x_C. values: n×k; only the rows of constrained vertices are read.
  /// Returns F×k, rows as in Region::free.
  RowMatrix extend(const RowMatrix& values) const;

 private:
  /// L M⁻¹ L times the columns of values.
  RowMatrix apply(const RowMatrix& values) const;

  const SurfaceOperators& operators_;
  const Region& region_;
  SparseCholesky factor_;
};

/// The columns of a matrix that belong to free vertices: F of its n.
SparseMatrix free_columns(const SparseMatrix& matrix, const Region& region);

/// The rows and columns of a symmetric n×n matrix that belong to free vertices: F×F.
SparseMatrix free_block(const SparseMatrix& matrix, const Region& region);

/// Factors a free×free block and names the vertex when it is singular.
SparseCholesky factor_free_block(const SparseMatrix& block, const Region& region);

}  // namespace dd
