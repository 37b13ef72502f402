// SPDX-License-Identifier: GPL-3.0-or-later
// Forward and backward substitution, included once for each instruction set: see kernels_impl.h.
#pragma once

#include "kernels_rows.h"

namespace dd {

namespace {

/// sums[i] = Σ_c values[i·width + c] · rows[c], for `Count` rows of values.
template <int Count, class Real>
inline void dot(int width, int stride, const Real* values, const Real* rows, RowOf<Real>* sums) {
  RowOf<Real> local[Count] = {};
  for (int c = 0; c < width; ++c) {
    const RowOf<Real> x = load(rows + 4 * c);
    for (int i = 0; i < Count; ++i) add_scaled(local[i], values[i * stride + c], x);
  }
  for (int i = 0; i < Count; ++i) sums[i] = local[i];
}

/// rows[c] += Σ_i values[i·width + c] · factors[i].
template <int Count, class Real>
inline void add_products(int width, int stride, const Real* values, const RowOf<Real>* factors,
                         Real* rows) {
  for (int c = 0; c < width; ++c) {
    RowOf<Real> x = load(rows + 4 * c);
    for (int i = 0; i < Count; ++i) add_scaled(x, values[i * stride + c], factors[i]);
    store(rows + 4 * c, x);
  }
}

#ifdef __AVX2__
/// Asks for what is read a little later, where the machine can't tell by itself where the stream goes.
constexpr int64_t kAhead = 6144;  // bytes
inline void fetch(const void* values, int64_t distance) {
  _mm_prefetch(static_cast<const char*>(values) + distance, _MM_HINT_T0);
}

template <int Count>
inline void dot(int width, int stride, const double* values, const double* rows,
                RowOf<double>* sums) {
  __m256d wide[Count];
  for (int i = 0; i < Count; ++i) wide[i] = _mm256_setzero_pd();
  for (int c = 0; c < width; ++c) {
    const __m256d x = _mm256_loadu_pd(rows + 4 * c);
    if ((c & 7) == 0)
      for (int i = 0; i < Count; ++i) fetch(values + i * stride + c, kAhead);
    for (int i = 0; i < Count; ++i)
      wide[i] = _mm256_fmadd_pd(_mm256_broadcast_sd(values + i * stride + c), x, wide[i]);
  }
  for (int i = 0; i < Count; ++i) _mm256_storeu_pd(sums[i].v, wide[i]);
}

template <int Count>
inline void add_products(int width, int stride, const double* values, const RowOf<double>* factors,
                         double* rows) {
  __m256d wide[Count];
  for (int i = 0; i < Count; ++i) wide[i] = _mm256_loadu_pd(factors[i].v);
  for (int c = 0; c < width; ++c) {
    __m256d x = _mm256_loadu_pd(rows + 4 * c);
    if ((c & 7) == 0)
      for (int i = 0; i < Count; ++i) fetch(values + i * stride + c, -kAhead);
    for (int i = 0; i < Count; ++i)
      x = _mm256_fmadd_pd(_mm256_broadcast_sd(values + i * stride + c), wide[i], x);
    _mm256_storeu_pd(rows + 4 * c, x);
  }
}

// Two columns at once: a register of eight holds two rows of x, and each of two values is spread over
// its half.
inline __m256 spread_pair(const float* p) {
  double pair;
  memcpy(&pair, p, sizeof pair);
  return _mm256_permutevar_ps(_mm256_castpd_ps(_mm256_set1_pd(pair)),
                              _mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1));
}

template <int Count>
inline void dot(int width, int stride, const float* values, const float* rows, RowOf<float>* sums) {
  __m256 wide[Count];
  for (int i = 0; i < Count; ++i) wide[i] = _mm256_setzero_ps();
  int c = 0;
  for (; c + 1 < width; c += 2) {
    const __m256 x = _mm256_loadu_ps(rows + 4 * c);
    for (int i = 0; i < Count; ++i)
      wide[i] = _mm256_fmadd_ps(spread_pair(values + i * stride + c), x, wide[i]);
  }
  for (int i = 0; i < Count; ++i) {
    __m128 sum = _mm_add_ps(_mm256_castps256_ps128(wide[i]), _mm256_extractf128_ps(wide[i], 1));
    if (c < width)
      sum =
          _mm_fmadd_ps(_mm_broadcast_ss(values + i * stride + c), _mm_loadu_ps(rows + 4 * c), sum);
    _mm_storeu_ps(sums[i].v, sum);
  }
}

template <int Count>
inline void add_products(int width, int stride, const float* values, const RowOf<float>* factors,
                         float* rows) {
  __m256 wide[Count];
  for (int i = 0; i < Count; ++i)
    wide[i] = _mm256_broadcast_ps(reinterpret_cast<const __m128*>(factors[i].v));
  int c = 0;
  for (; c + 1 < width; c += 2) {
    __m256 x = _mm256_loadu_ps(rows + 4 * c);
    for (int i = 0; i < Count; ++i)
      x = _mm256_fmadd_ps(spread_pair(values + i * stride + c), wide[i], x);
    _mm256_storeu_ps(rows + 4 * c, x);
  }
  if (c < width) {
    __m128 x = _mm_loadu_ps(rows + 4 * c);
    for (int i = 0; i < Count; ++i)
      x = _mm_fmadd_ps(_mm_broadcast_ss(values + i * stride + c), _mm256_castps256_ps128(wide[i]),
                       x);
    _mm_storeu_ps(rows + 4 * c, x);
  }
}
#endif

// Blocks of eight rows below the diagonal, as many as go together stored by columns, on the first
// three of four:
// forward x[slots] −= values · own, backward own −= valuesᵀ · x[slots].
#ifdef __AVX2__
template <int Blocks>
inline void forward_blocks(int width, const float* values, const float* own, const int32_t* slots,
                           float* x) {
  __m256 sums[Blocks][4];
  for (int b = 0; b < Blocks; ++b)
    for (int k = 0; k < 4; ++k) sums[b][k] = _mm256_setzero_ps();
  for (int c = 0; c < width; ++c) {
    __m256 column[Blocks];
    for (int b = 0; b < Blocks; ++b, values += 8) column[b] = _mm256_loadu_ps(values);
    for (int k = 0; k < 3; ++k) {
      const __m256 factor = _mm256_broadcast_ss(own + 4 * c + k);
      for (int b = 0; b < Blocks; ++b) sums[b][k] = _mm256_fmadd_ps(column[b], factor, sums[b][k]);
    }
  }
  for (int b = 0; b < Blocks; ++b, slots += 8) {
    __m256* r = sums[b];
    transpose_quarters(r[0], r[1], r[2], r[3]);
    for (int i = 0; i < 8; ++i) {
      float* p = x + 4 * static_cast<int64_t>(slots[i]);
      const __m128 sum = i < 4 ? _mm256_castps256_ps128(r[i]) : _mm256_extractf128_ps(r[i & 3], 1);
      _mm_storeu_ps(p, _mm_sub_ps(_mm_loadu_ps(p), sum));
    }
  }
}

template <int Blocks>
inline void backward_blocks(int width, const float* values, const float* x, const int32_t* slots,
                            float* own) {
  __m256 rows[Blocks][4];
  for (int b = 0; b < Blocks; ++b, slots += 8) {
    __m256* r = rows[b];
    for (int i = 0; i < 4; ++i)
      r[i] = _mm256_insertf128_ps(
          _mm256_castps128_ps256(_mm_loadu_ps(x + 4 * static_cast<int64_t>(slots[i]))),
          _mm_loadu_ps(x + 4 * static_cast<int64_t>(slots[i + 4])), 1);
    transpose_quarters(r[0], r[1], r[2], r[3]);
  }
  for (int c = 0; c < width; ++c, own += 4) {
    __m256 s[3];
    for (int b = 0; b < Blocks; ++b, values += 8) {
      const __m256 column = _mm256_loadu_ps(values);
      if ((b & 1) == 0) fetch(values, -kAhead);
      for (int k = 0; k < 3; ++k)
        s[k] =
            b == 0 ? _mm256_mul_ps(column, rows[b][k]) : _mm256_fmadd_ps(column, rows[b][k], s[k]);
    }
    const __m256 sums =
        _mm256_hadd_ps(_mm256_hadd_ps(s[0], s[1]), _mm256_hadd_ps(s[2], _mm256_setzero_ps()));
    const __m128 sum = _mm_add_ps(_mm256_castps256_ps128(sums), _mm256_extractf128_ps(sums, 1));
    _mm_storeu_ps(own, _mm_sub_ps(_mm_loadu_ps(own), sum));
  }
}
#else
template <int Blocks>
inline void forward_blocks(int width, const float* values, const float* own, const int32_t* slots,
                           float* x) {
  float sums[3][8 * Blocks] = {};
  for (int c = 0; c < width; ++c, values += 8 * Blocks)
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 8 * Blocks; ++i) sums[k][i] += values[i] * own[4 * c + k];
  for (int i = 0; i < 8 * Blocks; ++i)
    for (int k = 0; k < 3; ++k) x[4 * static_cast<int64_t>(slots[i]) + k] -= sums[k][i];
}

