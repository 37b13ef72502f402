// SPDX-License-Identifier: GPL-3.0-or-later
// Forward and backward substitution, included once for each instruction set: see kernels_impl.h.
#pragma once

#include "kernels/kernels_rows.h"

namespace dd {

namespace {

// A row of x, four values, in a register.
#ifdef __AVX2__
inline __m128 get(const float* p) { return _mm_loadu_ps(p); }
inline __m256d get(const double* p) { return _mm256_loadu_pd(p); }
inline void put(float* p, __m128 x) { _mm_storeu_ps(p, x); }
inline void put(double* p, __m256d x) { _mm256_storeu_pd(p, x); }
inline __m128 minus(__m128 a, __m128 b) { return _mm_sub_ps(a, b); }
inline __m256d minus(__m256d a, __m256d b) { return _mm256_sub_pd(a, b); }
inline __m128 plus_product(__m128 sum, const float* factor, __m128 x) {
  return _mm_fmadd_ps(_mm_broadcast_ss(factor), x, sum);
}
inline __m256d plus_product(__m256d sum, const double* factor, __m256d x) {
  return _mm256_fmadd_pd(_mm256_broadcast_sd(factor), x, sum);
}
#else
template <class Real>
inline RowOf<Real> get(const Real* p) {
  return load(p);
}
template <class Real>
inline void put(Real* p, const RowOf<Real>& x) {
  store(p, x);
}
template <class Real>
inline RowOf<Real> minus(RowOf<Real> a, const RowOf<Real>& b) {
  for (int c = 0; c < 4; ++c) a.v[c] -= b.v[c];
  return a;
}
template <class Real>
inline RowOf<Real> plus_product(RowOf<Real> sum, const Real* factor, const RowOf<Real>& x) {
  add_scaled(sum, *factor, x);
  return sum;
}
#endif

template <class Real>
constexpr Real kZeros[4] = {};
template <class Real>
using RowRegister = decltype(get(kZeros<Real>));

// The forward products below read their values in storage order, the backward ones in exactly the
// reverse order: memory streams nearly twice as fast in one direction (at 250,000 vertices a solve
// took 4.3 ms in place of 7.5).

/// Calls target(i, Σ_c values[c·Count + i] · own[c]) for `Count` rows of values.
template <int Count, class Real, class Target>
inline void forward_rows(int width, const Real* values, const Real* own, const Target& target) {
  RowRegister<Real> sums[Count];
  for (int i = 0; i < Count; ++i) sums[i] = get(kZeros<Real>);
  for (int c = 0; c < width; ++c, values += Count) {
    const RowRegister<Real> x = get(own + 4 * c);
    for (int i = 0; i < Count; ++i) sums[i] = plus_product(sums[i], values + i, x);
  }
  for (int i = 0; i < Count; ++i) target(i, sums[i]);
}

/// own[c] −= Σ_i values[c·Count + i] · source(i).
template <int Count, class Real, class Source>
inline void backward_rows(int width, const Real* values, const Source& source, Real* own) {
  RowRegister<Real> rows[Count];
  for (int i = 0; i < Count; ++i) rows[i] = source(i);
  values += Count * static_cast<int64_t>(width);
  for (int c = width - 1; c >= 0; --c) {
    values -= Count;
    RowRegister<Real> sum = get(kZeros<Real>);
    for (int i = 0; i < Count; ++i) sum = plus_product(sum, values + i, rows[i]);
    put(own + 4 * c, minus(get(own + 4 * c), sum));
  }
}

// The same for blocks of eight rows, for the first `Columns` of four columns of x.
#ifdef __AVX2__
/// Blocks that are computed together. Derived: their Columns × Blocks sums and the operands must
/// fit into AVX2's 16 registers.
template <int Columns, int Blocks>
constexpr int kBlocksAtOnce = Columns == 4 && Blocks > 2 ? 2 : Blocks;

template <int Columns, int Blocks, class Target>
inline void forward_blocks(int width, const float* values, const float* own, const Target& target) {
  constexpr int kCount = kBlocksAtOnce<Columns, Blocks>;
  for (int first = 0; first < Blocks; first += kCount) {
    __m256 sums[kCount][4];
    for (int b = 0; b < kCount; ++b)
      for (int k = 0; k < 4; ++k) sums[b][k] = _mm256_setzero_ps();
    const float* next = values + 8 * first;
    for (int c = 0; c < width; ++c, next += 8 * Blocks) {
      __m256 column[kCount];
      for (int b = 0; b < kCount; ++b) column[b] = _mm256_loadu_ps(next + 8 * b);
      for (int k = 0; k < Columns; ++k) {
        const __m256 factor = _mm256_broadcast_ss(own + 4 * c + k);
        for (int b = 0; b < kCount; ++b)
          sums[b][k] = _mm256_fmadd_ps(column[b], factor, sums[b][k]);
      }
    }
    for (int b = 0; b < kCount; ++b) {
      __m256* r = sums[b];
      const int row = 8 * (first + b);
      transpose_quarters(r[0], r[1], r[2], r[3]);
      for (int i = 0; i < 4; ++i) target(row + i, _mm256_castps256_ps128(r[i]));
      for (int i = 0; i < 4; ++i) target(row + 4 + i, _mm256_extractf128_ps(r[i], 1));
    }
  }
}

template <int Columns, int Blocks, class Source>
inline void backward_blocks(int width, const float* values, const Source& source, float* own) {
  constexpr int kCount = kBlocksAtOnce<Columns, Blocks>;
  for (int first = Blocks - kCount; first >= 0; first -= kCount) {
    __m256 rows[kCount][4];
    for (int b = 0; b < kCount; ++b) {
      __m256* r = rows[b];
      const int row = 8 * (first + b);
      for (int i = 0; i < 4; ++i)
        r[i] =
            _mm256_insertf128_ps(_mm256_castps128_ps256(source(row + i)), source(row + 4 + i), 1);
      transpose_quarters(r[0], r[1], r[2], r[3]);
    }
    const float* next = values + 8 * first + 8 * Blocks * static_cast<int64_t>(width);
    for (int c = width - 1; c >= 0; --c) {
      next -= 8 * Blocks;
      __m256 s[4];
      for (int b = kCount - 1; b >= 0; --b) {
        const __m256 column = _mm256_loadu_ps(next + 8 * b);
        for (int k = 0; k < Columns; ++k)
          s[k] = b == kCount - 1 ? _mm256_mul_ps(column, rows[b][k])
                                 : _mm256_fmadd_ps(column, rows[b][k], s[k]);
      }
      if constexpr (Columns < 4) s[3] = _mm256_setzero_ps();
      const __m256 sums = _mm256_hadd_ps(_mm256_hadd_ps(s[0], s[1]), _mm256_hadd_ps(s[2], s[3]));
      const __m128 sum = _mm_add_ps(_mm256_castps256_ps128(sums), _mm256_extractf128_ps(sums, 1));
      put(own + 4 * c, minus(get(own + 4 * c), sum));
    }
  }
}
#else
template <int Columns, int Blocks, class Target>
inline void forward_blocks(int width, const float* values, const float* own, const Target& target) {
  float sums[4][8 * Blocks] = {};
  for (int c = 0; c < width; ++c, values += 8 * Blocks)
    for (int k = 0; k < Columns; ++k)
      for (int i = 0; i < 8 * Blocks; ++i) sums[k][i] += values[i] * own[4 * c + k];
  for (int i = 0; i < 8 * Blocks; ++i)
    target(i, RowOf<float>{{sums[0][i], sums[1][i], sums[2][i], sums[3][i]}});
}

template <int Columns, int Blocks, class Source>
inline void backward_blocks(int width, const float* values, const Source& source, float* own) {
  RowOf<float> rows[8 * Blocks];
  for (int i = 0; i < 8 * Blocks; ++i) rows[i] = source(i);
  values += 8 * Blocks * static_cast<int64_t>(width);
  for (int c = width - 1; c >= 0; --c) {
    values -= 8 * Blocks;
    for (int k = 0; k < Columns; ++k)
      for (int i = 0; i < 8 * Blocks; ++i) own[4 * c + k] -= values[i] * rows[i].v[k];
  }
}
#endif

/// Calls body(Constant<rows>) for each group of rows_together(), from the largest to the smallest.
template <int Most, class Body>
inline void in_groups(int count, const Body& body) {
  for (; count >= Most; count -= Most) body(Constant<Most>{});
  if constexpr (Most > 1) in_groups<Most / 2>(count, body);
}

/// The same in reverse order.
template <int Most, class Body>
inline void in_groups_from_end(int count, const Body& body) {
  if constexpr (Most > 1) in_groups_from_end<Most / 2>(count % Most, body);
  for (; count >= Most; count -= Most) body(Constant<Most>{});
}

/// Forward and backward products of a group of `Count` rows.
template <int Columns, int Count, class Real, class Target>
inline void forward_group(int width, const Real* values, const Real* own, const Target& target) {
  if constexpr (Count % 8 == 0)
    forward_blocks<Columns, Count / 8>(width, values, own, target);
  else
    forward_rows<Count>(width, values, own, target);
}
template <int Columns, int Count, class Real, class Source>
inline void backward_group(int width, const Real* values, const Source& source, Real* own) {
  if constexpr (Count % 8 == 0)
    backward_blocks<Columns, Count / 8>(width, values, source, own);
  else
    backward_rows<Count>(width, values, source, own);
}

/// Returns at the first non-zero value.
template <class Real>
inline bool all_zero(const Real* values, int count) {
  for (int k = 0; k < count; ++k)
    if (values[k] != 0) return false;
  return true;
}

template <int Columns, class Real>
void forward(const FactorView<Real>& factor, int first, int last, const double* right, Real* x) {
  for (int s = first; s < last; ++s) {
    const int begin = factor.begin[s], width = factor.begin[s + 1] - begin;
    const Real* values = factor.values + factor.value_begin[s];
    Real* own = x + 4 * static_cast<int64_t>(begin);
    const double* given = right + 4 * static_cast<int64_t>(begin);
    for (int k = 0; k < 4 * width; ++k) own[k] += static_cast<Real>(given[k]);
    // Skips supernodes that a sparse right-hand side doesn't reach in the elimination tree.
    if (all_zero(own, 4 * width)) continue;

    // Multiplies by C_ss⁻¹ in place, from its last rows on: row i reads the values up to i only.
    int j = width;
    in_groups<kTriangleRows<Real>>(width, [&](auto group) {
      constexpr int kCount = decltype(group)::value;
      const Real* rows = values;
      values += kCount * j;
      j -= kCount;
      forward_group<Columns, kCount>(
          j + kCount, rows, own,
          [&](int i, const RowRegister<Real>& sum) { put(own + 4 * (j + i), sum); });
    });

    const int32_t* slot = factor.slotted_rows + factor.row_begin[s];
    const int height = static_cast<int>(factor.row_begin[s + 1] - factor.row_begin[s]);
    in_groups<kRowsBelow<Real>>(height, [&](auto group) {
      constexpr int kCount = decltype(group)::value;
      forward_group<Columns, kCount>(width, values, own, [&](int i, const RowRegister<Real>& sum) {
        Real* row = x + 4 * static_cast<int64_t>(slot[i]);
        put(row, minus(get(row), sum));
      });
      slot += kCount;
      values += kCount * static_cast<int64_t>(width);
    });
  }
}

template <int Columns, class Real>
void backward(const FactorView<Real>& factor, int first, int last, Real* x) {
  for (int s = last - 1; s >= first; --s) {
    const int begin = factor.begin[s], width = factor.begin[s + 1] - begin;
    const int height = static_cast<int>(factor.row_begin[s + 1] - factor.row_begin[s]);
    const Real* values = factor.values + factor.value_begin[s + 1];
    Real* own = x + 4 * static_cast<int64_t>(begin);
    const int32_t* slot = factor.slotted_rows + factor.row_begin[s + 1];
    in_groups_from_end<kRowsBelow<Real>>(height, [&](auto group) {
      constexpr int kCount = decltype(group)::value;
      slot -= kCount;
      values -= kCount * static_cast<int64_t>(width);
      backward_group<Columns, kCount>(
          width, values, [&](int i) { return get(x + 4 * static_cast<int64_t>(slot[i])); }, own);
    });

    // Multiplies by C_ss⁻ᵀ in place, from the first rows of C_ss⁻¹ on: row i changes the values up
    // to i only.
    int j = 0;
    in_groups_from_end<kTriangleRows<Real>>(width, [&](auto group) {
      constexpr int kCount = decltype(group)::value;
      values -= kCount * (j + kCount);
      backward_group<Columns, kCount>(
          j + kCount, values,
          [&](int i) {
            Real* row = own + 4 * (j + i);
            const RowRegister<Real> value = minus(get(kZeros<Real>), get(row));
            put(row, get(kZeros<Real>));
            return value;
          },
          own);
      j += kCount;
    });
  }
}

}  // namespace

}  // namespace dd
