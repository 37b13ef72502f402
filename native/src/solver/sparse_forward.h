// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solver/sparse_cholesky.h"

namespace dd {

/// Y = C⁻¹ B, the forward substitution, for a sparse B. A column of Y is non-zero only on the paths
/// from its column's rows to the root of the elimination tree, a small part of the tree for few
/// rows (Gilbert, Peierls 1988). For right-hand sides that are B times coefficients, the product of
/// Y and these replaces forward substitution.
class SparseForward {
 public:
  SparseForward() = default;  ///< empty
  /// factor: in full precision; must outlive it. B: rows in the factor's order. If Y would have
  /// more entries than `most` it is not computed: empty().
  SparseForward(const SparseCholesky& factor, const SparseMatrix& B, int64_t most);

  bool empty() const { return values_.size() == 0; }

  /// Writes the rows of Y · coefficients at the rows of a section (a domain, or the top) into y,
  /// which holds all n×4, row-major. coefficients: a row for each column of B.
  template <class Real>
  void multiply(int section, const Rows& coefficients, Real* y) const;

  double bytes() const;

 private:
  using Paths = std::vector<std::vector<int>>;  // of each column of B, its supernodes, ascending
  /// Finds the paths and counts the columns and values of each supernode. False, if Y would have
  /// more entries than `most`.
  bool find_layout(const SparseMatrix& B, int64_t most, Paths& paths);
  void eliminate(const SparseCholesky& factor, const SparseMatrix& B, const Paths& paths);

  const SymbolicCholesky* symbolic_ = nullptr;
  // Starts, for each supernode, of its non-zero columns in columns_, and of its rows of these, row
  // by row, in values_; and the ends.
  std::vector<int64_t> column_begin_, value_begin_;
  std::vector<int> columns_;
  RawArray<double> values_;
};

}  // namespace dd
