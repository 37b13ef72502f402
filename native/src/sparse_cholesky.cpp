// SPDX-License-Identifier: GPL-3.0-or-later
#include "sparse_cholesky.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "kernels.h"

namespace dd {

SingularMatrix::SingularMatrix(int row)
    : Error(Status::numeric,
            "The system has no unique solution at row " + std::to_string(row) + "."),
      row_(row) {}

SparseCholesky::SparseCholesky(const SparseMatrix& A, double smallest_pivot) {
  ldlt_.compute(A);
  const Index n = A.rows();
  order_.resize(static_cast<size_t>(n));
  const auto& old_of_new = ldlt_.permutationPinv().indices();
  for (Index k = 0; k < n; ++k) order_[k] = old_of_new.size() ? old_of_new[k] : static_cast<int>(k);

  // Eigen stops at a pivot of exactly zero only.
  inverse_pivots_.resize(static_cast<size_t>(n));
  const Eigen::VectorXd pivots = ldlt_.vectorD();
  for (Index k = 0; k < n; ++k) {
    const double diagonal = A.coeff(order_[k], order_[k]);
    if (!std::isfinite(pivots[k]) || !(pivots[k] > smallest_pivot * diagonal))
      throw SingularMatrix(order_[k]);
    inverse_pivots_[k] = 1 / pivots[k];
  }
}

void SparseCholesky::solve_in_order(double* rows) const {
  const auto& factor = ldlt_.matrixL().nestedExpression();
  kernels().solve_factor(size(), factor.outerIndexPtr(), factor.innerIndexPtr(), factor.valuePtr(),
                         inverse_pivots_.data(), rows);
}

RowMatrix SparseCholesky::solve(const RowMatrix& B) const {
  RowMatrix X(B.rows(), B.cols());
  Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor> panel(B.rows(), 4);
  for (Index first = 0; first < B.cols(); first += 4) {
    const Index width = std::min<Index>(4, B.cols() - first);
    panel.setZero();
    for (Index k = 0; k < B.rows(); ++k)
      panel.row(k).head(width) = B.row(order_[k]).segment(first, width);
    solve_in_order(panel.data());
    for (Index k = 0; k < B.rows(); ++k)
      X.row(order_[k]).segment(first, width) = panel.row(k).head(width);
  }
  return X;
}

Index SparseCholesky::nonzeros() const { return ldlt_.matrixL().nestedExpression().nonZeros(); }

}  // namespace dd