template <int Blocks>
inline void backward_blocks(int width, const float* values, const float* x, const int32_t* slots,
                            float* own) {
  RowOf<float> rows[8 * Blocks];
  for (int i = 0; i < 8 * Blocks; ++i) rows[i] = load(x + 4 * static_cast<int64_t>(slots[i]));
  for (int c = 0; c < width; ++c, values += 8 * Blocks)
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 8 * Blocks; ++i) own[4 * c + k] -= values[i] * rows[i].v[k];
}
#endif

/// Calls body with Most (a power of two), then smaller powers as constants until all of count are done.
template <int Most, class Body>
inline void in_groups(int count, const Body& body) {
  for (; count >= Most; count -= Most) body(Constant<Most>{});
  if constexpr (Most > 2)
    if (count & 2) body(Constant<2>{});
  if (count & 1) body(Constant<1>{});
}

/// The other way round.
template <int Most, class Body>
inline void in_groups_from_end(int count, const Body& body) {
  if (count & 1) body(Constant<1>{});
  if constexpr (Most > 2)
    if (count & 2) body(Constant<2>{});
  for (; count >= Most; count -= Most) body(Constant<Most>{});
}

template <class Real>
void forward(const FactorView<Real>& factor, int first, int last, const double* right, Real* x) {
  for (int s = first; s < last; ++s) {
    const int begin = factor.begin[s], width = factor.begin[s + 1] - begin;
    const Real* values = factor.values + factor.value_begin[s];
    Real* own = x + 4 * static_cast<int64_t>(begin);
    const double* given = right + 4 * static_cast<int64_t>(begin);
    for (int k = 0; k < 4 * width; ++k) own[k] += static_cast<Real>(given[k]);

    // C_ss⁻¹ in place, from its last rows, which need all others.
    RowOf<Real> sums[4];
    const Real* inverse = values + packed_triangle_size(width);
    int j = width;
    const auto solve_group = [&](auto group, int length) {
      constexpr int kCount = decltype(group)::value;
      inverse -= kCount * length;
      j -= kCount;
      dot<kCount>(length, length, inverse, own, sums);
      for (int i = 0; i < kCount; ++i) store(own + 4 * (j + i), sums[i]);
    };
    while (j & 3) solve_group(Constant<1>{}, j);
    while (j > 0) solve_group(Constant<4>{}, j);

    values += packed_triangle_size(width);
    const int32_t* slot = factor.slots + factor.row_begin[s];
    const int height = static_cast<int>(factor.row_begin[s + 1] - factor.row_begin[s]);
    if constexpr (sizeof(Real) == 4) {
      in_groups<4>(height / 8, [&](auto group) {
        constexpr int kCount = decltype(group)::value;
        forward_blocks<kCount>(width, values, own, slot, x);
        slot += 8 * kCount;
        values += 8 * kCount * static_cast<int64_t>(width);
      });
    }
    const int single = sizeof(Real) == 4 ? height & 7 : height;
    in_groups<4>(single, [&](auto group) {
      constexpr int kCount = decltype(group)::value;
      dot<kCount>(width, width, values, own, sums);
      for (int i = 0; i < kCount; ++i) {
        Real* target = x + 4 * static_cast<int64_t>(slot[i]);
        for (int c = 0; c < 4; ++c) target[c] -= sums[i].v[c];
      }
      slot += kCount;
      values += kCount * static_cast<int64_t>(width);
    });
  }
}

