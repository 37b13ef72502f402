// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "kernels/kernels.h"
#include "methods/examples/example_surface.h"
#include "reconstruction/gradients.h"

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
  Rows misfit_divergence(int row_count);

  /// Room for the derivatives, before the first slope().
  void make_room() { slopes_.resize(changes_.size()); }
  /// Takes the pose's derivative by the weight of an example and adds its divergence to rows.
  void slope(int example, int section, double* rows);
  /// Half the energy's second and first derivatives by the weights. followed: of each example the
  /// solution for its slope's divergence, all rows; G_j of it is taken from the slope, and what
  /// remains is the part of it that no positions can follow.
  void second_order(const std::vector<Rows>& followed, Eigen::MatrixXd& hessian,
                    Eigen::VectorXd& gradient);

  double bytes() const;

 private:
  ExampleView<Real> view();
  /// Calls body(begin, end, chunk) for chunks of blocks whose number depends on the mesh alone, so
  /// that sums do not depend on the threads.
  template <class Body>
  void by_chunks(const Body& body) const;
  int chunk_count() const;

  const PoissonSystem& poisson_;
  int example_count_;
  ActiveBlocks layout_;
  std::vector<ExampleBlock<Real>> blocks_;
  std::vector<ExampleChange<Real>> changes_;  // by block, then example
  std::vector<ExamplePose<Real>> pose_;
  std::vector<ExampleGradient<Real>> misfit_;
  std::vector<ExampleGradient<Real>> slopes_;  // by block, then example
};

}  // namespace dd
