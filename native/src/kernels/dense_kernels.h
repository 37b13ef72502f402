// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace dd {

/// Padding: loads of 4 rows may read up to 3 values past the end of b, y and an inverse. The values
/// are ignored, but must be readable and must not be written concurrently.
constexpr int kReadBeyond = 3;

/// Operations on dense blocks of a factorization, compiled once for each instruction set. Matrices
/// are column-major. Only the lower triangles of A, C and C⁻¹ are used; entries above the diagonal
/// of A may be overwritten.
struct DenseKernels {
  /// A = C Cᵀ in place, width×width. Returns the first column whose pivot, before its square root
  /// is taken, is not above its bound, or -1. inverse ← C⁻¹, width×width with zeros above the
  /// diagonal.
  int (*factor_pivot)(int width, double* a, int stride, const double* bounds, double* inverse);
  /// Y = B C⁻ᵀ, count×width, given C⁻¹.
  void (*solve_rows)(int width, int count, const double* inverse, const double* b, int b_stride,
                     double* y, int y_stride);
  /// A −= Y Yᵀ for the columns first to last − 1 of the lower triangle of A, size×size; Y is
  /// size×width.
  void (*subtract_products)(int width, int size, int first, int last, const double* y, int y_stride,
                            double* a, int a_stride);
};

/// The set of the widest vector instructions that this machine has.
const DenseKernels& dense_kernels();

extern const DenseKernels kBaselineDenseKernels;
#ifdef DD_HAVE_AVX2_KERNELS
extern const DenseKernels kAvx2DenseKernels;
#endif

}  // namespace dd
