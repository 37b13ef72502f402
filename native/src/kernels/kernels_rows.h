// SPDX-License-Identifier: GPL-3.0-or-later
// Rows of four values, shared by all kernels, included once for each instruction set: see
// kernels_impl.h.
#pragma once

#include <math.h>
#include <string.h>
#ifdef __AVX2__
#include <immintrin.h>
#endif

#include "kernels/kernels.h"

namespace dd {

namespace {

/// A compile-time integer as an argument of generic lambdas.
template <int Value>
struct Constant {
  static constexpr int value = Value;
};

/// A row of four values, which compilers keep in one or two vector registers.
template <class Real>
struct RowOf {
  Real v[4];
};
using Row = RowOf<double>;

template <class Real>
inline RowOf<Real> load(const Real* p) {
  RowOf<Real> r;
  for (int c = 0; c < 4; ++c) r.v[c] = p[c];
  return r;
}

template <class Real>
inline void store(Real* p, const RowOf<Real>& r) {
  for (int c = 0; c < 4; ++c) p[c] = r.v[c];
}

template <class Real>
inline void add_scaled(RowOf<Real>& r, Real factor, const RowOf<Real>& x) {
  for (int c = 0; c < 4; ++c) r.v[c] += factor * x.v[c];
}

#ifdef __AVX2__
/// Transposes the two 4×4 matrices in the lower and in the upper halves of a, b, c, d.
inline void transpose_quarters(__m256& a, __m256& b, __m256& c, __m256& d) {
  const __m256 ab = _mm256_unpacklo_ps(a, b), AB = _mm256_unpackhi_ps(a, b);
  const __m256 cd = _mm256_unpacklo_ps(c, d), CD = _mm256_unpackhi_ps(c, d);
  a = _mm256_shuffle_ps(ab, cd, 0x44);
  b = _mm256_shuffle_ps(ab, cd, 0xEE);
  c = _mm256_shuffle_ps(AB, CD, 0x44);
  d = _mm256_shuffle_ps(AB, CD, 0xEE);
}
#endif

}  // namespace

}  // namespace dd
