// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/smoothing.h"

namespace dd {

Smoothing::Smoothing(const SparseMatrix& laplacian, const Region& region,
                     const Positions& positions, const Eigen::VectorXd& masses, ThreadPool& pool)
    : laplacian_(laplacian),
      region_(region),
      masses_(masses),
      pool_(pool),
      dissection_(free_dissection(laplacian, region, positions, &pool)) {}

std::unique_ptr<SparseCholesky> Smoothing::factored(double length, Precision precision,
                                                    const Progress& progress) {
  SparseMatrix block = length * length * laplacian_;
  for (int r = 0; r < region_.free_count(); ++r) block.coeffRef(r, r) += masses_[r];
  BlockOptions how;
  how.pool = &pool_;
  how.precision = precision;
  how.dissection = symbolic_ ? nullptr : &dissection_;
  how.symbolic = symbolic_;
  how.progress = progress;
  auto factor = std::make_unique<SparseCholesky>(factor_free_block(block, region_, how));
  symbolic_ = factor->shared_symbolic();
  return factor;
}

}  // namespace dd
