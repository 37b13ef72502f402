// SPDX-License-Identifier: GPL-3.0-or-later
// The kernels themselves, included once for each instruction set. See kernels.h for why nothing
// here may come from Eigen or the standard library's templates.
#include <math.h>

#include "kernels.h"

namespace dd {

namespace {

/// A row of four: the compiler makes one or two vector registers of it.
struct Row {
  double v[4];
};

inline Row load(const double* p) {
  Row r;
  for (int c = 0; c < 4; ++c) r.v[c] = p[c];
  return r;
}

inline void store(double* p, const Row& r) {
  for (int c = 0; c < 4; ++c) p[c] = r.v[c];
}

inline void add_scaled(Row& r, double factor, const Row& x) {
  for (int c = 0; c < 4; ++c) r.v[c] += factor * x.v[c];
}

void solve_factor(int size, const int* column_starts, const int* row_of, const double* values,
                  const double* inverse_pivots, double* rows) {
  for (int j = 0; j < size; ++j) {
    const Row x = load(rows + 4 * static_cast<int64_t>(j));
    for (int64_t k = column_starts[j]; k < column_starts[j + 1]; ++k) {
      double* target = rows + 4 * static_cast<int64_t>(row_of[k]);
      Row y = load(target);
      add_scaled(y, -values[k], x);
      store(target, y);
    }
  }
  for (int j = size - 1; j >= 0; --j) {
    double* own = rows + 4 * static_cast<int64_t>(j);
    const Row x = load(own);
    // Two sums, so that one multiply-add doesn't wait for the last.
    Row even = {{0, 0, 0, 0}}, odd = {{0, 0, 0, 0}};
    add_scaled(even, inverse_pivots[j], x);
    int64_t k = column_starts[j];
    const int64_t end = column_starts[j + 1];
    for (; k + 1 < end; k += 2) {
      add_scaled(even, -values[k], load(rows + 4 * static_cast<int64_t>(row_of[k])));
      add_scaled(odd, -values[k + 1], load(rows + 4 * static_cast<int64_t>(row_of[k + 1])));
    }
    if (k < end) add_scaled(even, -values[k], load(rows + 4 * static_cast<int64_t>(row_of[k])));
    for (int c = 0; c < 4; ++c) even.v[c] += odd.v[c];
    store(own, even);
  }
}

void blend(int row_count, int term_count, const double* weights, const double* coefficients,
           const double* rest, double* out) {
  for (int64_t r = 0; r < row_count; ++r) {
    Row sum = load(rest + 4 * r);
    const double* w = weights + r * term_count;
    for (int k = 0; k < term_count; ++k) add_scaled(sum, w[k], load(coefficients + 4 * k));
    store(out + 4 * r, sum);
  }
}

/// Below this a squared length counts as zero: its direction then becomes the zero vector, and
/// whatever a triangle collapsed to stays finite.
constexpr double kTiny = 1e-280;

inline double guarded_inverse_sqrt(double x) { return 1.0 / sqrt(x > kTiny ? x : kTiny); }

/// Two edges of each lane's triangle, from its first corner.
struct Edges {
  double first[3][kLanes], second[3][kLanes];
};

inline void gather_edges(const int32_t (&source)[3][kLanes], const double* positions,
                         Edges& edges) {
  for (int lane = 0; lane < kLanes; ++lane) {
    const double* p0 = positions + 4 * static_cast<int64_t>(source[0][lane]);
    const double* p1 = positions + 4 * static_cast<int64_t>(source[1][lane]);
    const double* p2 = positions + 4 * static_cast<int64_t>(source[2][lane]);
    for (int c = 0; c < 3; ++c) {
      edges.first[c][lane] = p1[c] - p0[c];
      edges.second[c][lane] = p2[c] - p0[c];
    }
  }
}

/// Adds the flux of corners 0 and 1 to their rows and takes both from that of corner 2.
inline void scatter(const int32_t (&target)[3][kLanes], const double (&flux)[2][3][kLanes],
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

/// A lane's triangle as it is now: the axes t = e1/|e1|, b = n × t and n, and in them e1 = (length,
/// 0), e2 = (along, height).
struct Present {
  double tx, ty, tz, bx, by, bz, nx, ny, nz, length, along, height;
};

inline Present present(const Edges& edges, int lane) {
  const double x1 = edges.first[0][lane], y1 = edges.first[1][lane], z1 = edges.first[2][lane];
  const double x2 = edges.second[0][lane], y2 = edges.second[1][lane], z2 = edges.second[2][lane];
  const double l2 = x1 * x1 + y1 * y1 + z1 * z1;
  const double inv_l = guarded_inverse_sqrt(l2);
  const double tx = x1 * inv_l, ty = y1 * inv_l, tz = z1 * inv_l;
  const double cx = y1 * z2 - z1 * y2, cy = z1 * x2 - x1 * z2, cz = x1 * y2 - y1 * x2;
  const double n2 = cx * cx + cy * cy + cz * cz;
  const double inv_n = guarded_inverse_sqrt(n2);
  const double nx = cx * inv_n, ny = cy * inv_n, nz = cz * inv_n;
  return {tx, ty, tz, ny * tz - nz * ty, nz * tx - nx * tz,           nx * ty - ny * tx,
          nx, ny, nz, l2 * inv_l,        tx * x2 + ty * y2 + tz * z2, n2 * inv_n * inv_l};
}

/// RotationOnly is known to the compiler, which can make vector code of the lanes only without a
/// branch in them.
template <bool RotationOnly>
void gradient_pass_as(int block_count, const TriangleBlock* blocks, const double* base,
                      double* right_hand_side) {
  for (int b = 0; b < block_count; ++b) {
    const TriangleBlock& block = blocks[b];
    Edges edges;
    gather_edges(block.source, base, edges);

    // S_j takes the rest frame (t1, t2, n) of the triangle to the present one (t1', t2', n') and
    // in between shears the plane by the upper triangular 2×2 matrix [a s; 0 d]. The rotation
    // in its polar decomposition is that of the 2×2 matrix, in closed form, with determinant +1.
    double flux[2][3][kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      const Present now = present(edges, lane);
      double a = now.length * block.inverse_length[lane];
      double s = now.along * block.inverse_height[lane] - now.length * block.shear[lane];
      double d = now.height * block.inverse_height[lane];
      double q = 0;
      if (RotationOnly) {
        const double cosine = a + d;
        const double scale = guarded_inverse_sqrt(cosine * cosine + s * s);
        a = d = cosine * scale;
        s *= scale;
        q = -s;
      }
      for (int corner = 0; corner < 2; ++corner) {
        const double u = block.flux[corner][0][lane], v = block.flux[corner][1][lane],
                     w = block.flux[corner][2][lane];
        const double f = a * u + s * v, g = q * u + d * v;
        flux[corner][0][lane] = now.tx * f + now.bx * g + now.nx * w;
        flux[corner][1][lane] = now.ty * f + now.by * g + now.ny * w;
        flux[corner][2][lane] = now.tz * f + now.bz * g + now.nz * w;
      }
    }

    scatter(block.target, flux, right_hand_side);
  }
}

void gradient_pass(int block_count, const TriangleBlock* blocks, const double* base,
                   bool rotation_only, double* right_hand_side) {
  (rotation_only ? gradient_pass_as<true> : gradient_pass_as<false>)(block_count, blocks, base,
                                                                     right_hand_side);
}

void rotation_pass(int block_count, const RotationBlock* blocks, const double* positions,
                   double* quaternions) {
  for (int b = 0; b < block_count; ++b) {
    const RotationBlock& block = blocks[b];
    Edges edges;
    gather_edges(block.source, positions, edges);
    double q[4][kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      const Present now = present(edges, lane);
      // The frame turned within its plane, as the 2×2 matrix [a s; 0 d] of gradient_pass asks.
      const double a = now.length * block.inverse_length[lane];
      const double s = now.along * block.inverse_height[lane] - now.length * block.shear[lane];
      const double d = now.height * block.inverse_height[lane];
      const double scale = guarded_inverse_sqrt((a + d) * (a + d) + s * s);
      const double cosine = (a + d) * scale, sine = -s * scale;
      const double ux = cosine * now.tx + sine * now.bx, uy = cosine * now.ty + sine * now.by,
                   uz = cosine * now.tz + sine * now.bz;
      const double vx = cosine * now.bx - sine * now.tx, vy = cosine * now.by - sine * now.ty,
                   vz = cosine * now.bz - sine * now.tz;

      // Four times the products of each quaternion component with all; the largest square is safe
      // to divide by.
      const double ww = 1 + ux + vy + now.nz, xx = 1 + ux - vy - now.nz, yy = 1 - ux + vy - now.nz,
                   zz = 1 - ux - vy + now.nz;
      const double wx = vz - now.ny, wy = now.nx - uz, wz = uy - vx;
      const double xy = uy + vx, xz = uz + now.nx, yz = vz + now.ny;
      const bool w_or_x = ww + xx > yy + zz;  // w² + x² > 1/2, or else y² + z² is
      const bool second = w_or_x ? xx > ww : zz > yy;
      const double px = w_or_x ? (second ? xx : wx) : (second ? xz : xy);
      const double py = w_or_x ? (second ? xy : wy) : (second ? yz : yy);
      const double pz = w_or_x ? (second ? xz : wz) : (second ? zz : yz);
      const double pw = w_or_x ? (second ? wx : ww) : (second ? wz : wy);
      const double unit = guarded_inverse_sqrt(px * px + py * py + pz * pz + pw * pw);

      // now · from_rest
      const double rx = block.from_rest[0][lane], ry = block.from_rest[1][lane],
                   rz = block.from_rest[2][lane], rw = block.from_rest[3][lane];
      const double turn_w = pw * rw - px * rx - py * ry - pz * rz;
      const double sign = turn_w < 0 ? -unit : unit;
      q[0][lane] = sign * (pw * rx + px * rw + py * rz - pz * ry);
      q[1][lane] = sign * (pw * ry - px * rz + py * rw + pz * rx);
      q[2][lane] = sign * (pw * rz + px * ry - py * rx + pz * rw);
      q[3][lane] = sign * turn_w;
    }
    double* out = quaternions + 4 * kLanes * static_cast<int64_t>(b);
    for (int lane = 0; lane < kLanes; ++lane)
      for (int c = 0; c < 4; ++c) out[4 * lane + c] = q[c][lane];
  }
}

inline double squared_length(const Row& q) {
  return (q.v[0] * q.v[0] + q.v[1] * q.v[1]) + (q.v[2] * q.v[2] + q.v[3] * q.v[3]);
}

/// Σ weights[k] · ± in[index[k]] with signs that agree with the first.
Row sum_with_signs(int begin, int end, const int* index, const double* weights, const double* in) {
  const Row first = load(in + 4 * static_cast<int64_t>(index[begin]));
  Row sum = {{0, 0, 0, 0}};
  for (int k = begin; k < end; ++k) {
    const Row q = load(in + 4 * static_cast<int64_t>(index[k]));
    double cosine = 0;
    for (int c = 0; c < 4; ++c) cosine += q.v[c] * first.v[c];
    add_scaled(sum, cosine < 0 ? -weights[k] : weights[k], q);
  }
  return sum;
}

void mean_rotations(int count, const int* starts, const int* index, const double* weights,
                    const double* in, double* out) {
  for (int i = 0; i < count; ++i) {
    Row sum = {{0, 0, 0, 0}};
    for (int k = starts[i]; k < starts[i + 1]; ++k)
      add_scaled(sum, weights[k], load(in + 4 * static_cast<int64_t>(index[k])));
    // Rotations that lie close together sum up to nearly 1, unless their signs differ.
    if (squared_length(sum) < 0.8)
      sum = sum_with_signs(starts[i], starts[i + 1], index, weights, in);
    const double scale = guarded_inverse_sqrt(squared_length(sum));
    for (int c = 0; c < 4; ++c) sum.v[c] *= scale;
    store(out + 4 * static_cast<int64_t>(i), sum);
  }
}

void turn_pass(int block_count, const TurnBlock* blocks, const double* quaternions,
               double* right_hand_side) {
  for (int b = 0; b < block_count; ++b) {
    const TurnBlock& block = blocks[b];
    const double* in = quaternions + 4 * kLanes * static_cast<int64_t>(b);
    double q[4][kLanes];
    for (int lane = 0; lane < kLanes; ++lane)
      for (int c = 0; c < 4; ++c) q[c][lane] = in[4 * lane + c];
    double flux[2][3][kLanes];
    for (int corner = 0; corner < 2; ++corner) {
      for (int lane = 0; lane < kLanes; ++lane) {
        const double x = q[0][lane], y = q[1][lane], z = q[2][lane], w = q[3][lane];
        const double fx = block.flux[corner][0][lane], fy = block.flux[corner][1][lane],
                     fz = block.flux[corner][2][lane];
        const double cx = 2 * (y * fz - z * fy), cy = 2 * (z * fx - x * fz),
                     cz = 2 * (x * fy - y * fx);
        flux[corner][0][lane] = fx + w * cx + (y * cz - z * cy);
        flux[corner][1][lane] = fy + w * cy + (z * cx - x * cz);
        flux[corner][2][lane] = fz + w * cz + (x * cy - y * cx);
      }
    }
    scatter(block.target, flux, right_hand_side);
  }
}

}  // namespace

extern const Kernels DD_KERNEL_SET;
const Kernels DD_KERNEL_SET = {DD_KERNEL_NAME, solve_factor,   blend,    gradient_pass,
                               rotation_pass,  mean_rotations, turn_pass};

}  // namespace dd
