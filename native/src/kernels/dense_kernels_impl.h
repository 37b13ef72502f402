// SPDX-License-Identifier: GPL-3.0-or-later
// Included once for each instruction set, with Eigen's name changed to one of that set: its inline
// functions are then another's, and the linker can't put wide code where the machine has none.
#define Eigen DD_EIGEN_NAME
#include <Eigen/Cholesky>

#include "kernels/dense_kernels.h"

namespace dd {

namespace {

using Matrix = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
using ConstMatrix = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

/// Column by column; returns the first bad one.
int factor_unblocked(int width, double* a, int stride, const double* bounds) {
  for (int k = 0; k < width; ++k) {
    double* column = a + static_cast<Eigen::Index>(k) * stride;
    const double pivot = column[k];
    if (!(pivot > bounds[k]) || !(pivot < 1e300)) return k;
    const double root = Eigen::numext::sqrt(pivot), inverse_root = 1 / root;
    column[k] = root;
    for (int i = k + 1; i < width; ++i) column[i] *= inverse_root;
    for (int j = k + 1; j < width; ++j) {
      double* target = a + static_cast<Eigen::Index>(j) * stride;
      const double factor = column[j];
      for (int i = j; i < width; ++i) target[i] -= factor * column[i];
    }
  }
  return -1;
}

int factor_pivot(int width, double* a, int stride, const double* bounds, double* inverse) {
  constexpr int kPanel = 16;
  Matrix A(a, width, width, Eigen::OuterStride<>(stride));
  for (int k = 0; k < width; k += kPanel) {
    const int panel = width - k < kPanel ? width - k : kPanel, rest = width - k - panel;
    const int bad = factor_unblocked(panel, &A.coeffRef(k, k), stride, bounds + k);
    if (bad >= 0) return k + bad;
    if (rest == 0) break;
    auto below = A.block(k + panel, k, rest, panel);
    A.block(k, k, panel, panel)
        .triangularView<Eigen::Lower>()
        .transpose()
        .solveInPlace<Eigen::OnTheRight>(below);
    A.bottomRightCorner(rest, rest).selfadjointView<Eigen::Lower>().rankUpdate(below, -1.0);
  }
  Matrix C1(inverse, width, width, Eigen::OuterStride<>(width));
  C1.setIdentity();
  A.triangularView<Eigen::Lower>().solveInPlace(C1);
  return -1;
}

void solve_rows(int width, int count, const double* inverse, const double* b, int b_stride,
                double* y, int y_stride) {
  const ConstMatrix C1(inverse, width, width, Eigen::OuterStride<>(width));
  const ConstMatrix B(b, count, width, Eigen::OuterStride<>(b_stride));
  Matrix Y(y, count, width, Eigen::OuterStride<>(y_stride));
  Y.noalias() = B * C1.transpose().triangularView<Eigen::Upper>();
}

void subtract_products(int width, int size, int first, int last, const double* y, int y_stride,
                       double* a, int a_stride) {
  const ConstMatrix Y(y, size, width, Eigen::OuterStride<>(y_stride));
  Matrix A(a, size, size, Eigen::OuterStride<>(a_stride));
  const int count = last - first, below = size - last;
  A.block(first, first, count, count)
      .selfadjointView<Eigen::Lower>()
      .rankUpdate(Y.middleRows(first, count), -1.0);
  if (below > 0)
    A.block(last, first, below, count).noalias() -=
        Y.bottomRows(below) * Y.middleRows(first, count).transpose();
}

}  // namespace

extern const DenseKernels DD_KERNEL_SET;
const DenseKernels DD_KERNEL_SET = {factor_pivot, solve_rows, subtract_products};

}  // namespace dd
