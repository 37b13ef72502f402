// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/updated_cholesky.h"

#include <algorithm>

namespace dd {

namespace {

constexpr Index kColumnsAtOnce = 64;  // of the dense A⁻¹ U, to bound its memory

}  // namespace

UpdatedCholesky::UpdatedCholesky(SparseCholesky factor, SparseMatrix vectors,
                                 const Eigen::MatrixXd& core, ThreadPool* pool)
    : factor_(std::move(factor)), vectors_(std::move(vectors)), core_(core) {
  const Index count = vectors_.cols();
  if (count == 0) return;
  Eigen::MatrixXd inner(count, count);
  for (Index first = 0; first < count; first += kColumnsAtOnce) {
    const Index width = std::min(kColumnsAtOnce, count - first);
    const RowMatrix columns = vectors_.middleCols(first, width);
    inner.middleCols(first, width) = vectors_.transpose() * factor_.solve(columns, pool);
  }
  small_.compute(Eigen::MatrixXd::Identity(count, count) + core_ * inner);
}

void UpdatedCholesky::update(Rows& solution, SparseCholesky::SolveScratch& scratch,
                             ThreadPool* pool) const {
  const Eigen::MatrixXd shares =
      small_.solve(core_ * Eigen::MatrixXd(vectors_.transpose() * solution));
  const Rows pulled = vectors_ * shares;
  factor_.solve_rows([&](int row) { return pulled.row(row); },
                     [&](int row, const auto* x) {
                       for (int c = 0; c < 4; ++c) solution(row, c) -= x[c];
                     },
                     scratch, pool);
}

double UpdatedCholesky::bytes() const {
  return factor_.bytes() +
         static_cast<double>(vectors_.nonZeros()) * (sizeof(double) + sizeof(int)) +
         static_cast<double>(2 * core_.size()) * sizeof(double);
}

}  // namespace dd
