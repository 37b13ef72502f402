// SPDX-License-Identifier: GPL-3.0-or-later
// The passes over vertices and triangles of a frame, included once for each instruction set: see
// kernels_impl.h.
#pragma once

#include "kernels/kernels_rows.h"

namespace dd {

namespace {

/// `RowsAtOnce` rows at once: independent sums hide the latency of each sum's multiply-adds.
template <int RowsAtOnce>
inline void blend_rows(int term_count, const double* weights, const double* coefficients,
                       const double* rest, double* out) {
#ifdef __AVX2__
  // By intrinsics, as compilers keep an array of rows in memory.
  __m256d sums[RowsAtOnce];
  for (int r = 0; r < RowsAtOnce; ++r) sums[r] = _mm256_loadu_pd(rest + 4 * r);
  for (int k = 0; k < term_count; ++k) {
    const __m256d c = _mm256_loadu_pd(coefficients + 4 * k);
    for (int r = 0; r < RowsAtOnce; ++r) {
      const double* weight = weights + static_cast<int64_t>(r) * term_count + k;
      sums[r] = _mm256_fmadd_pd(_mm256_broadcast_sd(weight), c, sums[r]);
    }
  }
  for (int r = 0; r < RowsAtOnce; ++r) _mm256_storeu_pd(out + 4 * r, sums[r]);
#else
  for (int r = 0; r < RowsAtOnce; ++r) {
    Row sum = load(rest + 4 * r);
    const double* w = weights + static_cast<int64_t>(r) * term_count;
    for (int k = 0; k < term_count; ++k) add_scaled(sum, w[k], load(coefficients + 4 * k));
    store(out + 4 * r, sum);
  }
#endif
}

void blend(int row_count, int term_count, const double* weights, const double* coefficients,
           const double* rest, double* out) {
  constexpr int kRowsAtOnce = 8;  // rows: see blend_rows()
  int64_t r = 0;
  for (; r + kRowsAtOnce <= row_count; r += kRowsAtOnce)
    blend_rows<kRowsAtOnce>(term_count, weights + r * term_count, coefficients, rest + 4 * r,
                            out + 4 * r);
  for (; r < row_count; ++r)
    blend_rows<1>(term_count, weights + r * term_count, coefficients, rest + 4 * r, out + 4 * r);
}

/// Squares below this count as this before their root is taken: squared lengths and areas in units
/// of the triangle's |e1| at rest, and squared lengths of quaternions. Safety: the direction of a
/// zero vector is zero, so collapsed triangles give finite values.
template <class Real>
constexpr Real kMinSquare = static_cast<Real>(sizeof(Real) == 4 ? 1e-30 : 1e-280);

inline float square_root(float x) { return sqrtf(x); }
inline double square_root(double x) { return sqrt(x); }

template <class Real>
inline Real guarded_inverse_sqrt(Real x) {
  return 1 / square_root(x > kMinSquare<Real> ? x : kMinSquare<Real>);
}

/// A value for each triangle of a block.
template <class Real>
using Lanes = Real[kLanes];

/// Two edges of each lane's triangle, from its first corner.
template <class Real>
struct TriangleEdges {
  Lanes<Real> first[3], second[3];
};

/// Subtracts in double whatever Real is: edges are small compared with positions.
template <class Real>
inline void gather_edges(const int32_t (&source)[3][kLanes], const double* positions,
                         TriangleEdges<Real>& edges) {
  for (int lane = 0; lane < kLanes; ++lane) {
    const double* p0 = positions + 4 * static_cast<int64_t>(source[0][lane]);
    const double* p1 = positions + 4 * static_cast<int64_t>(source[1][lane]);
    const double* p2 = positions + 4 * static_cast<int64_t>(source[2][lane]);
    for (int c = 0; c < 3; ++c) {
      edges.first[c][lane] = static_cast<Real>(p1[c] - p0[c]);
      edges.second[c][lane] = static_cast<Real>(p2[c] - p0[c]);
    }
  }
}

/// Adds the flux of corners 0 and 1 to their rows and subtracts both from corner 2's, as a
/// triangle's fluxes sum to zero.
template <class Real>
inline void scatter(const int32_t (&target)[3][kLanes], const Real (&flux)[2][3][kLanes],
                    double* right_hand_side) {
  for (int lane = 0; lane < kLanes; ++lane) {
    double* r0 = right_hand_side + 4 * static_cast<int64_t>(target[0][lane]);
    double* r1 = right_hand_side + 4 * static_cast<int64_t>(target[1][lane]);
    double* r2 = right_hand_side + 4 * static_cast<int64_t>(target[2][lane]);
    for (int c = 0; c < 3; ++c) {
      r0[c] += flux[0][c][lane];
      r1[c] += flux[1][c][lane];
      r2[c] -= flux[0][c][lane] + flux[1][c][lane];
    }
  }
}

#ifdef __AVX2__
/// Transposes eight rows of four to arrays of eight x, y and z.
inline void transpose_to_lanes(const __m128 (&rows)[kLanes], float (*lanes)[kLanes]) {
  __m256 r[4];
  for (int i = 0; i < 4; ++i)
    r[i] = _mm256_insertf128_ps(_mm256_castps128_ps256(rows[i]), rows[i + 4], 1);
  transpose_quarters(r[0], r[1], r[2], r[3]);
  for (int c = 0; c < 3; ++c) _mm256_storeu_ps(lanes[c], r[c]);
}

inline void gather_edges(const int32_t (&source)[3][kLanes], const double* positions,
                         TriangleEdges<float>& edges) {
  __m128 first[kLanes], second[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) {
    const __m256d p0 = _mm256_loadu_pd(positions + 4 * static_cast<int64_t>(source[0][lane]));
    const __m256d p1 = _mm256_loadu_pd(positions + 4 * static_cast<int64_t>(source[1][lane]));
    const __m256d p2 = _mm256_loadu_pd(positions + 4 * static_cast<int64_t>(source[2][lane]));
    first[lane] = _mm256_cvtpd_ps(_mm256_sub_pd(p1, p0));
    second[lane] = _mm256_cvtpd_ps(_mm256_sub_pd(p2, p0));
  }
  transpose_to_lanes(first, edges.first);
  transpose_to_lanes(second, edges.second);
}

inline void scatter(const int32_t (&target)[3][kLanes], const float (&flux)[2][3][kLanes],
                    double* right_hand_side) {
  __m256 r[2][4];
  for (int k = 0; k < 2; ++k) {
    for (int c = 0; c < 3; ++c) r[k][c] = _mm256_loadu_ps(flux[k][c]);
    r[k][3] = _mm256_setzero_ps();
    transpose_quarters(r[k][0], r[k][1], r[k][2], r[k][3]);
  }
  const auto add = [&](int corner, int lane, __m256d value) {
    double* row = right_hand_side + 4 * static_cast<int64_t>(target[corner][lane]);
    _mm256_storeu_pd(row, _mm256_add_pd(_mm256_loadu_pd(row), value));
  };
  for (int lane = 0; lane < kLanes; ++lane) {
    const auto part = [&](int k) {
      return _mm256_cvtps_pd(lane < 4 ? _mm256_castps256_ps128(r[k][lane])
                                      : _mm256_extractf128_ps(r[k][lane & 3], 1));
    };
    const __m256d first = part(0), second = part(1);
    add(0, lane, first);
    add(1, lane, second);
    add(2, lane, _mm256_sub_pd(_mm256_setzero_pd(), _mm256_add_pd(first, second)));
  }
}
#endif

/// A lane's triangle in the current pose: the axes t = e1/|e1|, b = n × t and n, and the upper
/// triangular matrix [a s; 0 d] from its rest shape to its current shape in these axes.
template <class Real>
struct CurrentTriangle {
  Real tx, ty, tz, bx, by, bz, nx, ny, nz, a, s, d;
};

template <class Real>
inline CurrentTriangle<Real> current_triangle(const TriangleEdges<Real>& edges,
                                              const TriangleShape<Real>& shape, int lane) {
  const Real unit = shape.inverse_length[lane];
  const Real x1 = unit * edges.first[0][lane], y1 = unit * edges.first[1][lane],
             z1 = unit * edges.first[2][lane];
  const Real x2 = unit * edges.second[0][lane], y2 = unit * edges.second[1][lane],
             z2 = unit * edges.second[2][lane];
  const Real l2 = x1 * x1 + y1 * y1 + z1 * z1;
  const Real inv_l = guarded_inverse_sqrt(l2);
  const Real tx = x1 * inv_l, ty = y1 * inv_l, tz = z1 * inv_l;
  const Real cx = y1 * z2 - z1 * y2, cy = z1 * x2 - x1 * z2, cz = x1 * y2 - y1 * x2;
  const Real n2 = cx * cx + cy * cy + cz * cz;
  const Real inv_n = guarded_inverse_sqrt(n2);
  const Real nx = cx * inv_n, ny = cy * inv_n, nz = cz * inv_n;
  const Real length = l2 * inv_l, along = tx * x2 + ty * y2 + tz * z2, height = n2 * inv_n * inv_l;
  const Real stretch = shape.inverse_height[lane];
  return {tx,
          ty,
          tz,
          ny * tz - nz * ty,
          nz * tx - nx * tz,
          nx * ty - ny * tx,
          nx,
          ny,
          nz,
          length,
          along * stretch - length * shape.shear[lane],
          height * stretch};
}

/// RotationOnly is a template parameter because compilers vectorize the loop over lanes only if it
/// has no branch.
template <bool RotationOnly, class Real>
void gradient_pass_as(int block_count, const TriangleBlock<Real>* blocks, const double* base,
                      double* right_hand_side) {
  for (int b = 0; b < block_count; ++b) {
    const TriangleBlock<Real>& block = blocks[b];
    TriangleEdges<Real> edges;
    gather_edges(block.source, base, edges);

    // S_j maps the triangle's rest frame (t1, t2, n) to the current one (t1', t2', n'), the plane
    // by the upper triangular 2×2 matrix [a s; 0 d]. The rotation in its polar decomposition
    // follows from that of the 2×2 matrix, in closed form, with determinant +1.
    Real flux[2][3][kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      const CurrentTriangle<Real> now = current_triangle(edges, block.shape, lane);
      Real a = now.a, s = now.s, d = now.d, q = 0;
      if (RotationOnly) {
        const Real cosine = a + d;
        const Real scale = guarded_inverse_sqrt(cosine * cosine + s * s);
        a = d = cosine * scale;
        s *= scale;
        q = -s;
      }
      for (int corner = 0; corner < 2; ++corner) {
        const Real u = block.flux[corner][0][lane], v = block.flux[corner][1][lane],
                   w = block.flux[corner][2][lane];
        const Real f = a * u + s * v, g = q * u + d * v;
        flux[corner][0][lane] = now.tx * f + now.bx * g + now.nx * w;
        flux[corner][1][lane] = now.ty * f + now.by * g + now.ny * w;
        flux[corner][2][lane] = now.tz * f + now.bz * g + now.nz * w;
      }
    }

    scatter(block.target, flux, right_hand_side);
  }
}

template <class Real>
void gradient_pass(int block_count, const TriangleBlock<Real>* blocks, const double* base,
                   bool rotation_only, double* right_hand_side) {
  (rotation_only ? gradient_pass_as<true, Real>
                 : gradient_pass_as<false, Real>)(block_count, blocks, base, right_hand_side);
}

/// Transposes lanes to kLanes consecutive rows of four.
template <class Real>
inline void store_rows(const Real (&lanes)[4][kLanes], Real* rows) {
  for (int lane = 0; lane < kLanes; ++lane)
    for (int c = 0; c < 4; ++c) rows[4 * lane + c] = lanes[c][lane];
}

/// In each lane Σ_k weights[k] · rows[index[k]], k below count.
template <class Real>
inline void weighted_sums(int count, const int32_t (*index)[kLanes], const Real (*weights)[kLanes],
                          const Real* rows, Real (&lanes)[4][kLanes]) {
  RowOf<Real> sums[kLanes] = {};
  for (int k = 0; k < count; ++k)
    for (int lane = 0; lane < kLanes; ++lane)
      add_scaled(sums[lane], weights[k][lane],
                 load(rows + 4 * static_cast<int64_t>(index[k][lane])));
  for (int lane = 0; lane < kLanes; ++lane)
    for (int c = 0; c < 4; ++c) lanes[c][lane] = sums[lane].v[c];
}

#ifdef __AVX2__
inline void store_rows(const float (&lanes)[4][kLanes], float* rows) {
  __m256 r[4];
  for (int c = 0; c < 4; ++c) r[c] = _mm256_loadu_ps(lanes[c]);
  transpose_quarters(r[0], r[1], r[2], r[3]);
  for (int i = 0; i < 4; ++i) {
    _mm_storeu_ps(rows + 4 * i, _mm256_castps256_ps128(r[i]));
    _mm_storeu_ps(rows + 4 * (i + 4), _mm256_extractf128_ps(r[i], 1));
  }
}

inline void weighted_sums(int count, const int32_t (*index)[kLanes], const float (*weights)[kLanes],
                          const float* rows, float (&lanes)[4][kLanes]) {
  __m256 sums[4];
  for (int i = 0; i < 4; ++i) sums[i] = _mm256_setzero_ps();
  for (int k = 0; k < count; ++k) {
    const __m256 weight = _mm256_loadu_ps(weights[k]);
    const auto pair = [&](int i) {
      return _mm256_insertf128_ps(
          _mm256_castps128_ps256(_mm_loadu_ps(rows + 4 * static_cast<int64_t>(index[k][i]))),
          _mm_loadu_ps(rows + 4 * static_cast<int64_t>(index[k][i + 4])), 1);
    };
    sums[0] = _mm256_fmadd_ps(_mm256_permute_ps(weight, 0x00), pair(0), sums[0]);
    sums[1] = _mm256_fmadd_ps(_mm256_permute_ps(weight, 0x55), pair(1), sums[1]);
    sums[2] = _mm256_fmadd_ps(_mm256_permute_ps(weight, 0xAA), pair(2), sums[2]);
    sums[3] = _mm256_fmadd_ps(_mm256_permute_ps(weight, 0xFF), pair(3), sums[3]);
  }
  transpose_quarters(sums[0], sums[1], sums[2], sums[3]);
  for (int c = 0; c < 4; ++c) _mm256_storeu_ps(lanes[c], sums[c]);
}
#endif

/// Squared length of a weighted mean of unit quaternions below which their signs may disagree:
/// close rotations with the same sign have means of length nearly 1.
template <class Real>
constexpr Real kMinMeanSquare = Real(0.8);

template <class Real>
inline bool is_zero(const Real* row) {
  return row[0] == 0 && row[1] == 0 && row[2] == 0 && row[3] == 0;
}

/// Recomputes the sums shorter than kMinMeanSquare, with each quaternion's sign chosen to agree
/// with the first non-zero one's.
template <class Real>
void agree_in_sign(int count, const int32_t (*index)[kLanes], const Real (*weights)[kLanes],
                   const Real* rows, Real (&lanes)[4][kLanes], Real (&length)[kLanes]) {
  for (int lane = 0; lane < kLanes; ++lane) {
    if (length[lane] >= kMinMeanSquare<Real>) continue;
    // The first non-zero row: zeros, of triangles without area, have no sign.
    int k0 = 0;
    while (k0 + 1 < count && is_zero(rows + 4 * static_cast<int64_t>(index[k0][lane]))) ++k0;
    const RowOf<Real> first = load(rows + 4 * static_cast<int64_t>(index[k0][lane]));
    RowOf<Real> sum = {};
    for (int k = 0; k < count; ++k) {
      const RowOf<Real> q = load(rows + 4 * static_cast<int64_t>(index[k][lane]));
      Real cosine = 0;
      for (int c = 0; c < 4; ++c) cosine += q.v[c] * first.v[c];
      add_scaled(sum, cosine < 0 ? -weights[k][lane] : weights[k][lane], q);
    }
    length[lane] = 0;
    for (int c = 0; c < 4; ++c) {
      lanes[c][lane] = sum.v[c];
      length[lane] += sum.v[c] * sum.v[c];
    }
  }
}

/// weighted_sums(), normalized; signs are made to agree where a sum is short.
template <class Real>
inline void mean_of_rows(int count, const int32_t (*index)[kLanes], const Real (*weights)[kLanes],
                         const Real* rows, Real (&lanes)[4][kLanes]) {
  weighted_sums(count, index, weights, rows, lanes);
  Real length[kLanes], shortest = 1;
  for (int lane = 0; lane < kLanes; ++lane) {
    length[lane] = 0;
    for (int c = 0; c < 4; ++c) length[lane] += lanes[c][lane] * lanes[c][lane];
    if (length[lane] < shortest) shortest = length[lane];
  }
  if (shortest < kMinMeanSquare<Real>) agree_in_sign(count, index, weights, rows, lanes, length);
  for (int lane = 0; lane < kLanes; ++lane) {
    const Real scale = guarded_inverse_sqrt(length[lane]);
    for (int c = 0; c < 4; ++c) lanes[c][lane] *= scale;
  }
}

#ifdef __AVX2__
/// By intrinsics, as compilers don't vectorize these square roots.
inline void mean_of_rows(int count, const int32_t (*index)[kLanes], const float (*weights)[kLanes],
                         const float* rows, float (&lanes)[4][kLanes]) {
  weighted_sums(count, index, weights, rows, lanes);
  __m256 length = _mm256_setzero_ps();
  for (const float (&sum)[kLanes] : lanes)
    length = _mm256_fmadd_ps(_mm256_loadu_ps(sum), _mm256_loadu_ps(sum), length);
  const __m256 is_short = _mm256_cmp_ps(length, _mm256_set1_ps(kMinMeanSquare<float>), _CMP_LT_OQ);
  if (_mm256_movemask_ps(is_short)) {
    float lengths[kLanes];
    _mm256_storeu_ps(lengths, length);
    agree_in_sign(count, index, weights, rows, lanes, lengths);
    length = _mm256_loadu_ps(lengths);
  }
  length = _mm256_sqrt_ps(_mm256_max_ps(length, _mm256_set1_ps(kMinSquare<float>)));
  const __m256 scale = _mm256_div_ps(_mm256_set1_ps(1), length);
  for (float (&sum)[kLanes] : lanes)
    _mm256_storeu_ps(sum, _mm256_mul_ps(_mm256_loadu_ps(sum), scale));
}
#endif

/// Limits below which a triangle counts as collapsed, as its rotation is rounding. With l and h the
/// ratios, now to rest, of |e1| and of the height over it: kMinAspectSquare bounds (h/l)² and
/// (l/h)², kMinStretchSquare l² and h². Without a unit.
template <class Real>
constexpr Real kMinAspectSquare = static_cast<Real>(sizeof(Real) == 4 ? 1e-10 : 1e-20);
template <class Real>
constexpr Real kMinStretchSquare = Real(1e-20);

/// Sets the rotations of collapsed triangles to zero. A loop of its own: inside rotation_pass()'s
/// the compiler would fuse other multiply-adds there, and results would change by rounding.
template <class Real>
inline void clear_collapsed(const TriangleEdges<Real>& edges, const TriangleShape<Real>& shape,
                            Real (&q)[4][kLanes]) {
  for (int lane = 0; lane < kLanes; ++lane) {
    const Real unit = shape.inverse_length[lane], stretch = shape.inverse_height[lane];
    const Real x1 = unit * edges.first[0][lane], y1 = unit * edges.first[1][lane],
               z1 = unit * edges.first[2][lane];
    const Real x2 = unit * edges.second[0][lane], y2 = unit * edges.second[1][lane],
               z2 = unit * edges.second[2][lane];
    const Real cx = y1 * z2 - z1 * y2, cy = z1 * x2 - x1 * z2, cz = x1 * y2 - y1 * x2;
    const Real length = x1 * x1 + y1 * y1 + z1 * z1;
    const Real area = (cx * cx + cy * cy + cz * cz) * stretch * stretch;
    const bool collapsed = (length < kMinStretchSquare<Real>) |
                           (area < kMinStretchSquare<Real> * length) |
                           (area < kMinAspectSquare<Real> * length * length) |
                           (length * length < kMinAspectSquare<Real> * area);
    for (int c = 0; c < 4; ++c) q[c][lane] = collapsed ? Real(0) : q[c][lane];
  }
}

template <class Real>
void rotation_pass(int block_count, const RotationBlock<Real>* blocks, const double* positions,
                   Real* quaternions) {
  for (int b = 0; b < block_count; ++b) {
    const RotationBlock<Real>& block = blocks[b];
    TriangleEdges<Real> edges;
    gather_edges(block.source, positions, edges);
    Real q[4][kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      const CurrentTriangle<Real> now = current_triangle(edges, block.shape, lane);
      // Rotates the frame within its plane by the rotation of [a s; 0 d], as gradient_pass_as().
      const Real trace = now.a + now.d;
      const Real scale = guarded_inverse_sqrt(trace * trace + now.s * now.s);
      const Real cosine = trace * scale, sine = -now.s * scale;
      const Real ux = cosine * now.tx + sine * now.bx, uy = cosine * now.ty + sine * now.by,
                 uz = cosine * now.tz + sine * now.bz;
      const Real vx = cosine * now.bx - sine * now.tx, vy = cosine * now.by - sine * now.ty,
                 vz = cosine * now.bz - sine * now.tz;

      // Four times the products of the quaternion's components. Normalizes the products with one
      // whose square is at least 1/4, so that nothing small is divided by.
      const Real ww = 1 + ux + vy + now.nz, xx = 1 + ux - vy - now.nz, yy = 1 - ux + vy - now.nz,
                 zz = 1 - ux - vy + now.nz;
      const Real wx = vz - now.ny, wy = now.nx - uz, wz = uy - vx;
      const Real xy = uy + vx, xz = uz + now.nx, yz = vz + now.ny;
      const bool w_or_x = ww + xx > yy + zz;  // w² + x² > 1/2, otherwise y² + z² ≥ 1/2
      const bool second = w_or_x ? xx > ww : zz > yy;
      const Real px = w_or_x ? (second ? xx : wx) : (second ? xz : xy);
      const Real py = w_or_x ? (second ? xy : wy) : (second ? yz : yy);
      const Real pz = w_or_x ? (second ? xz : wz) : (second ? zz : yz);
      const Real pw = w_or_x ? (second ? wx : ww) : (second ? wz : wy);
      const Real unit = guarded_inverse_sqrt(px * px + py * py + pz * pz + pw * pw);

      // now · from_rest
      const Real rx = block.from_rest[0][lane], ry = block.from_rest[1][lane],
                 rz = block.from_rest[2][lane], rw = block.from_rest[3][lane];
      const Real turn_w = pw * rw - px * rx - py * ry - pz * rz;
      const Real sign = turn_w < 0 ? -unit : unit;
      q[0][lane] = sign * (pw * rx + px * rw + py * rz - pz * ry);
      q[1][lane] = sign * (pw * ry - px * rz + py * rw + pz * rx);
      q[2][lane] = sign * (pw * rz + px * ry - py * rx + pz * rw);
      q[3][lane] = sign * turn_w;
    }
    clear_collapsed(edges, block.shape, q);
    store_rows(q, quaternions + 4 * kLanes * static_cast<int64_t>(b));
  }
}

template <class Real>
void mean_rotations(int first, int last, const int* starts, const int32_t (*index)[kLanes],
                    const Real (*weights)[kLanes], const Real* in, Real* out) {
  for (int b = first; b < last; ++b) {
    Real q[4][kLanes];
    mean_of_rows(starts[b + 1] - starts[b], index + starts[b], weights + starts[b], in, q);
    store_rows(q, out + 4 * kLanes * static_cast<int64_t>(b));
  }
}

/// Rotates vectors by unit quaternions.
template <class Real>
inline void rotate(const Real (&q)[4][kLanes], const Real (&v)[3][kLanes], Real (&out)[3][kLanes]) {
  for (int lane = 0; lane < kLanes; ++lane) {
    const Real x = q[0][lane], y = q[1][lane], z = q[2][lane], w = q[3][lane];
    const Real vx = v[0][lane], vy = v[1][lane], vz = v[2][lane];
    const Real cx = 2 * (y * vz - z * vy), cy = 2 * (z * vx - x * vz), cz = 2 * (x * vy - y * vx);
    out[0][lane] = vx + w * cx + (y * cz - z * cy);
    out[1][lane] = vy + w * cy + (z * cx - x * cz);
    out[2][lane] = vz + w * cz + (x * cy - y * cx);
  }
}

template <class Real>
void rotated_flux_pass(int block_count, const RotatedFluxBlock<Real>* blocks,
                       const Real* quaternions, double* right_hand_side) {
  Real thirds[3][kLanes];
  for (auto& weights : thirds)
    for (Real& weight : weights) weight = Real(1) / 3;
  for (int b = 0; b < block_count; ++b) {
    const RotatedFluxBlock<Real>& block = blocks[b];
    Real q[4][kLanes];
    mean_of_rows(3, block.corner, thirds, quaternions, q);
    Real flux[2][3][kLanes];
    for (int corner = 0; corner < 2; ++corner) rotate(q, block.flux[corner], flux[corner]);
    scatter(block.target, flux, right_hand_side);
  }
}

#ifdef __AVX2__
inline __m256d load_as_double(const float* row) { return _mm256_cvtps_pd(_mm_loadu_ps(row)); }
inline __m256d load_as_double(const double* row) { return _mm256_loadu_pd(row); }

/// The cross product of the first three values; the fourth is 0 if one of theirs is.
inline __m256d cross(__m256d a, __m256d b) {
  constexpr int kNext = 0xC9;  // y z x w
  const __m256d product = _mm256_fmsub_pd(a, _mm256_permute4x64_pd(b, kNext),
                                          _mm256_mul_pd(_mm256_permute4x64_pd(a, kNext), b));
  return _mm256_permute4x64_pd(product, kNext);
}
#endif

template <class Real>
void turn_vectors(int count, const Real* quaternions, const double* vectors, double* changes) {
  constexpr double kLeastSquare = 1e-300;  // Safety: of a zero, divided by
  for (int64_t i = 0; i < 4 * int64_t{count}; i += 4) {
    const Real* const q = quaternions + i;
#ifdef __AVX2__
    const __m256d turn = load_as_double(q), squares = _mm256_mul_pd(turn, turn),
                  pairs = _mm256_add_pd(squares, _mm256_permute_pd(squares, 0x5)),
                  square = _mm256_add_pd(pairs, _mm256_permute2f128_pd(pairs, pairs, 1)),
                  scale = _mm256_div_pd(_mm256_set1_pd(2),
                                        _mm256_max_pd(square, _mm256_set1_pd(kLeastSquare))),
                  first = cross(turn, _mm256_loadu_pd(vectors + i)),
                  w = _mm256_permute4x64_pd(turn, 0xFF);
    _mm256_storeu_pd(changes + i,
                     _mm256_mul_pd(scale, _mm256_fmadd_pd(w, first, cross(turn, first))));
#else
    const double* const r = vectors + i;
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double square = x * x + y * y + z * z + w * w;
    const double scale = 2 / (square > kLeastSquare ? square : kLeastSquare);
    const double cx = y * r[2] - z * r[1], cy = z * r[0] - x * r[2], cz = x * r[1] - y * r[0];
    changes[i] = scale * (w * cx + y * cz - z * cy);
    changes[i + 1] = scale * (w * cy + z * cx - x * cz);
    changes[i + 2] = scale * (w * cz + x * cy - y * cx);
    changes[i + 3] = 0;
#endif
  }
}

template <class Real>
void arm_areas(int block_count, const ArmBlock<Real>* blocks, const Real* quaternions,
               const double* displacements, Real* areas) {
  Real thirds[3][kLanes];
  for (auto& weights : thirds)
    for (Real& weight : weights) weight = Real(1) / 3;
  for (int b = 0; b < block_count; ++b) {
    const ArmBlock<Real>& block = blocks[b];
    Real q[4][kLanes];
    mean_of_rows(3, block.corner, thirds, quaternions, q);
    for (int c = 0; c < 3; ++c)  // turned back, so that the normal stays as it is
      for (Real& component : q[c]) component = -component;
    TriangleEdges<Real> change;
    gather_edges(block.corner, displacements, change);
    Real edge[2][3][kLanes], turned[3][kLanes];
    for (int k = 0; k < 2; ++k) {
      Real(&arm_edge)[3][kLanes] = k == 0 ? change.first : change.second;
      for (int c = 0; c < 3; ++c)
        for (int lane = 0; lane < kLanes; ++lane) arm_edge[c][lane] += block.arm_edge[k][c][lane];
      rotate(q, arm_edge, turned);
      for (int c = 0; c < 3; ++c)
        for (int lane = 0; lane < kLanes; ++lane)
          edge[k][c][lane] = block.centre_edge[k][c][lane] + turned[c][lane];
    }
    for (int lane = 0; lane < kLanes; ++lane) {
      const Real ux = edge[0][0][lane], uy = edge[0][1][lane], uz = edge[0][2][lane];
      const Real vx = edge[1][0][lane], vy = edge[1][1][lane], vz = edge[1][2][lane];
      areas[kLanes * static_cast<int64_t>(b) + lane] = (uy * vz - uz * vy) * block.normal[0][lane] +
                                                       (uz * vx - ux * vz) * block.normal[1][lane] +
                                                       (ux * vy - uy * vx) * block.normal[2][lane];
    }
  }
}

}  // namespace

}  // namespace dd