template <class Real>
void backward(const FactorView<Real>& factor, int first, int last, Real* x) {
  for (int s = last - 1; s >= first; --s) {
    const int begin = factor.begin[s], width = factor.begin[s + 1] - begin;
    const Real* inverse = factor.values + factor.value_begin[s];
    const int height = static_cast<int>(factor.row_begin[s + 1] - factor.row_begin[s]);
    // From the end, so that all of the factor is read in one descending stream.
    const Real* values =
        inverse + packed_triangle_size(width) + static_cast<int64_t>(height) * width;
    Real* own = x + 4 * static_cast<int64_t>(begin);
    const int32_t* slot = factor.slots + factor.row_begin[s + 1];
    RowOf<Real> factors[4];
    const int single = sizeof(Real) == 4 ? height & 7 : height;
    in_groups_from_end<4>(single, [&](auto group) {
      constexpr int kCount = decltype(group)::value;
      slot -= kCount;
      values -= kCount * static_cast<int64_t>(width);
      for (int i = 0; i < kCount; ++i)
        for (int c = 0; c < 4; ++c) factors[i].v[c] = -x[4 * static_cast<int64_t>(slot[i]) + c];
      add_products<kCount>(width, width, values, factors, own);
    });
    if constexpr (sizeof(Real) == 4) {
      in_groups_from_end<4>(height / 8, [&](auto group) {
        constexpr int kCount = decltype(group)::value;
        slot -= 8 * kCount;
        values -= 8 * kCount * static_cast<int64_t>(width);
        backward_blocks<kCount>(width, values, x, slot, own);
      });
    }

    // C_ss⁻ᵀ in place, from its first columns, which no later one needs.
    int j = 0;
    const auto solve_group = [&](auto group, int length) {
      constexpr int kCount = decltype(group)::value;
      for (int i = 0; i < kCount; ++i) {
        factors[i] = load(own + 4 * (j + i));
        store(own + 4 * (j + i), RowOf<Real>{});
      }
      add_products<kCount>(length, length, inverse, factors, own);
      inverse += kCount * length;
      j += kCount;
    };
    while (j + 4 <= width) solve_group(Constant<4>{}, j + 4);
    while (j < width) solve_group(Constant<1>{}, j + 1);
  }
}

}  // namespace

}  // namespace dd
