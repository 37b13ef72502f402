// SPDX-License-Identifier: GPL-3.0-or-later
// Included once for each instruction set, with namespace Eigen renamed for each: otherwise the
// linker may keep an inline function's AVX2 version for all callers, even without AVX2.
#define Eigen DD_EIGEN_NAME
#include <Eigen/Cholesky>

#include "kernels/dense_blocks.h"

namespace dd {

namespace {

using Matrix = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
using ConstMatrix = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

// Largest sizes at which dense_blocks.h is faster than Eigen: columns of a pivot block, columns of
// a solve, rows of a product. Tuned by timing both (native/bench/RESULTS.md).
constexpr int kMaxPivotByBlocks = 64, kMaxSolveByBlocks = 64, kMaxProductByBlocks = 192;

/// Y = B C⁻ᵀ, with C⁻¹ a block of a larger matrix.
void solve_rows_by(int width, int count, const double* inverse, int inverse_stride, const double* b,
                   int b_stride, double* y, int y_stride) {
  if (width <= kMaxSolveByBlocks)
    return solve_small(width, count, inverse, inverse_stride, b, b_stride, y, y_stride);
  const ConstMatrix C1(inverse, width, width, Eigen::OuterStride<>(inverse_stride));
  const ConstMatrix B(b, count, width, Eigen::OuterStride<>(b_stride));
  Matrix Y(y, count, width, Eigen::OuterStride<>(y_stride));
  Y.noalias() = B * C1.transpose().triangularView<Eigen::Upper>();
}

void solve_rows(int width, int count, const double* inverse, const double* b, int b_stride,
                double* y, int y_stride) {
  solve_rows_by(width, count, inverse, width, b, b_stride, y, y_stride);
}

void subtract_products(int width, int size, int first, int last, const double* y, int y_stride,
                       double* a, int a_stride) {
  if (size - first <= kMaxProductByBlocks)
    return subtract_small(width, size, first, last, y, y_stride, a, a_stride);
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

/// Recursive by halves: C₂₁ = A₂₁ C₁₁⁻ᵀ, A₂₂ −= C₂₁ C₂₁ᵀ; the lower left block of the inverse is
/// −C₂₂⁻¹ C₂₁ C₁₁⁻¹.
int factor_and_invert(int width, double* a, int stride, const double* bounds, double* inverse,
                      int inverse_stride) {
  if (width <= kMaxPivotByBlocks) {
    const int bad = factor_small(width, a, stride, bounds);
    if (bad < 0) invert_small(width, a, stride, inverse, inverse_stride);
    return bad;
  }
  const int upper = (width / 2 + 3) / 4 * 4, lower = width - upper;
  int bad = factor_and_invert(upper, a, stride, bounds, inverse, inverse_stride);
  if (bad >= 0) return bad;
  Matrix C21(a + upper, lower, upper, Eigen::OuterStride<>(stride));
  Matrix X21(inverse + upper, lower, upper, Eigen::OuterStride<>(inverse_stride));
  solve_rows_by(upper, lower, inverse, inverse_stride, C21.data(), stride, X21.data(),
                inverse_stride);
  C21 = X21;
  const Eigen::Index corner = upper * Eigen::Index(stride) + upper;
  subtract_products(upper, lower, 0, lower, C21.data(), stride, a + corner, stride);
  double* inverse_corner = inverse + upper * Eigen::Index(inverse_stride) + upper;
  bad =
      factor_and_invert(lower, a + corner, stride, bounds + upper, inverse_corner, inverse_stride);
  if (bad >= 0) return upper + bad;
  Matrix(inverse_corner - upper, upper, lower, Eigen::OuterStride<>(inverse_stride)).setZero();
  const ConstMatrix X11(inverse, upper, upper, Eigen::OuterStride<>(inverse_stride));
  const ConstMatrix X22(inverse_corner, lower, lower, Eigen::OuterStride<>(inverse_stride));
  const Eigen::MatrixXd product = C21 * X11.triangularView<Eigen::Lower>();
  X21.setZero();
  X21.noalias() -= X22.triangularView<Eigen::Lower>() * product;
  return -1;
}

int factor_pivot(int width, double* a, int stride, const double* bounds, double* inverse) {
  return factor_and_invert(width, a, stride, bounds, inverse, width);
}

}  // namespace

extern const DenseKernels DD_KERNEL_SET;
const DenseKernels DD_KERNEL_SET = {factor_pivot, solve_rows, subtract_products};

}  // namespace dd
