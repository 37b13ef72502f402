// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "methods/examples/example_surface.h"
#include "surface/gradients.h"

namespace dd {

/// The passes over triangles that posing by example is made of, in blocks of kLanes triangles.
///
/// Only what a 3×3 matrix T does within its triangle's plane matters, so gradients are 3×2 here, in
/// units that make sums of squares areas. With three numbers a triangle, from its cotangents,
/// g_0 = (a, 0), g_1 = (b, 1/(2a)), g_2 = −g_0 − g_1: g_k · g_l is the triangle's part of L, the
/// gradient of positions x is x_0 g_0ᵀ + x_1 g_1ᵀ + x_2 g_2ᵀ with A_j ‖G_j(x)‖² its square, and the
/// divergence of a gradient X at corner k is X g_k. That is the flux of corner_divergence(), safe
/// for triangles without area in the same way. All are differences from the rest: a surface at rest
/// gives exact zeros.
template <class Real>
class ExamplePass {
 public:
  /// poisson: the system whose active triangles, rows and targets the passes work on; kept.
  ExamplePass(const ExampleSurface& of, const PoissonSystem& poisson);

  int example_count() const { return example_count_; }

  /// Takes the pose with these weights, (T_j − I) of each triangle of a section, and adds its
  /// divergence to rows, as PoissonSystem::solve() asks.
  void pose(int section, const Eigen::VectorXd& weights, bool rotation_only, double* rows);

  /// Sum of squares of the pose taken: how far it is from the rest, as an area.
  double size() const;

  /// The misfit (T_j − I) − G_j(offsets), kept, and its sum of squares. offsets: all rows.
  double misfit(const Rows& offsets);
  /// The divergence of the misfit by row, n×4.
  Rows misfit_divergence(int row_count) const;

  /// Room for the derivatives, before the first slope().
  void make_room() { slopes_.resize(changes_.size()); }
  /// Takes the pose's derivative by the weight of an example and adds its divergence to rows.
  void slope(int example, int section, double* rows);
  /// Takes G_j(offsets) from that derivative: with the solution for its divergence, what remains is
  /// the part of it that no positions can follow.
  void project(int example, const Rows& offsets);
  /// Half the energy's second and first derivatives by the weights.
  void second_order(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient) const;

  double bytes() const;

 private:
  using Lanes = Eigen::Array<Real, kLanes, 1>;
  using Vector = std::array<Lanes, 3>;
  using Gradient = std::array<Lanes, 6>;  // two columns
  struct Block {
    int32_t corner[3][kLanes];  // rows of offsets
    int32_t target[3][kLanes];
    Lanes a, b, c;  // g_0 = (a, 0), g_1 = (b, c)
    Gradient rest;  // of S
  };
  /// What an example does to a block's triangles: its rotations, and (U_ij − I) on their planes.
  struct Change {
    Vector turn;
    Gradient stretch;
  };
  /// The pose taken: r = Σ w_i r_ij and the factors of r and r² in exp r and in its derivative,
  /// (T_j − I) and T_j as gradients.
  struct Pose {
    Vector turn;
    Lanes sine, versine, cubic;
    Gradient moved, whole;
    bool rotation_only;
  };

  /// What the misfit makes of an example's second derivatives: see take_bends().
  struct Bend {
    Vector spin, pull, stretch_pull;  // a_i, K a_i + t_i, t_i
  };

  static Lanes dot(const Vector& u, const Vector& v) {
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  }
  static Lanes dot(const Gradient& X, const Gradient& Y) {
    return X[0] * Y[0] + X[1] * Y[1] + X[2] * Y[2] + X[3] * Y[3] + X[4] * Y[4] + X[5] * Y[5];
  }
  Gradient gradient(const Block& block, const Rows& x) const;
  static void add_divergence(const Block& block, const Gradient& X, const int32_t (*to)[kLanes],
                             double* rows);
  static Vector cross(const Vector& u, const Lanes& x, const Lanes& y, const Lanes& z) {
    return {u[1] * z - u[2] * y, u[2] * x - u[0] * z, u[0] * y - u[1] * x};
  }
  /// out += (first [r]× + second [r]×²) X.
  static void add_turned(const Vector& turn, const Lanes& first, const Lanes& second,
                         const Gradient& X, Gradient& out) {
    for (size_t column = 0; column < 6; column += 3) {
      const Vector once = cross(turn, X[column], X[column + 1], X[column + 2]);
      const Vector twice = cross(turn, once[0], once[1], once[2]);
      for (size_t c = 0; c < 3; ++c) out[column + c] += first * once[c] + second * twice[c];
    }
  }
  /// The spin a of d exp(r) = [a]× exp(r) where r changes by that: its left Jacobian's image.
  static Vector spin(const Pose& pose, const Vector& by);
  void take_bends(int block, Bend* bends) const;
  /// Calls body(block, chunk) for all blocks, in chunks whose number depends on the mesh alone, so
  /// that sums do not depend on the threads.
  template <class Body>
  void by_chunks(const Body& body) const;
  int chunk_count() const;

  const PoissonSystem& poisson_;
  int example_count_;
  ActiveBlocks layout_;
  std::vector<Block> blocks_;
  std::vector<Change> changes_;  // by block, then example
  std::vector<Pose> pose_;
  std::vector<Gradient> misfit_;
  std::vector<Gradient> slopes_;  // by block, then example
};

}  // namespace dd
