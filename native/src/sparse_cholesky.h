// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/SparseCholesky>
#include <vector>

#include "error.h"
#include "types.h"

namespace dd {

/// A matrix that is not positive definite to working precision.
class SingularMatrix : public Error {
 public:
  explicit SingularMatrix(int row);
  /// Where the factorization broke down, as a row of the matrix.
  int row() const { return row_; }

 private:
  int row_;
};

/// Sparse LDLᵀ of a symmetric positive definite matrix with a fill-reducing (AMD) order: factored
/// once, then solved for four columns in one pass over the factor. One pass moves the factor
/// through memory once where a column-by-column solve moves it once a column.
class SparseCholesky {
 public:
  /// Factors A (both triangles or the lower one stored).
  /// Throws SingularMatrix at a pivot of less than smallest_pivot times its diagonal entry: that
  /// far it cancelled. Rounding leaves up to some 1e-15 of it in a singular matrix.
  explicit SparseCholesky(const SparseMatrix& A, double smallest_pivot = 1e-14);

  int size() const { return static_cast<int>(order_.size()); }
  /// order()[k] is the row of A that stands at place k of the factor.
  const std::vector<int>& order() const { return order_; }

  /// Solves A X = B in place for four columns whose rows stand in the factor's order.
  /// rows: size()×4 doubles, row-major. The hot path: no copies, no permutation.
  void solve_in_order(double* rows) const;

  /// Solves A X = B, rows in A's own order, any number of columns.
  RowMatrix solve(const RowMatrix& B) const;

  /// Entries of the factor below the diagonal.
  Index nonzeros() const;

 private:
  Eigen::SimplicialLDLT<SparseMatrix, Eigen::Lower, Eigen::AMDOrdering<int>> ldlt_;
  std::vector<double> inverse_pivots_;
  std::vector<int> order_;
};

}  // namespace dd
