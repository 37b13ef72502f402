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
  BlockOptions block_options;
  block_options.pool = &pool_;
  block_options.precision = precision;
  block_options.dissection = symbolic_ ? nullptr : &dissection_;
  block_options.symbolic = symbolic_;
  block_options.progress = progress;
  auto factor = std::make_unique<SparseCholesky>(factor_free_block(block, region_, block_options));
  symbolic_ = factor->shared_symbolic();
  return factor;
}

}  // namespace dd
