// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solver/sparse_cholesky.h"

namespace dd {

/// Y = C⁻¹ B for a sparse B, the first half of a solve: a column of Y is zero but on the paths that
/// its rows take up the tree, which for a few rows are next to nothing of a large tree's leaves
/// (Gilbert, Peierls 1988). Where right-hand sides are B times a few numbers each, Y times these is
/// all that the first half of their solves has to do.
class SparseForward {
 public:
  SparseForward() = default;  ///< of nothing
  /// factor: in full precision; must outlive it. B: rows as the factor has them. Where Y would have
  /// more entries than most, it is left out: empty().
  SparseForward(const SparseCholesky& factor, const SparseMatrix& B, int64_t most);

  bool empty() const { return values_.size() == 0; }

  /// The rows of Y C that belong to a part of the factor, into y, where all rows are, 4 numbers
  /// each, float or double. coefficients: a row for each column of B.
  template <class Real>
  void multiply(int part, const Rows& coefficients, Real* y) const;

  double bytes() const;

 private:
  const SymbolicCholesky* symbolic_ = nullptr;
  // Of each supernode, and the end: columns that are not zero there, and its rows of them.
  std::vector<int64_t> column_begin_, value_begin_;
  std::vector<int> columns_;
  RawArray<double> values_;
};

}  // namespace dd
