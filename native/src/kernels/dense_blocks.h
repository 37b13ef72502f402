// SPDX-License-Identifier: GPL-3.0-or-later
// Cholesky factors, inverses and products of small dense matrices, included once for each
// instruction set: see dense_kernels_impl.h. Operands that fit into the nearest caches are
// multiplied in place: packing them into panels, as general libraries do, takes as long as the
// product itself.
#pragma once

#include "kernels/dense_kernels.h"
#include "kernels/kernels_rows.h"

namespace dd {

namespace {

using FourRows = Eigen::Array4d;

/// Blocks of 4 rows that are accumulated together. Derived: with 4 columns, 3 blocks take 12 sums,
/// 3 operands and 1 factor, all of AVX2's 16 registers.
#ifdef __AVX2__
constexpr int kRowBlocksAtOnce = 3;
#else
constexpr int kRowBlocksAtOnce = 1;
#endif
static_assert(kRowBlocksAtOnce <= 3, "each_four() has three sizes");

/// A block of a column-major matrix, or of its transpose.
struct MatrixView {
  const double* values;
  Eigen::Index row_step, column_step;

  static MatrixView of(const double* values, int stride) { return {values, 1, stride}; }
  static MatrixView transposed(const double* values, int stride) { return {values, stride, 1}; }
};

/// P Qᵀ for 4·RowBlocks rows of P, from p on, and up to 4 rows of Q, of inner dimension count.
/// Calls give(f, sums) for each block of 4 rows; sums beyond `columns` are to be ignored.
template <int RowBlocks, class Give>
inline void products(int count, const double* p, int stride, MatrixView q, int columns,
                     const Give& give) {
  const double* row[4];
  for (int j = 0; j < 4; ++j) row[j] = q.values + (j < columns ? j : columns - 1) * q.row_step;
  FourRows sums[RowBlocks][4];
  for (int f = 0; f < RowBlocks; ++f)
    for (int j = 0; j < 4; ++j) sums[f][j].setZero();
  for (int k = 0; k < count; ++k, p += stride) {
    FourRows column[RowBlocks];
    for (int f = 0; f < RowBlocks; ++f) column[f] = Eigen::Map<const FourRows>(p + 4 * f);
    for (int j = 0; j < 4; ++j) {
      const FourRows factor = FourRows::Constant(*row[j]);
      row[j] += q.column_step;
      for (int f = 0; f < RowBlocks; ++f) sums[f][j] += column[f] * factor;
    }
  }
  for (int f = 0; f < RowBlocks; ++f) give(f, sums[f]);
}

/// Computes rows begin to end − 1 of up to four columns of P Qᵀ, 4 rows at a time, and calls
/// give(first row, number of rows, products) for each 4. count(end) returns how many columns of P
/// and Q are multiplied for rows before `end`: all of them, or fewer where P is triangular. The
/// last 4 rows may extend beyond P: see kReadBeyond.
template <class Count, class Give>
inline void each_four(int begin, int end, const Count& count, const double* p, int stride,
                      MatrixView q, int columns, const Give& give) {
  int i = begin;
  const auto go = [&](auto row_blocks) {
    constexpr int kRows = 4 * decltype(row_blocks)::value;
    products<decltype(row_blocks)::value>(count(i + kRows), p + i, stride, q, columns,
                                          [&](int f, const FourRows* sums) {
                                            const int row = i + 4 * f;
                                            give(row, end - row < 4 ? end - row : 4, sums);
                                          });
    i += kRows;
  };
  while (end - i > 4 * (kRowBlocksAtOnce - 1)) go(Constant<kRowBlocksAtOnce>());
  if (kRowBlocksAtOnce > 2 && end - i > 4) go(Constant<2>());
  if (end - i > 0) go(Constant<1>());
}

/// Calls write(target, value) for the first `rows` rows of each column.
template <class Write>
inline void write_fours(double* target, int stride, int columns, const FourRows* values, int rows,
                        const Write& write) {
  for (int c = 0; c < columns; ++c, target += stride) {
    if (rows == 4) {
      Eigen::Map<FourRows> all(target);
      write(all, values[c]);
    } else {
      for (int r = 0; r < rows; ++r) write(target[r], values[c][r]);
    }
  }
}
struct Assign {
  template <class Target, class Value>
  void operator()(Target& target, const Value& value) const {
    target = value;
  }
};
struct Subtract {
  template <class Target, class Value>
  void operator()(Target& target, const Value& value) const {
    target -= value;
  }
};

/// A lower triangular 4×4 diagonal block D, filled up with columns of the identity.
struct Corner {
  double value[4][4];  // row, column
  double inverse[4];   // reciprocals of the diagonal
};

/// R ← R D⁻ᵀ for four rows, r its columns.
inline void solve_by_transposed(const Corner& d, FourRows* r) {
  for (int j = 0; j < 4; ++j) {
    for (int k = 0; k < j; ++k) r[j] -= r[k] * d.value[j][k];
    r[j] *= d.inverse[j];
  }
}
/// R ← R D⁻¹.
inline void solve_by(const Corner& d, FourRows* r) {
  for (int j = 3; j >= 0; --j) {
    for (int k = j + 1; k < 4; ++k) r[j] -= r[k] * d.value[k][j];
    r[j] *= d.inverse[j];
  }
}

inline Corner corner_of(const double* a, int stride, int columns) {
  Corner d = {};
  for (int j = 0; j < 4; ++j) {
    if (j < columns)
      for (int i = j; i < columns; ++i) d.value[i][j] = a[Eigen::Index(j) * stride + i];
    else
      d.value[j][j] = 1;
    d.inverse[j] = 1 / d.value[j][j];
  }
  return d;
}

/// DenseKernels::factor_pivot without the inverse: left-looking, four columns at a time.
inline int factor_small(int width, double* a, int stride, const double* bounds) {
  const auto at = [&](int row, int column) { return a + Eigen::Index(column) * stride + row; };
  for (int j = 0; j < width; j += 4) {
    const int columns = width - j < 4 ? width - j : 4;
    const MatrixView q = MatrixView::of(a + j, stride);
    const auto count = [j](int) { return j; };
    each_four(j, j + columns, count, a, stride, q, columns,
              [&](int, int rows, const FourRows* sums) {
                write_fours(at(j, j), stride, columns, sums, rows, Subtract());
              });
    for (int k = j; k < j + columns; ++k) {
      const double pivot = *at(k, k);
      // Also refuses infinity and NaN. Safety: squares of what is divided by its root stay finite.
      if (!(pivot > bounds[k]) || !(pivot < 1e300)) return k;
      const double root = Eigen::numext::sqrt(pivot);
      *at(k, k) = root;
      for (int i = k + 1; i < j + columns; ++i) *at(i, k) /= root;
      for (int c = k + 1; c < j + columns; ++c)
        for (int i = c; i < j + columns; ++i) *at(i, c) -= *at(c, k) * *at(i, k);
    }
    if (columns < 4) break;
    const Corner d = corner_of(at(j, j), stride, columns);
    each_four(j + 4, width, count, a, stride, q, 4, [&](int i, int rows, const FourRows* sums) {
      FourRows r[4];
      for (int c = 0; c < 4; ++c) r[c] = Eigen::Map<const FourRows>(at(i, j + c)) - sums[c];
      solve_by_transposed(d, r);
      write_fours(at(i, j), stride, 4, r, rows, Assign());
    });
  }
  return -1;
}

/// inverse ← C⁻¹ with zeros above the diagonal: solves X C = I, four columns at a time, the last
/// ones first.
inline void invert_small(int width, const double* c, int stride, double* inverse,
                         int inverse_stride) {
  for (int k = 0; k < width; ++k)
    for (int i = 0; i < width; ++i) inverse[Eigen::Index(k) * inverse_stride + i] = 0;
  for (int j = (width - 1) / 4 * 4; j >= 0; j -= 4) {
    const int columns = width - j < 4 ? width - j : 4, next = j + columns;
    const Corner d = corner_of(c + Eigen::Index(j) * stride + j, stride, columns);
    const auto put = [&](int i, int rows, FourRows* r) {
      solve_by(d, r);
      write_fours(inverse + Eigen::Index(j) * inverse_stride + i, inverse_stride, columns, r, rows,
                  Assign());
    };
    FourRows one[4];
    for (int k = 0; k < 4; ++k) {
      one[k].setZero();
      one[k][k] = 1;
    }
    put(j, columns, one);
    each_four(
        next, width, [&](int rows) { return (rows < width ? rows : width) - next; },
        inverse + Eigen::Index(next) * inverse_stride, inverse_stride,
        MatrixView::transposed(c + Eigen::Index(j) * stride + next, stride), columns,
        [&](int i, int rows, const FourRows* sums) {
          FourRows r[4];
          for (int k = 0; k < 4; ++k) r[k] = -sums[k];
          put(i, rows, r);
        });
  }
}

/// See DenseKernels::solve_rows.
inline void solve_small(int width, int count, const double* inverse, int inverse_stride,
                        const double* b, int b_stride, double* y, int y_stride) {
  for (int j = 0; j < width; j += 4) {
    const int columns = width - j < 4 ? width - j : 4;
    each_four(
        0, count, [&](int) { return j + columns; }, b, b_stride,
        MatrixView::of(inverse + j, inverse_stride), columns,
        [&](int i, int rows, const FourRows* sums) {
          write_fours(y + Eigen::Index(j) * y_stride + i, y_stride, columns, sums, rows, Assign());
        });
  }
}

/// See DenseKernels::subtract_products.
inline void subtract_small(int width, int size, int first, int last, const double* y, int y_stride,
                           double* a, int a_stride) {
  for (int j = first; j < last; j += 4) {
    const int columns = last - j < 4 ? last - j : 4;
    each_four(
        j, size, [&](int) { return width; }, y, y_stride, MatrixView::of(y + j, y_stride), columns,
        [&](int i, int rows, const FourRows* sums) {
          write_fours(a + Eigen::Index(j) * a_stride + i, a_stride, columns, sums, rows,
                      Subtract());
        });
  }
}

}  // namespace

}  // namespace dd
