// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace dd {

/// Padding: loads may read up to so many values past the end of b, y and an inverse. The values are
/// ignored, but must be readable and must not be written concurrently.
constexpr int kReadBeyond = 3;

/// Dense blocks of a factorization, compiled once for each instruction set. Matrices are stored
/// column by column. Only their lower triangles are used; entries above the diagonal may be
/// overwritten.
struct DenseKernels {
  /// A = C Cᵀ in place, width×width. Returns the first column whose pivot, before the root, is not
  /// above its bound, or -1. inverse ← C⁻¹, width×width with zeros above the diagonal.
  int (*factor_pivot)(int width, double* a, int stride, const double* bounds, double* inverse);
  /// Y = B C⁻ᵀ, count×width.
  void (*solve_rows)(int width, int count, const double* inverse, const double* b, int b_stride,
                     double* y, int y_stride);
  /// The columns first to last of the lower triangle of A −= Y Yᵀ, size×size.
  void (*subtract_products)(int width, int size, int first, int last, const double* y, int y_stride,
                            double* a, int a_stride);
};

/// The widest set that this machine can run.
const DenseKernels& dense_kernels();

extern const DenseKernels kBaselineDenseKernels;
#ifdef DD_HAVE_AVX2_KERNELS
extern const DenseKernels kAvx2DenseKernels;
#endif

}  // namespace dd
