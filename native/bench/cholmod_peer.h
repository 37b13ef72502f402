// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cholmod.h>

#include "support/types.h"

namespace dd::bench {

/// CHOLMOD by its own interface, without the allocations of Eigen's wrapper; ordered by AMD.
class Cholmod {
 public:
  Cholmod(const SparseMatrix& A, bool supernodal) : A_(A) {
    cholmod_start(&common_);
    common_.supernodal = supernodal ? CHOLMOD_SUPERNODAL : CHOLMOD_SIMPLICIAL;
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_AMD;
    common_.postorder = 1;
    matrix_.nrow = matrix_.ncol = static_cast<size_t>(A.rows());
    matrix_.nzmax = static_cast<size_t>(A.nonZeros());
    matrix_.p = const_cast<int*>(A.outerIndexPtr());
    matrix_.i = const_cast<int*>(A.innerIndexPtr());
    matrix_.x = const_cast<double*>(A.valuePtr());
    matrix_.stype = -1;
    matrix_.itype = CHOLMOD_INT;
    matrix_.xtype = CHOLMOD_REAL;
    matrix_.dtype = CHOLMOD_DOUBLE;
    matrix_.sorted = matrix_.packed = 1;
  }
  ~Cholmod() {
    cholmod_free_dense(&x_, &common_);
    cholmod_free_dense(&y_, &common_);
    cholmod_free_dense(&e_, &common_);
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;

  void factor() {
    factor_ = cholmod_analyze(&matrix_, &common_);
    cholmod_factorize(&matrix_, factor_, &common_);
  }
  void solve(const Eigen::MatrixXd& right) {
    cholmod_dense b{};
    b.nrow = b.d = static_cast<size_t>(right.rows());
    b.ncol = static_cast<size_t>(right.cols());
    b.nzmax = b.nrow * b.ncol;
    b.x = const_cast<double*>(right.data());
    b.xtype = CHOLMOD_REAL;
    b.dtype = CHOLMOD_DOUBLE;
    cholmod_solve2(CHOLMOD_A, factor_, &b, nullptr, &x_, nullptr, &y_, &e_, &common_);
  }

 private:
  const SparseMatrix& A_;
  cholmod_common common_{};
  cholmod_sparse matrix_{};
  cholmod_factor* factor_ = nullptr;
  cholmod_dense *x_ = nullptr, *y_ = nullptr, *e_ = nullptr;
};

}  // namespace dd::bench
