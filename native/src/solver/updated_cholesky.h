// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/LU>
#include <utility>

#include "solver/sparse_cholesky.h"

namespace dd {

/// Solves with A + U C Uᵀ by the factor of A, which is sparse where the sum's is not (Sherman,
/// Morrison 1950; Woodbury 1950):
///
///   (A + U C Uᵀ)⁻¹ = A⁻¹ − A⁻¹ U (1 + C Uᵀ A⁻¹ U)⁻¹ C Uᵀ A⁻¹
///
/// The error grows by the factor by which A is worse conditioned than the sum.
class UpdatedCholesky {
 public:
  /// vectors: U, n×k, k small or 0. core: C, k×k.
  UpdatedCholesky(SparseCholesky factor, SparseMatrix vectors, const Eigen::MatrixXd& core,
                  ThreadPool* pool);

  /// Solves for four columns. right(r): returns row r of the right-hand side; called from any
  /// thread. solution: resized to n×4. scratch: buffers, to be reused.
  template <class Right>
  void solve_rows(const Right& right, Rows& solution, SparseCholesky::SolveScratch& scratch,
                  ThreadPool* pool) const {
    solution.resize(factor_.size(), 4);
    factor_.solve_rows(
        right,
        [&](int row, const auto* x) {
          for (int c = 0; c < 4; ++c) solution(row, c) = x[c];
        },
        scratch, pool);
    if (!plain()) update(solution, scratch, pool);
  }

  std::shared_ptr<const SymbolicCholesky> shared_symbolic() const {
    return factor_.shared_symbolic();
  }
  const SparseCholesky& factor() const { return factor_; }  ///< A's
  /// Whether k = 0: the matrix is A.
  bool plain() const { return vectors_.cols() == 0; }
  double bytes() const;

 private:
  /// Turns A⁻¹ B into the solution for the sum.
  void update(Rows& solution, SparseCholesky::SolveScratch& scratch, ThreadPool* pool) const;

  SparseCholesky factor_;
  SparseMatrix vectors_;
  Eigen::MatrixXd core_;
  Eigen::PartialPivLU<Eigen::MatrixXd> small_;  // 1 + C Uᵀ A⁻¹ U
};

}  // namespace dd
